#include "invgrad/distributed/distributed_objective.h"

#include <functional>
#include <utility>

#include "invgrad/chain/sample_error.h"
#include "invgrad/distributed/distributed_jacobian.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// The loss on the curve of all ranks' samples.
LossOnCurve SumOverRanks(const LossOnCurve& own,
                         const Communicator& communicator) {
  const Eigen::Vector3d own_values(own.loss, own.slope, own.speed);
  Eigen::Matrix3Xd values(3, communicator.size());
  communicator.Gather(own_values.data(),
                      communicator.SharedSizes(communicator.size(), 3),
                      values.data());
  const Eigen::Vector2d sums = values.topRows<2>().rowwise().sum();
  return {sums[0], sums[1], values.row(2).maxCoeff()};
}

}  // namespace

DistributedObjective::DistributedObjective(
    std::unique_ptr<BatchObjective> own,
    std::shared_ptr<const Communicator> communicator)
    : own_(std::move(own)), communicator_(std::move(communicator)) {}

DataSet DistributedObjective::OwnPiece(const DataSet& batch) const {
  CHECK_GE(batch.num_samples(), communicator_->size());
  const Share share = communicator_->OwnShare(batch.num_samples());
  return batch.Piece(share.first, share.count);
}

bool DistributedObjective::Linearize(const VectorXd& weights,
                                     const DataSet& batch,
                                     const LinearizationParts& parts,
                                     Linearization* linearization,
                                     std::string* error) {
  const bool ok =
      own_->Linearize(weights, OwnPiece(batch), parts, linearization, error);
  return Combine(ok, batch.num_samples(), parts, linearization, error);
}

bool DistributedObjective::LinearizeAgain(const VectorXd& weights,
                                          const DataSet& batch,
                                          const LinearizationParts& parts,
                                          Linearization* linearization,
                                          std::string* error) {
  const bool ok = own_->LinearizeAgain(
      weights, OwnPiece(batch), parts, linearization, error);
  return Combine(ok, batch.num_samples(), parts, linearization, error);
}

VectorXd DistributedObjective::GatherRows(const VectorXd& own,
                                          int num_samples) const {
  const int own_samples = communicator_->OwnShare(num_samples).count;
  CHECK_EQ(own.size() % own_samples, 0);
  const int rows_per_sample = static_cast<int>(own.size()) / own_samples;
  return communicator_
      ->GatherColumns(own.transpose(), num_samples, rows_per_sample)
      .transpose();
}

bool DistributedObjective::Combine(bool ok,
                                   int num_samples,
                                   const LinearizationParts& parts,
                                   Linearization* linearization,
                                   std::string* error) const {
  if (!communicator_->Agree(ok, error)) return false;
  VectorXd sums(1 + linearization->gradient.size());
  sums << linearization->cost, linearization->gradient;
  communicator_->Sum(sums.data(), sums.size());
  linearization->cost = sums[0];
  linearization->gradient = sums.tail(sums.size() - 1);
  MatrixXd& hessian = linearization->hessian;
  communicator_->Sum(hessian.data(), hessian.size());
  if (linearization->jacobian != nullptr) {
    auto own = std::make_shared<Linearization>();
    own->loss_gradient = std::move(linearization->loss_gradient);
    own->jacobian = std::move(linearization->jacobian);
    own->loss_hessian_times = std::move(linearization->loss_hessian_times);
    own->loss_on_curve = std::move(linearization->loss_on_curve);
    const auto jacobian = std::make_shared<DistributedJacobian>(
        own->jacobian, communicator_, num_samples);
    linearization->jacobian = jacobian;
    linearization->loss_gradient = jacobian->GatherRows(own->loss_gradient);
    linearization->loss_hessian_times = nullptr;
    if (own->loss_hessian_times) {
      linearization->loss_hessian_times = [jacobian, own](const VectorXd& v) {
        return jacobian->GatherRows(
            own->loss_hessian_times(jacobian->OwnRows(v)));
      };
    }
    linearization->loss_on_curve = nullptr;
    if (own->loss_on_curve) {
      linearization->loss_on_curve =
          [jacobian, own, communicator = communicator_](const VectorXd& t,
                                                        double eta) {
            return SumOverRanks(own->loss_on_curve(jacobian->OwnRows(t), eta),
                                *communicator);
          };
    }
    linearization->own = std::move(own);
  }
  if (linearization->jacobian == nullptr) {
    VectorXd& g = linearization->loss_gradient;
    if (parts.loss_gradient) {
      g = GatherRows(g, num_samples);
    } else {
      g.resize(0);
    }
  }
  return CheckCost(linearization->cost, error) &&
         CheckDerivatives(linearization->gradient, hessian, error);
}

bool DistributedCost(const Model& model,
                     const VectorXd& weights,
                     const DataSet& data,
                     const Communicator* communicator,
                     double* cost,
                     std::string* error) {
  if (communicator == nullptr) return model.Cost(weights, data, cost, error);
  const Share share = communicator->OwnShare(data.num_samples());
  *cost = 0.0;
  const bool ok =
      share.count == 0 ||
      model.Cost(weights, data.Piece(share.first, share.count), cost, error);
  if (!communicator->Agree(ok, error)) return false;
  communicator->Sum(cost, 1);
  return CheckCost(*cost, error);
}

}  // namespace invgrad
