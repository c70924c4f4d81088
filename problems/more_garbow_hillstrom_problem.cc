#include "problems/more_garbow_hillstrom_problem.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "Eigen/Core"
#include "invgrad/random.h"
#include "problems/more_garbow_hillstrom.h"

namespace invgrad {

void MoreGarbowHillstromProblem::Describe(OptionSet* set) {
  std::vector<std::string> names;
  for (const MoreGarbowHillstromRow& row : MoreGarbowHillstrom()) {
    names.push_back(row.name);
  }
  set->Add("function", &function, names, "which one");
  set->Add("factor", &factor, {1e-3, 1e3}, "of the published start");
  set->Add("spread",
           &spread,
           {0.0, 10.0},
           "relative deviation of the start; each seed has another one");
}

bool MoreGarbowHillstromProblem::Create(LeastSquaresProblem* problem,
                                        std::string* /*error*/) const {
  const auto& rows = MoreGarbowHillstrom();
  const auto row = std::find_if(
      rows.begin(), rows.end(), [this](const MoreGarbowHillstromRow& each) {
        return each.name == function;
      });
  problem->minimum = 0.5 * row->minimum;
  problem->fill = [row, factor = factor, spread = spread](
                      int seed, ceres::Problem* ceres_problem) {
    auto x =
        std::make_shared<Eigen::VectorXd>(Eigen::Map<const Eigen::VectorXd>(
            row->start.data(), static_cast<Eigen::Index>(row->start.size())));
    NumpyRandom random(static_cast<std::uint32_t>(seed));
    const Eigen::VectorXd noise = random.Normal(static_cast<int>(x->size()));
    x->array() *= factor * (1.0 + spread * noise.array());
    ceres_problem->AddResidualBlock(row->make_cost(), nullptr, x->data());
    return x;
  };
  return true;
}

}  // namespace invgrad
