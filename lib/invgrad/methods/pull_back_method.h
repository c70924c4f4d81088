// A method composed of a pull-back for each part of the chain.
//
//   LOSS/SIMULATOR/RULE        newton/inverse/adam:step_size=1e-3
//
//   LOSS       gradient, newton, saddle_free_newton, target
//              (loss_pull_back.h)
//   SIMULATOR  adjoint, inverse_gradient, half_inverse, inverse, numerical,
//              newton, gradient_descent, lbfgs      (simulator_pull_back.h)
//              joint: no pull-back, RULE linearizes network and simulator
//              data: no pull-back, x~ is the solution x* of the data
//   RULE       any update rule, of the proxy in x (chain_pull_back.h)
//
// `inverse` is the problem's inverse simulator, or the numerical inverse if the
// problem has none; `numerical` is always the numerical inverse.
// `gradient_descent` and `lbfgs` descend the loss if LOSS is `gradient`, and the
// distance to y~ = y + d_y otherwise. Known methods
// have their own names: sip is newton/inverse/adam.
#ifndef INVGRAD_METHODS_PULL_BACK_METHOD_H_
#define INVGRAD_METHODS_PULL_BACK_METHOD_H_

#include <memory>
#include <string>
#include <vector>

#include "invgrad/inverse/chain_pull_back.h"
#include "invgrad/inverse/loss_pull_back.h"
#include "invgrad/inverse/simulator_pull_back.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/option_set.h"
#include "invgrad/rules.h"

namespace invgrad {

// The ways of the pull-backs through loss and simulator.
class PullBackMethod {
 public:
  // Sets the ways, and *rule to the rule's name, of "LOSS/SIMULATOR/RULE".
  // Returns false for an unknown way; *error lists the known ones.
  bool SetWays(const std::string& text, std::string* rule, std::string* error);

  // The options that these ways read.
  void Describe(OptionSet* set);

  bool is_joint() const { return way() == SimulatorWay::kJoint; }
  // Whether the rule lowers the loss itself: there is nothing to pull back.
  bool lowers_loss() const {
    return is_joint() && options_.loss == LossWay::kGradient &&
           options_.y_step_size == 1.0;
  }
  // Whether a setting is set that only applies to batches.
  bool needs_batches() const {
    return proxy_ != "l2" || options_.curvature_weight != 0.0 ||
           updates() != 1 || max_change_ != 0.0;
  }
  // Whether the proxy is a sum of squares.
  bool has_least_squares_proxy() const { return proxy_ == "l2"; }
  int updates() const { return options_.updates_per_evaluation; }
  // Whether it needs data with solutions.
  bool needs_solutions() const {
    return way() == SimulatorWay::kData || options_.data_weight > 0.0;
  }

  // Returns false, with a message, if these ways need derivatives that the
  // simulator does not have.
  bool CanPullBack(const Simulator& simulator, std::string* error) const;

  // For the way joint: the loss that the rule linearizes.
  std::shared_ptr<const Loss> MakeLoss(std::shared_ptr<const Loss> loss) const;

  // For the other ways. `inverse`: the problem's inverse simulator, or null.
  ChainPullBack::Options ChainOptions() const;
  LossPullBack MakeLossPullBack(std::shared_ptr<const Loss> loss) const;
  SimulatorPullBack MakeSimulatorPullBack(
      const std::shared_ptr<const Simulator>& simulator,
      std::shared_ptr<const InverseSimulator> inverse) const;

 private:
  void DescribeInverse(OptionSet* set);
  SimulatorWay way() const { return options_.simulator.way; }

  // Without proxy and max_change.
  ChainPullBack::Options options_;
  std::string proxy_ = "l2";
  double max_change_ = 0.0;  // 0: no limit
};

// A known combination.
struct ChainMethodRow {
  std::string name;     // "sip"
  std::string formula;  // one line
  std::string ways;     // "newton/inverse/adam"
  Settings defaults;    // where they differ from the defaults of its parts

  // The options of the ways and the rule, with these defaults.
  std::vector<OptionSet::Row> options() const;
};

const std::vector<ChainMethodRow>& ChainMethods();

// The row with this name, or null.
const ChainMethodRow* FindChainMethod(const std::string& name);

}  // namespace invgrad

#endif  // INVGRAD_METHODS_PULL_BACK_METHOD_H_
