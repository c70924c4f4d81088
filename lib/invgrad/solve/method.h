// A method is what a comparison compares: an update rule, a way back for each
// part of the chain, a minimizer of Ceres, or a minimizer of Ceres to which a
// rule proposes its steps.
//
//   half_inverse:truncation=1e-6            rule
//   newton/inverse/adam:y_step_size=0.5     loss, simulator and network
//   sip:step_size=1e-3                      the same, by its name
//   ceres_lm:initial_radius=1e6             Ceres
//   ceres_lm+half_inverse                   Ceres with an UpdateCallback
//
// In a method of several parts a setting goes to the rule if the rule has such
// an option, otherwise to the others. The setting batch_size belongs to the
// method itself.
#ifndef INVGRAD_SOLVE_METHOD_H_
#define INVGRAD_SOLVE_METHOD_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/rules/rules.h"
#include "invgrad/solve/ceres_minimizer.h"
#include "invgrad/solve/chain_objective.h"
#include "invgrad/solve/pull_back_method.h"
#include "invgrad/solve/trainer.h"

namespace invgrad {

struct Method {
  std::string label;  // the specification as it was written
  const RuleRow* rule = nullptr;
  Settings rule_settings;
  std::optional<PullBackMethod> pull_back;
  const CeresMethodRow* ceres = nullptr;
  Settings ceres_settings;
  int batch_size = -1;  // -1: not set

  // A new rule object; null if the method has none.
  std::unique_ptr<UpdateRule> MakeRule() const;
};

// "a:x=1,b+c:y=2". False if a name or a setting is unknown or out of range:
// everything is checked here, before anything runs.
bool ParseMethods(const std::string& text,
                  std::vector<Method>* methods,
                  std::string* error);

// Trains by the method. `inverse` is the simulator's own, or null. Ceres'
// minimizers use all samples at once whatever the batch size; an iteration
// counts as a step and as an epoch, and a checkpoint is not written. False for
// bad input, as Train, and if the method cannot take the model: a trust region
// needs a squared-norm loss, and a rule that proposes to one needs neurons of
// at most UpdateCallback::Options::max_block_size weights.
bool TrainByMethod(const Method& method,
                   const TrainOptions& options,
                   const Model& model,
                   std::shared_ptr<const InverseSimulator> inverse,
                   const DataSet& train,
                   const DataSet& test,
                   Eigen::VectorXd* weights,
                   History* history,
                   TrainSummary* summary,
                   std::string* error);

// Minimizes from the objective's current point; `path` receives the points, the
// start first and the final one last. False if the method cannot take the
// objective.
bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      ChainObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_SOLVE_METHOD_H_
