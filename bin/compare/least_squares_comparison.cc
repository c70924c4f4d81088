#include "bin/compare/least_squares_comparison.h"

#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "Eigen/Core"
#include "bin/estimate/estimation_comparison.h"
#include "bin/support/run_directory.h"
#include "ceres/evaluation_callback.h"
#include "fmt/ranges.h"
#include "invgrad/ceres/problem_structure.h"
#include "problems/estimation/estimation.h"

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

// The problem of one seed.
class LeastSquaresEstimation final : public Estimation {
 public:
  LeastSquaresEstimation(EstimationTraits traits,
                         const LeastSquaresProblem& definition,
                         int seed)
      : Estimation(std::move(traits)), definition_(definition), seed_(seed) {}

  // The start comes with the problem.
  void SetStart(int /*start*/) override {}
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
  const LeastSquaresProblem& definition_;
  const int seed_;
  EvaluationCounter counter_;
  // Of the problem that was made last.
  std::shared_ptr<void> owner_;
  ceres::Problem* problem_ = nullptr;
};

// The size of the problem of a seed. Returns false, with *error, if it is empty.
bool Describe(const LeastSquaresProblem& definition,
              int seed,
              std::string* description,
              std::string* error) {
  ceres::Problem problem;
  const std::shared_ptr<void> owner = definition.fill(seed, &problem);
  *description = fmt::format("{} parameters in {} blocks, {} residuals",
                             problem.NumParameters(),
                             problem.NumParameterBlocks(),
                             problem.NumResiduals());
  if (definition.minimum.has_value()) {
    *description += fmt::format("; least cost {:.9g}", *definition.minimum);
  }
  *error = "it has no residual blocks";
  return problem.NumResidualBlocks() > 0;
}

bool Check(const CompareOptions& options,
           const LeastSquaresProblem& problem,
           EstimationOptions* estimation,
           std::vector<EstimationInput>* inputs,
           std::string* error) {
  constexpr int kMaxSteps = std::numeric_limits<int>::max();
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  std::vector<int> seeds;
  EstimationTraits traits;
  if (!CheckNoTraining(/*takes_threads=*/true, error) ||
      !CheckFlags({{"steps", {0.0, kMaxSteps}}}, error) ||
      !NameFlag("seeds", ParseSeeds(options.seeds, &seeds, error), error) ||
      !NameFlag("levels",
                ParseNumbers(options.levels, &estimation->levels, error),
                error) ||
      !NameFlag("problem",
                Describe(problem, seeds[0], &traits.description, error),
                error)) {
    return false;
  }
  estimation->threads = options.training.threads;
  traits.linear_solver = problem.linear_solver;
  traits.extension = ".txt";
  traits.budget.max_num_iterations = problem.max_num_iterations;
  traits.budget.gradient_tolerance = 1e-12;
  traits.budget.function_tolerance = kEpsilon;
  traits.budget.parameter_tolerance = kEpsilon;
  options.training.SetBudget(&traits.budget);
  const std::string name = options.problem.substr(0, options.problem.find(':'));
  for (const int seed : seeds) {
    inputs->push_back(
        {fmt::format("{}-seed{}", name, seed),
         std::make_unique<LeastSquaresEstimation>(traits, problem, seed)});
  }
  return true;
}

}  // namespace

bool CompareLeastSquares(const CompareOptions& options,
                         const LeastSquaresProblem& problem,
                         const std::vector<Method>& methods,
                         RunCounts* counts,
                         std::string* error) {
  EstimationOptions estimation;
  std::vector<EstimationInput> inputs;
  return Check(options, problem, &estimation, &inputs, error) &&
         CompareEstimations(estimation, inputs, methods, counts, error);
}

}  // namespace invgrad
