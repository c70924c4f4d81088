#include "invgrad/chain/chain_jacobian.h"

#include <utility>

#include "fmt/core.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

ChainJacobian::ChainJacobian(
    std::shared_ptr<const Network> network,
    VectorXd weights,
    std::unique_ptr<const Network::Pass> pass,
    std::shared_ptr<const Simulator> simulator,
    std::vector<std::unique_ptr<const JacobianOperator>> simulators)
    : network_(std::move(network)),
      weights_(std::move(weights)),
      pass_(std::move(pass)),
      simulator_(std::move(simulator)),
      simulators_(std::move(simulators)),
      num_samples_(pass_->num_columns()),
      outputs_per_sample_(network_->num_outputs()) {
  CHECK_EQ(weights_.size(), network_->num_weights());
  CHECK_EQ(pass_->num_channels, 1);
  if (simulators_.empty()) return;
  CHECK_EQ(simulators_.size(), static_cast<std::size_t>(num_samples_));
  outputs_per_sample_ = simulators_[0]->rows();
  for (const auto& simulator : simulators_) {
    CHECK_EQ(simulator->cols(), network_->num_outputs());
    CHECK_EQ(simulator->rows(), outputs_per_sample_);
  }
}

void ChainJacobian::Times(const VectorXd& v, VectorXd* Jv) const {
  CHECK_EQ(v.size(), cols());
  MatrixXd dx;
  network_->Tangent(weights_, *pass_, v, &dx);
  if (simulators_.empty()) {
    *Jv = dx.reshaped();
    return;
  }
  Jv->resize(rows());
  VectorXd product;
  for (Index s = 0; s < num_samples_; ++s) {
    simulators_[s]->Times(dx.col(s), &product);
    Jv->segment(s * outputs_per_sample_, outputs_per_sample_) = product;
  }
}

MatrixXd ChainJacobian::OutputCovectors(const VectorXd& w) const {
  CHECK_EQ(w.size(), rows());
  MatrixXd x_bar(network_->num_outputs(), num_samples_);
  VectorXd product;
  for (Index s = 0; s < num_samples_; ++s) {
    const auto of_sample =
        w.segment(s * outputs_per_sample_, outputs_per_sample_);
    if (simulators_.empty()) {
      x_bar.col(s) = of_sample;
    } else {
      simulators_[s]->TransposeTimes(of_sample, &product);
      x_bar.col(s) = product;
    }
  }
  return x_bar;
}

void ChainJacobian::TransposeTimes(const VectorXd& w, VectorXd* Jtw) const {
  network_->Backward(weights_, *pass_, OutputCovectors(w), Jtw);
}

void ChainJacobian::FactorsAlong(const VectorXd& w,
                                 SampledFactors* factors) const {
  FactorsOf(*network_, weights_, *pass_, OutputCovectors(w), factors);
}

std::string ChainJacobian::RowName(int row) const {
  return SampleRowName(row, outputs_per_sample_);
}

std::string SampleRowName(int row, int outputs_per_sample) {
  return fmt::format("row {} (sample {}, output {})",
                     row,
                     row / outputs_per_sample,
                     row % outputs_per_sample);
}

}  // namespace invgrad
