// Points that are renewed in training: every num_steps steps the first term of
// an equation has other points.
//
//   sequence     the next N points of the sequence in points.h
//   by residual  of the next 4 N points, N that are drawn with the density
//                (1 + |R| / mean |R|) / 2 at the weights of that moment [1]
//
// A network that fits a fixed set of points can be wrong between them. Points
// drawn by residual are denser where the equation holds least, for example at a
// front. They have equal weights, so that the loss of a step weights the front
// more, too.
//
// The draw is stratified: a random place in each of N equal intervals of the
// summed density, with random numbers of the step.
//
// The samples of the other terms stay.
// Cost:    a forward pass of 4 N points by residual, and the jets of N points.
// Fails:   functions of the trial function that are not finite at a point are
//          CHECKed, because the whole box is their domain.
//
// [1] Wu, Zhu, Tan, Kartha, Lu. A comprehensive study of non-adaptive and
//     residual-based adaptive sampling for physics-informed neural networks.
//     CMAME 403 (2023), equation 2 with k = c = 1. arXiv 2207.10289.
#ifndef INVGRAD_EQUATIONS_RENEWED_POINTS_H_
#define INVGRAD_EQUATIONS_RENEWED_POINTS_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/data_source.h"
#include "invgrad/equation.h"
#include "invgrad/equation_points.h"
#include "invgrad/model.h"

namespace invgrad {

class RenewedPoints final : public DataSource {
 public:
  struct Options {
    int num_steps = 50;
    bool by_residual = false;
  };

  // N: the points of the first term. The model that is trained is
  // EquationModel(equation), with any network.
  RenewedPoints(Equation equation, Box box, Options options);

  // batch_size: the points of all terms (CHECKed).
  DataSet Batch(long step,
                int batch_size,
                const Model& model,
                const Eigen::VectorXd& weights) const override;
  long steps_per_set() const override { return options_.num_steps; }
  bool needs_whole_batches() const override { return true; }
  std::string Name() const override;

 private:
  Eigen::MatrixXd DrawByResidual(const QuadraturePoints& candidates,
                                 const Model& model,
                                 const Eigen::VectorXd& weights,
                                 long set) const;

  Equation equation_;
  Box box_;
  Options options_;
};

}  // namespace invgrad

#endif  // INVGRAD_EQUATIONS_RENEWED_POINTS_H_
