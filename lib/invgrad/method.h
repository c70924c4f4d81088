// Reads a method from a text. A method is what Train (train.h) and
// MinimizeByMethod (minimize.h) run: an update rule, a rule with pull-backs
// through loss and simulator, a minimizer of Ceres, or a minimizer of Ceres
// with proposals of a rule; or a sequence of these, in phases. Train also takes
// the text itself: include this header to check a text before a run, or to run
// many methods.
//
//   half_inverse:truncation=1e-6            rule
//   newton/inverse/adam:y_step_size=0.5     loss, simulator and network
//   sip:step_size=1e-3                      the same, by its name
//   ceres_lm:jacobi_scaling=false           Ceres
//   ceres_lm+half_inverse                   Ceres with an UpdateCallback
//   ceres_lm+newton/inverse/gauss_newton    the same with a pull-back
//   ceres_lm+sip                            the same, by its name
//   adam:epochs=5>half_inverse              two phases
//
//   adam:output_layer=exact                 rule for all layers but the last
//   adam:output_layer=auto                  the same, while it pays
//
// If a phase has several parts, a setting applies to the rule if the rule has
// this option, otherwise to the other parts. The settings batch_size, epochs,
// steps, output_layer and output_layer_period belong to the phase itself. Each
// phase but the last has a share of the run, epochs= or steps=, whichever ends
// first; the last phase has the rest of the budget. A minimizer of Ceres can
// only be the last phase. train.h says how phases follow each other in a run.
// batch_size=auto, the default of rules with RuleRow::races_batch_size, begins
// with the run's batch size, or with fewer samples if these have many outputs,
// and races it against others (train/batch_race.h). Such a run reports the best
// weights that it has evaluated (train/raced_engine.h).
#ifndef INVGRAD_METHOD_H_
#define INVGRAD_METHOD_H_

#include <memory>
#include <string>
#include <vector>

#include "ceres/solver.h"
#include "invgrad/rules.h"

namespace invgrad {

struct CeresMethodRow;
class PullBackMethod;

struct Phase {
  std::string label;  // the specification as it was written
  const RuleRow* rule = nullptr;
  Settings rule_settings;
  std::shared_ptr<PullBackMethod> pull_back;  // null: the phase has none
  const CeresMethodRow* ceres = nullptr;
  Settings ceres_settings;
  int batch_size = -1;  // -1: not set
  bool races_batch_size = false;
  // The share of the run; 0: not set.
  int num_epochs = 0;
  int num_steps = 0;
  // Whether the network's output layer is trained, or solved
  // (reduced_objective.h). kAuto: the phase begins with a solved
  // one; if that does not pay (steady_fall.h), it begins again
  // with a trained one.
  enum class OutputLayer { kTrained, kExact, kAuto };
  OutputLayer output_layer = OutputLayer::kTrained;
  // The steps from one solution to the next; 0: chosen by the cost.
  int output_layer_period = 0;

  bool solves_output_layer() const {
    return output_layer != OutputLayer::kTrained;
  }
  // A new rule object; null if the phase has no rule.
  std::unique_ptr<UpdateRule> MakeRule() const;
  // The phase's own batch size, or the given one; all samples if that is 0, and
  // for a minimizer of Ceres.
  int BatchSize(int batch_size_of_run, int num_samples) const;
  // Ceres' options with the settings of the phase. CHECKs that the phase has a
  // minimizer.
  ceres::Solver::Options CeresOptions() const;
};

struct Method {
  std::string label;          // the specification as it was written
  std::vector<Phase> phases;  // at least one

  const Phase& last_phase() const { return phases.back(); }

  // Whether the steps depend on the progress of the run: by a rule
  // (LinearizationParts::progress) or by output_layer=auto.
  bool ReadsProgress() const;

  // Defaults for settings of Ceres; those that the minimizer does not have are
  // ignored.
  void AddCeresDefaults(const Settings& defaults);
};

// "a:x=1,b+c:y=2". Returns false if a name or a setting is unknown or out of
// range. All checks happen here, before a run.
bool ParseMethods(const std::string& text,
                  std::vector<Method>* methods,
                  std::string* error);
// The same for a single method.
bool ParseMethod(const std::string& text, Method* method, std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_METHOD_H_
