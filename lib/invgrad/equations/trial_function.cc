#include "invgrad/trial_function.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "fmt/ranges.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

bool EvaluateJets(const DerivativeSet& set,
                  const std::string& name,
                  int num_functions,
                  const InputFunction& function,
                  const MatrixXd& points,
                  MatrixXd* jets,
                  std::string* error) {
  *jets = JetsOf(set, num_functions, function, points);
  if (jets->allFinite()) return true;
  Index s = 0;
  while (jets->col(s).allFinite()) ++s;
  Index row = 0;
  while (std::isfinite((*jets)(row, s))) ++row;
  const std::string& word = set.word(static_cast<int>(row / num_functions));
  *error =
      fmt::format("{} {}: {} is not finite at point {}, ({})",
                  name,
                  row % num_functions,
                  word.empty() ? "its value" : "its derivative " + word,
                  s,
                  fmt::join(points.col(s).begin(), points.col(s).end(), ", "));
  return false;
}

}  // namespace

int TrialFunction::NumInputs() const {
  return features.function == nullptr ? derivatives->num_variables()
                                      : features.size;
}

int TrialFunction::ConditionSize() const {
  return has_conditions() ? 2 * num_functions * derivatives->num_channels() : 0;
}

bool TrialFunction::Inputs(const MatrixXd& points,
                           MatrixXd* inputs,
                           std::string* error) const {
  if (features.function != nullptr) {
    return EvaluateJets(*derivatives,
                        "feature",
                        features.size,
                        features.function,
                        points,
                        inputs,
                        error);
  }
  *inputs = derivatives->InputJets(points);
  return true;
}

bool TrialFunction::Conditions(const MatrixXd& points,
                               MatrixXd* conditions,
                               std::string* error) const {
  conditions->resize(0, points.cols());
  if (!has_conditions()) return true;
  CHECK(distance != nullptr) << "Boundary values have a distance function.";
  const auto evaluate =
      [&](const char* name, const InputFunction& function, MatrixXd* jets) {
        return EvaluateJets(
            *derivatives, name, num_functions, function, points, jets, error);
      };
  MatrixXd g = MatrixXd::Zero(ConditionSize() / 2, points.cols());
  MatrixXd d;
  if ((boundary_values != nullptr &&
       !evaluate("boundary value", boundary_values, &g)) ||
      !evaluate("distance", distance, &d)) {
    return false;
  }
  conditions->resize(ConditionSize(), points.cols());
  *conditions << g, d;
  return true;
}

MatrixXd TrialFunction::Values(const MatrixXd& network_jets,
                               const MatrixXd& contexts) const {
  if (!has_conditions()) return network_jets;
  const Index size = network_jets.rows();
  const Index num_columns = network_jets.cols() * derivatives->num_channels();
  MatrixXd u = network_jets.reshaped(num_functions, num_columns);
  const MatrixXd d = contexts.middleRows(size, size);
  derivatives->Multiply(d.reshaped(num_functions, num_columns), u);
  return u.reshaped(size, network_jets.cols()) + contexts.topRows(size);
}

void EvaluateTrialFunction(const TrialFunction& trial,
                           const DenseNetwork& network,
                           const Eigen::VectorXd& weights,
                           const InputJet* point,
                           InputJet* u) {
  const auto has_set = [](const InputJet& a) { return a.set() != nullptr; };
  const InputJet* const end = point + trial.derivatives->num_variables();
  const InputJet* const first = std::find_if(point, end, has_set);
  // Not owned: the point has it.
  const std::shared_ptr<const DerivativeSet> of_point =
      first == end ? trial.derivatives
                   : std::shared_ptr<const DerivativeSet>(
                         std::shared_ptr<void>(), first->set());
  const DerivativeSet& set = *of_point;
  const Index T = set.num_channels();
  const Index num_functions = trial.num_functions;
  std::vector<InputJet> features(point, end);
  if (trial.features.function != nullptr) {
    features.resize(trial.features.size);
    trial.features.function(point, features.data());
  }
  // A sample with a column a channel.
  MatrixXd inputs = MatrixXd::Zero(static_cast<Index>(features.size()), T);
  for (std::size_t i = 0; i < features.size(); ++i) {
    const Eigen::RowVectorXd& jet = features[i].jet();
    inputs.row(static_cast<Index>(i)).head(jet.size()) = jet;
  }
  DenseNetwork::Activations pass;
  network.ForwardJets(weights, of_point, inputs, false, &pass);
  std::vector<InputJet> g(num_functions);
  std::vector<InputJet> d(num_functions);
  if (trial.boundary_values != nullptr) trial.boundary_values(point, g.data());
  if (trial.has_conditions()) trial.distance(point, d.data());
  for (Index f = 0; f < num_functions; ++f) {
    u[f] = InputJet(&set, pass.outputs.row(f));
    if (trial.has_conditions()) u[f] = g[f] + d[f] * u[f];
  }
}

}  // namespace invgrad
