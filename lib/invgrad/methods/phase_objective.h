// What the rule of a method's phase lowers on batches: the loss of the model, or
// the proxy of a pull-back; and the updates of one step.
#ifndef INVGRAD_METHODS_PHASE_OBJECTIVE_H_
#define INVGRAD_METHODS_PHASE_OBJECTIVE_H_

#include <functional>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/data.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/inverse/batch_objective.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/linearization.h"
#include "invgrad/method.h"
#include "invgrad/model.h"
#include "invgrad/update_rule.h"

namespace invgrad {

// Whether a rule compares costs: it judges its steps or evaluates trials. The
// cost must then be the one that its linearizations are of.
bool ComparesCosts(UpdateRule* rule);
// The beginning of a message where there is no such cost.
inline constexpr char kComparesCosts[] =
    "the rule compares costs (adaptive, geodesic, ssbroyden, hessian_free, "
    "control=gain), and ";
inline constexpr char kJointStepHasNoCost[] =
    "a step in y, LOSS/joint, is the gradient of none: leave it out";

// The objective of all weights; null, with *error, if the pull-back cannot train
// this model on these data by this rule. `inverse` and `communicator` may be
// null. The model must outlive the objective.
std::unique_ptr<BatchObjective> MakePhaseObjective(
    const Phase& phase,
    UpdateRule* rule,
    const Model& model,
    const DataSet& train,
    std::shared_ptr<const InverseSimulator> inverse,
    const Communicator* communicator,
    std::string* error);

// The cost of the objective itself; NaN if it is not finite.
double CostOf(BatchObjective* objective,
              const DataSet& batch,
              const Eigen::VectorXd& weights);

// Makes all updates of a step; *at_weights is the linearization for the first
// one. After an update that the rule's judge does not keep, `undo` puts the
// weights before it back.
bool MakeUpdates(const DataSet& batch,
                 const std::function<void(const Eigen::VectorXd& before)>& undo,
                 BatchObjective* objective,
                 UpdateRule* rule,
                 Linearization* at_weights,
                 Eigen::VectorXd* weights,
                 std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_METHODS_PHASE_OBJECTIVE_H_
