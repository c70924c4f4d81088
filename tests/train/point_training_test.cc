// Training without a network: a search for the simulator's input.

#include <memory>
#include <string>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/minimize.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "tests/support/rosenbrock.h"

namespace invgrad {
namespace point_training_test {

// The loop of a training run and that of Minimize make the same steps.
TEST(PointTraining, IsMinimization) {
  const auto simulator =
      std::make_shared<AutoDiffSimulator<Rosenbrock, 2, 2>>();
  const auto loss = std::make_shared<SquaredNormLoss>(2, 0.5);
  const Eigen::Vector2d target = Eigen::Vector2d::Zero();
  const Eigen::Vector2d start(-1.2, 1.0);
  constexpr int kNumSteps = 7;
  for (const std::string text : {"adam:step_size=0.01", "newton", "geodesic"}) {
    SCOPED_TRACE(text);
    PointObjective objective(simulator, loss, target, start);
    MinimizerOptions minimizer_options;
    minimizer_options.max_num_iterations = kNumSteps;
    minimizer_options.function_tolerance = 0.0;
    minimizer_options.parameter_tolerance = 0.0;
    minimizer_options.gradient_tolerance = 0.0;
    MinimizerSummary summary;
    Minimize(minimizer_options, MakeRule(text).get(), &objective, &summary);

    TrainOptions options;
    options.max_num_steps = kNumSteps;
    options.initial_weights = start;
    const TrainResult result =
        Train(objective.model(), objective.data(), text, options);
    EXPECT_EQ(result.error, "");
    EXPECT_EQ(result.weights, objective.State());
    EXPECT_EQ(result.history.back().train_loss, summary.final_cost);
  }
}

}  // namespace point_training_test
}  // namespace invgrad
