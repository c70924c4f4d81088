// A linear simulator.
//
//   y = A x + b,   J = A
//
// Shapes:  A: |y| x |x|, sparse;  b: |y|.
// Cost:    one pass over the stored entries of A; J takes |y| |x| more. The
//          first InversePower decomposes A, about 4 m n k + 22 k^3 with k =
//          min(m, n), and keeps (m + n) k numbers; a copy of the simulator
//          shares them. Each InversePower takes 2 (m + n) k.
// Fails:   returns false if y is not finite. Sizes that do not fit are CHECKed.
#ifndef INVGRAD_LINEAR_SIMULATOR_H_
#define INVGRAD_LINEAR_SIMULATOR_H_

#include <memory>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/simulator.h"

namespace invgrad {

class LinearSimulator final : public Simulator {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  LinearSimulator(const Matrix& A, Eigen::VectorXd b);

  int num_inputs() const override { return static_cast<int>(A_.cols()); }
  int num_outputs() const override { return static_cast<int>(A_.rows()); }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override;
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;
  bool is_linear() const override { return true; }
  void InversePower(double kappa,
                    double tau,
                    const double* d_y,
                    double* d_x) const override;

 private:
  struct Decomposition;

  Matrix A_;
  Eigen::VectorXd b_;
  std::shared_ptr<Decomposition> decomposition_;  // of A, made when needed
};

}  // namespace invgrad

#endif  // INVGRAD_LINEAR_SIMULATOR_H_
