// Physical gradients as an update rule: lets scale-invariant physics training
// propose its steps for a model's cost inside ceres::Solve.
//
//   step = rule(linearization of the proxy 1/2 |x - x~|^2),   x~ = x + d_x
//
//   AddModelToProblem(&model, &data, &weights, &problem);
//   PullBackRule sip(&adam, &chain_pull_back, &data, &weights);
//   UpdateCallback callback(&sip, &problem);
//
// The linearization of the problem at hand, which an UpdateCallback makes for
// its linear model, is not read; what the rule sees is the chain's
// (chain_pull_back.h), at the weights as they are when a step is asked for. All
// weights have to be variable: the step is one of all of them, in their order.
//
// Cost:    that of ChainPullBack::Linearize and of the rule.
// Fails:   as these two.
//
// [1] Holl, Koltun, Thuerey. Scale-invariant Learning by Physics Inversion.
//     NeurIPS 2022, algorithm 1.
#ifndef INVGRAD_MINIMIZE_PULL_BACK_RULE_H_
#define INVGRAD_MINIMIZE_PULL_BACK_RULE_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/data_set.h"
#include "invgrad/core/update_rule.h"
#include "invgrad/inverse/chain_pull_back.h"

namespace invgrad {

class PullBackRule final : public UpdateRule {
 public:
  // Nothing is owned; all must outlive this object.
  PullBackRule(UpdateRule* rule,
               ChainPullBack* pull_back,
               const DataSet* data,
               const Eigen::VectorXd* weights)
      : rule_(*rule),
        pull_back_(*pull_back),
        data_(*data),
        weights_(*weights) {}

  LinearizationParts Needs() const override { return {}; }
  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override;
  std::vector<Eigen::VectorXd*> MutableState() override {
    return rule_.MutableState();
  }
  std::string LastStepReport() const override { return rule_.LastStepReport(); }

 private:
  UpdateRule& rule_;
  ChainPullBack& pull_back_;
  const DataSet& data_;
  const Eigen::VectorXd& weights_;
};

}  // namespace invgrad

#endif  // INVGRAD_MINIMIZE_PULL_BACK_RULE_H_
