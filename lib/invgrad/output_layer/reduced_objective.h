// An objective whose network has its best output layer: a function of the other
// weights (variable projection).
//
//   theta = (u, C),   C*(u) = argmin_C L(u, C),   L*(u) = L(u, C*(u))
//   gradient L*(u) = dL/du at C*(u)
//   J* = (I - Q Q^T) J_u,   J_C = U diag(s) V^T,   Q = U diag(s^2/(s^2+l))^(1/2)
//
// The gradient needs no derivative of C*, because dL/dC = 0 there. J*, the
// Jacobian of the residuals that the best layer leaves, is Kaufman's: that of
// Golub and Pereyra without a term that is orthogonal to the residuals, and so
// with the same gradient J*^T g [1, 2]. docs/variable_projection.md derives both.
//
// A batch of fewer samples than features determines no layer. So there are two
// ways to solve C:
//
//   of_batch   on the batch of each step, after each change of u. The ridge l is
//              (1e-9 s_max)^2, towards the last C. J is projected: with
//              Gauss-Newton and Levenberg-Marquardt rules this is variable
//              projection. For batches of all samples.
//   otherwise  every few steps on a share of the training samples (share.h), the
//              next one each time, or on as many fresh ones, with the larger of
//              two ridges: of cross-validation (normal_equations.h), and of the
//              drift of the features from one solution to the next
//              (drift_ridge.h). J_u is not projected: of the range of J_C over
//              all N samples, a batch has the share B / N. A run without fresh
//              samples reports its weights with the C of all samples.
//
// The change of C is exact for problems in x (inverse/output_layer_problem.h) and
// for residuals in y that are linear in C; otherwise it is a Gauss-Newton step,
// which is halved until the loss of its samples falls.
//
// Shapes:  theta: n;  u: n - fan_in fan_out, in the order of theta; a rule sees
//          gradient, J and Hessian in u alone.
// Cost:    of a solution: a forward pass of all samples, their pull-backs, and
//          2 N p (p + 2 q) for p unknowns and q right-hand sides: p = fan_in and
//          q = fan_out in x; p = fan_in fan_out and q = 1 by Gauss-Newton, which
//          also forms J_C. The projection: 2 m p^2.
// Fails:   with a message if features are not finite.
//
// [1] Golub, Pereyra. The differentiation of pseudo-inverses and nonlinear least
//     squares problems whose variables separate. SIAM J. Numer. Anal. 10 (1973).
// [2] Kaufman. A variable projection method for solving separable nonlinear least
//     squares problems. BIT 15 (1975).
#ifndef INVGRAD_OUTPUT_LAYER_REDUCED_OBJECTIVE_H_
#define INVGRAD_OUTPUT_LAYER_REDUCED_OBJECTIVE_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/inverse/batch_objective.h"
#include "invgrad/output_layer/drift_ridge.h"
#include "invgrad/output_layer/normal_equations.h"

namespace invgrad {

class ReducedObjective : public BatchObjective {
 public:
  // `whole`: the objective of all weights of the model. The model has an
  // OutputLayer and other weights (CHECKed). Model and data outlive this object.
  // train: the samples that C is solved on; null: those of each batch.
  ReducedObjective(std::unique_ptr<BatchObjective> whole,
                   const Model* model,
                   const DataSet* train);

  // The weights are theta, the derivatives those in u.
  bool Linearize(const Eigen::VectorXd& weights,
                 const DataSet& batch,
                 const LinearizationParts& parts,
                 Linearization* linearization,
                 std::string* error) override;
  bool LinearizeAgain(const Eigen::VectorXd& weights,
                      const DataSet& batch,
                      const LinearizationParts& parts,
                      Linearization* linearization,
                      std::string* error) override;
  bool LinearizeOutputLayer(const Eigen::VectorXd& weights,
                            const DataSet& samples,
                            OutputLayerProblem* problem,
                            std::string* error) override {
    return whole_->LinearizeOutputLayer(weights, samples, problem, error);
  }
  bool is_proxy() const override { return whole_->is_proxy(); }
  int updates_per_step() const override { return whole_->updates_per_step(); }
  PullBackCounts* mutable_counts() override { return whole_->mutable_counts(); }

  bool of_batch() const { return train_ == nullptr; }
  // u.
  Eigen::VectorXd Unknowns(const Eigen::VectorXd& weights) const override;
  void AddStep(const Eigen::VectorXd& step, Eigen::VectorXd* weights) const;
  // AddStep, and with of_batch C*(u) of the batch.
  bool Plus(const Eigen::VectorXd& step,
            const DataSet& batch,
            Eigen::VectorXd* weights,
            std::string* error) override;

  // Samples that C is solved on, some at a time.
  using Blocks = std::vector<DataSet>;

  // Sets C*(u), of the training samples or of the batch. If it fails, the weights
  // do not change.
  bool SolveOutputLayer(const DataSet& batch,
                        Eigen::VectorXd* weights,
                        std::string* error);
  // The k-th share of the training samples, k = 0, 1, .. modulo the number of
  // shares.
  bool TrainingShare(long k, Blocks* share, std::string* error);
  // The blocks of fresh samples.
  bool Split(const DataSet& samples, Blocks* blocks, std::string* error) const;
  // Sets C*(u) of a share. steps_follow: with the ridge of the drift, too.
  bool SolveOnShare(const Blocks& share,
                    bool steps_follow,
                    Eigen::VectorXd* weights,
                    std::string* error) {
    return Solve(share, steps_follow ? &drift_ : nullptr, weights, error);
  }
  std::vector<Eigen::VectorXd*> MutableState() override {
    return {drift_.mutable_state()};
  }

 private:
  bool Reduce(bool ok,
              const LinearizationParts& parts,
              Linearization* linearization) const;
  // The Schur complement of the layer, or the part of u.
  Eigen::MatrixXd ReducedHessian(const Eigen::MatrixXd& H) const;

  bool IsInX() const { return whole_->is_proxy() || IsSolvedInX(model_); }
  // Sets blocks_, unless they are set.
  bool SetTrainingBlocks(std::string* error);
  // |y - y*|^2 over the samples; infinity if it is not finite.
  double SquaredNorm(const Eigen::VectorXd& weights, const Blocks& blocks);
  // drift: null for samples that no steps follow.
  bool Solve(const Blocks& blocks,
             DriftRidge* drift,
             Eigen::VectorXd* weights,
             std::string* error);
  bool FindChange(const Eigen::VectorXd& weights,
                  const Blocks& blocks,
                  DriftRidge* drift,
                  NormalEquations::Solution* change,
                  std::string* error);
  // With a ridge that pulls C towards zero.
  bool SolveTowardsZero(const Eigen::VectorXd& weights,
                        DriftRidge* drift,
                        NormalEquations* equations,
                        NormalEquations::Solution* change);
  void AddChange(const Eigen::MatrixXd& Z,
                 double factor,
                 Eigen::VectorXd* weights) const;
  // Adds Z, Z/2, .. until |y - y*|^2 is lower. Returns false if it never is.
  bool LowerSquaredNorm(const Eigen::MatrixXd& Z,
                        const Blocks& blocks,
                        Eigen::VectorXd* weights,
                        double* squared_norm);

  const std::unique_ptr<BatchObjective> whole_;
  const Model& model_;
  const DataSet* const train_;  // may be null
  const LayerColumns layer_;
  const std::vector<int> others_;  // the numbers of u in theta
  Blocks blocks_;                  // the training samples
  DriftRidge drift_;
};

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_REDUCED_OBJECTIVE_H_
