// A method is what a comparison compares: an update rule, a way back for each
// part of the chain, a minimizer of Ceres, or a minimizer of Ceres to which a
// rule proposes its steps.
//
//   half_inverse:truncation=1e-6            rule
//   newton/inverse/adam:y_step_size=0.5     loss, simulator and network
//   sip:step_size=1e-3                      the same, by its name
//   ceres_lm:initial_radius=1e6             Ceres
//   ceres_lm+half_inverse                   Ceres with an UpdateCallback
//   adam:epochs=5>half_inverse              one after the other, in phases
//
// In a method of several parts a setting goes to the rule if the rule has such
// an option, otherwise to the others. The settings batch_size, epochs and steps
// belong to the method itself.
//
// Phases, with ">" between them, are one run: pre-training by Adam, say, and
// then half-inverse. Each but the last has a share of it, epochs= or steps=,
// whichever ends first; the last one takes what the run's budget leaves. The
// weights carry over. A phase's rule is new, its schedule runs from the phase's
// start to its end, it begins with the first sample or with the first order of
// the shuffling's seed, and patience begins anew: phase by phase the steps are,
// bit for bit, those of a run of its own from the weights that the phase before
// left. Steps, epochs and seconds go on counting; the samples that were pulled
// back by each source (history.h) count from the phase's start. What ends a run
// otherwise than by its budget (target loss, patience, a callback, divergence)
// ends it in any phase; its message names the phase and counts from its start.
// A minimizer of Ceres can only be the last phase.
#ifndef INVGRAD_METHODS_METHOD_H_
#define INVGRAD_METHODS_METHOD_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/minimize/ceres_minimizer.h"
#include "invgrad/minimize/chain_objective.h"
#include "invgrad/rules/rules.h"
#include "invgrad/train/trainer.h"

namespace invgrad {

struct Method {
  std::string label;  // the specification as it was written
  const RuleRow* rule = nullptr;
  Settings rule_settings;
  std::optional<PullBackMethod> pull_back;
  const CeresMethodRow* ceres = nullptr;
  Settings ceres_settings;
  int batch_size = -1;  // -1: not set

  // Of a method in phases the above is the last one, and these come before it.
  std::vector<Method> earlier;
  // Of an earlier phase: its share of the run; 0: not set.
  int num_epochs = 0;
  int num_steps = 0;

  // Settings for Ceres that the specification leaves open; those that its
  // minimizer does not have are left out.
  void AddCeresDefaults(const Settings& defaults);

  // A new rule object; null if the method has none.
  std::unique_ptr<UpdateRule> MakeRule() const;
  // The earlier phases and the method itself.
  std::vector<const Method*> Phases() const;
};

// "a:x=1,b+c:y=2". False if a name or a setting is unknown or out of range:
// everything is checked here, before anything runs.
bool ParseMethods(const std::string& text,
                  std::vector<Method>* methods,
                  std::string* error);

// Trains by the method; a batch size of its own goes before that of `options`.
// `inverse` is the simulator's own, or null. Ceres' minimizers use all samples
// at once whatever the batch size; an iteration counts as a step and as an
// epoch, and a checkpoint is not written. An epoch budget ends a method in
// phases at the first step that reaches it. False for bad input, as Train, and
// if the method cannot take the model: a trust region needs a squared-norm
// loss, and a rule that proposes to one needs neurons of at most
// UpdateCallback::Options::max_block_size weights.
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

// The epochs that the first `num_steps` steps of a run by the method are, if
// steps have `batch_size` samples (0: all) where the method does not say.
double NumEpochs(const Method& method,
                 int num_samples,
                 int batch_size,
                 long num_steps);

// The files in which a run with TrainOptions::checkpoint_path keeps where it
// can go on: one a phase, the last one's the path itself.
std::vector<std::string> CheckpointFiles(const Method& method,
                                         const std::string& checkpoint_path);

// Minimizes from the objective's current point; `path` receives the points, the
// start first and the final one last. False if the method cannot take the
// objective, or has phases.
bool MinimizeByMethod(const Method& method,
                      const MinimizerOptions& options,
                      std::shared_ptr<const InverseSimulator> inverse,
                      ChainObjective* objective,
                      std::vector<Eigen::VectorXd>* path,
                      MinimizerSummary* summary,
                      std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_METHODS_METHOD_H_
