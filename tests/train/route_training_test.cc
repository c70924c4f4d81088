// Training with the fast routes gives the losses of training with the SVD.

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "problems/problems.h"

namespace invgrad {
namespace route_training_test {

// The losses of the mini-batches, before each step.
std::vector<double> Losses(const std::string& problem_text,
                           const std::string& truncation,
                           const std::string& route,
                           int batch_size,
                           int num_steps) {
  std::string error;
  PhysicsProblem physics;
  EXPECT_TRUE(CreateProblem(problem_text, nullptr, &physics, &error)) << error;
  const LearningProblem& problem = *physics.learning;
  const std::unique_ptr<UpdateRule> rule =
      MakeRule("half_inverse:truncation=" + truncation + ":route=" + route);
  NumpyRandom random(1);
  Eigen::VectorXd weights =
      problem.model->network().InitialWeights(problem.initialization, &random);
  std::vector<double> losses;
  const int num_batches = problem.train.num_samples() / batch_size;
  for (int i = 0; i < num_steps; ++i) {
    Linearization at;
    Eigen::VectorXd step;
    EXPECT_TRUE(problem.model->Linearize(
        weights,
        problem.train.Range(i % num_batches * batch_size, batch_size),
        rule->Needs(),
        &at,
        &error))
        << error;
    losses.push_back(at.cost);
    EXPECT_TRUE(rule->ComputeStep(at, &step, &error)) << error;
    weights += step;
  }
  return losses;
}

// Each step's relative error is below 1e-6 where nothing is undecided; over the
// steps, which the training contracts rather than amplifies, their differences
// stay of that order.
TEST(RouteTraining, LossesAreThoseOfTheSvd) {
  struct Run {
    const char* problem;
    const char* truncation;
    int batch_size;
  };
  for (const Run& run :
       {Run{"oscillator_chain:num_samples=256", "1e-10", 32},
        Run{"oscillator_chain:num_samples=256:coupling=cubic", "1e-4", 32},
        Run{"quantum_dipole:num_samples=64", "1e-3", 4}}) {
    const std::vector<double> fast =
        Losses(run.problem, run.truncation, "auto", run.batch_size, 24);
    const std::vector<double> oracle =
        Losses(run.problem, run.truncation, "svd", run.batch_size, 24);
    for (size_t i = 0; i < fast.size(); ++i) {
      EXPECT_NEAR(fast[i] / oracle[i], 1.0, 1e-4) << run.problem << " " << i;
    }
    // The comparison would mean little where nothing moves.
    EXPECT_LT(oracle.back(), 0.9 * oracle.front()) << run.problem;
  }
}

}  // namespace route_training_test
}  // namespace invgrad
