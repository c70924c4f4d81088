// The Jacobian of a batch whose samples are shared by the ranks of a run.
//
//   J = [J_0; J_1; .. ],   rank r knows J_r, the rows of its samples
//   J v = [J_r v],   J^T w = sum_r J_r^T w_r,   J^T J = sum_r J_r^T J_r
//
// Vectors of size m and n are the same on all ranks. A network's J J^T is made
// from the factors of all samples, which travel in place of J: each rank computes
// its own columns of it.
//
// Shapes:  as JacobianOperator, with m of the whole batch.
// Cost:    in addition to that of J_r, a rank sends: J v: its rows N - 1 times,
//          of N ranks; J^T w: 2 n; J J^T, ColumnBlocks: its factors, once; J^T J:
//          2 n^2, in strips n^2; ToDense: J_r. Every rank holds the factors of all
//          samples after J J^T or ColumnBlocks, and J_r^T J_r before the sum.
// Fails:   never by itself. All ranks must call the same functions.
#ifndef INVGRAD_DISTRIBUTED_DISTRIBUTED_JACOBIAN_H_
#define INVGRAD_DISTRIBUTED_DISTRIBUTED_JACOBIAN_H_

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/core/shared_jacobian.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

class DistributedJacobian final : public JacobianOperator,
                                  public SharedJacobian,
                                  public LayeredJacobian {
 public:
  // `own`: J_r, of this rank's share of `num_samples` (Communicator::OwnShare),
  // of which each has as many rows.
  DistributedJacobian(std::shared_ptr<const JacobianOperator> own,
                      std::shared_ptr<const Communicator> communicator,
                      int num_samples);

  int rows() const override { return rows_per_sample_ * num_samples_; }
  int cols() const override { return own_->cols(); }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  void Gram(Eigen::MatrixXd* JJt) const override;
  const Communicator& communicator() const override { return *communicator_; }
  void GramStrips(const ColumnStrips& strips,
                  Eigen::MatrixXd* JJt) const override;
  void ParameterGramStrips(const ColumnStrips& strips,
                           Eigen::MatrixXd* JtJ) const override;
  void ToDense(Eigen::MatrixXd* J) const override;
  void ParameterGram(Eigen::MatrixXd* JtJ) const override;
  std::string RowName(int row) const override;
  // Of all samples, on all ranks; none if the own blocks are no layers.
  std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocks()
      const override;
  std::vector<LayerColumns> FactorLayers() const override {
    return FactorLayersOf(*own_);
  }
  void FactorsAlong(const Eigen::VectorXd& w,
                    SampledFactors* factors) const override;

  // The vector of all ranks, from this rank's rows of it.
  Eigen::VectorXd GatherRows(const Eigen::VectorXd& own) const;
  // This rank's rows of a vector.
  Eigen::VectorXd OwnRows(const Eigen::VectorXd& w) const;

 private:
  struct LayerFactors {
    Eigen::MatrixXd inputs;
    Eigen::MatrixXd deltas;
    int num_calls = 1;
  };
  // Of all samples; the first call gathers them.
  const std::vector<LayerFactors>& Factors() const;
  std::vector<LayerJacobian> Layers() const;

  std::shared_ptr<const JacobianOperator> own_;
  std::shared_ptr<const Communicator> communicator_;
  int num_samples_;
  int rows_per_sample_;

  mutable std::once_flag factors_gathered_;
  mutable std::vector<LayerFactors> factors_;
};

}  // namespace invgrad

#endif  // INVGRAD_DISTRIBUTED_DISTRIBUTED_JACOBIAN_H_
