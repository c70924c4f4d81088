#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/chain/weights_network.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/internal/logging.h"
#include "invgrad/minimize.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

bool FitsPoint(const Model& model,
               const LinearizationParts& parts,
               std::string* error) {
  const double m = model.loss().size();
  const double n = model.num_weights();
  constexpr double kDouble = sizeof(double);
  std::vector<MemoryPart> memory;
  // The exact Hessian needs J itself.
  if (model.simulator().forms_jacobian() || parts.hessian) {
    memory.push_back({"J", 2.0 * kDouble * m * n});
  }
  if (parts.hessian) memory.push_back({"Hessian", 3.0 * kDouble * n * n});
  if (!model.loss().SquaredNormFactor().has_value() &&
      model.loss().forms_hessian()) {
    memory.push_back({"Hessian of the loss", kDouble * m * m});
  }
  return FitsInMemory(fmt::format("J {} x {}", m, n), memory, 0.0, error);
}

}  // namespace

PointObjective::PointObjective(std::shared_ptr<const Simulator> simulator,
                               std::shared_ptr<const Loss> loss,
                               VectorXd target,
                               VectorXd start)
    : model_(std::make_shared<WeightsNetwork>(simulator->num_inputs()),
             simulator,
             std::move(loss),
             Reduction::kSum),
      x_(std::move(start)) {
  CHECK_EQ(simulator->num_context(), 0)
      << "a simulator without a network has no sample to take a context from";
  CHECK_EQ(simulator->num_outputs(), target.size());
  CHECK_EQ(simulator->num_inputs(), x_.size());
  data_.inputs.resize(0, 1);
  data_.contexts.resize(0, 1);
  data_.solutions.resize(0, 1);
  data_.targets = std::move(target);
}

bool PointObjective::Linearize(const LinearizationParts& parts,
                               Linearization* linearization,
                               std::string* error) const {
  if ((parts.jacobian || parts.hessian) && !FitsPoint(model_, parts, error)) {
    return false;
  }
  return model_.Linearize(x_, data_, parts, linearization, error);
}

void PointObjective::SetState(const VectorXd& state) {
  CHECK_EQ(state.size(), x_.size());
  x_ = state;
}

bool PointObjective::Plus(const VectorXd& step) {
  CHECK_EQ(step.size(), x_.size());
  if (!step.allFinite()) return false;
  x_ += step;
  return true;
}

VectorXd PointObjective::Outputs() const {
  MatrixXd y;
  std::string ignored;
  if (!model_.Predict(x_, data_, &y, &ignored)) return VectorXd();
  return y.col(0);
}

}  // namespace invgrad
