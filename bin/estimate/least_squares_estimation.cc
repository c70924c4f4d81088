#include "bin/estimate/least_squares_estimation.h"

#include <limits>
#include <optional>
#include <utility>

#include "Eigen/Core"
#include "bin/support/run_directory.h"
#include "ceres/evaluation_callback.h"
#include "fmt/ranges.h"
#include "invgrad/ceres/problem_structure.h"

namespace invgrad {
namespace {

class EvaluationCounter final : public ceres::EvaluationCallback {
 public:
  void PrepareForEvaluation(bool /*evaluate_jacobians*/,
                            bool /*new_evaluation_point*/) override {
    ++count_;
  }
  long count() const { return count_; }

 private:
  long count_ = 0;
};

class LeastSquaresEstimation final : public Estimation {
 public:
  LeastSquaresEstimation(EstimationTraits traits, LeastSquaresProblem problem)
      : Estimation(std::move(traits)), definition_(std::move(problem)) {}

  void SetStart(int start) override { seed_ = traits().seeds[start]; }
  // The start comes with the problem.
  void Perturb(double /*sigma*/, NumpyRandom* /*random*/) override {}

  std::unique_ptr<ceres::Problem> MakeProblem(
      const MakeLossFunction& /*make_loss*/) override {
    counter_ = EvaluationCounter();
    ceres::Problem::Options options;
    options.evaluation_callback = &counter_;
    auto problem = std::make_unique<ceres::Problem>(options);
    owner_ = definition_.fill(seed_, problem.get());
    problem_ = problem.get();
    return problem;
  }

  std::optional<bool> IsSolved(double initial_cost,
                               double final_cost) const override {
    constexpr double kShare = 1e-6;
    if (!definition_.minimum.has_value()) return std::nullopt;
    return final_cost - *definition_.minimum <=
           kShare * (initial_cost - *definition_.minimum);
  }

  ceres::EvaluationCallback* evaluation_callback() override {
    return &counter_;
  }
  long num_evaluations() const override { return counter_.count(); }

  double minimum() const override { return definition_.minimum.value_or(0.0); }

  std::string BlockName(const double* values) const override {
    const ProblemStructure structure = ReadStructure(*problem_, {});
    int i = 0;
    for (const auto& block : structure.parameter_blocks) {
      if (block.values == values) return fmt::format("block {}", i);
      ++i;
    }
    return "constant block";
  }

  // The blocks that are not constant, in the order of their first use.
  bool Write(const std::string& path, std::string* error) const override {
    const ProblemStructure structure = ReadStructure(*problem_, {});
    std::string text;
    for (const auto& block : structure.parameter_blocks) {
      const Eigen::Map<const Eigen::VectorXd> values(block.values,
                                                     block.ambient_size);
      if (!values.allFinite()) {
        *error = path + ": a parameter is not finite";
        return false;
      }
      text += fmt::format("{:.17g}\n",
                          fmt::join(values.begin(), values.end(), " "));
    }
    return WriteRunFile(path, text, error);
  }

  void Draw(const std::string& /*label*/,
            std::vector<Plot>* /*panels*/) const override {}

 private:
  const LeastSquaresProblem definition_;
  int seed_ = 0;
  EvaluationCounter counter_;
  // Of the problem that was made last.
  std::shared_ptr<void> owner_;
  ceres::Problem* problem_ = nullptr;
};

}  // namespace

MinimizerOptions LeastSquaresBudget(const LeastSquaresProblem& problem) {
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  MinimizerOptions budget;
  budget.max_num_iterations = problem.max_num_iterations;
  budget.gradient_tolerance = 1e-12;
  budget.function_tolerance = kEpsilon;
  budget.parameter_tolerance = kEpsilon;
  return budget;
}

std::unique_ptr<Estimation> MakeLeastSquaresEstimation(
    const LeastSquaresProblem& problem,
    const MinimizerOptions& budget,
    const std::vector<int>& seeds,
    std::string* error) {
  ceres::Problem sizes;
  const std::shared_ptr<void> owner = problem.fill(seeds[0], &sizes);
  if (sizes.NumResidualBlocks() == 0) {
    *error = "it has no residual blocks";
    return nullptr;
  }
  EstimationTraits traits;
  traits.description = fmt::format("{} parameters in {} blocks, {} residuals",
                                   sizes.NumParameters(),
                                   sizes.NumParameterBlocks(),
                                   sizes.NumResiduals());
  if (problem.minimum.has_value()) {
    traits.description += fmt::format("; least cost {:.9g}", *problem.minimum);
  }
  traits.linear_solver = problem.linear_solver;
  traits.extension = ".txt";
  traits.num_starts = static_cast<int>(seeds.size());
  traits.seeds = seeds;
  traits.budget = budget;
  return std::make_unique<LeastSquaresEstimation>(traits, problem);
}

}  // namespace invgrad
