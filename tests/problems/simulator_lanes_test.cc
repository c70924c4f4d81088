// Samples in lanes give the bits of one sample at a time, for all problems.

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/model.h"
#include "problems/problems.h"
#include "tests/support/random_matrix.h"

namespace invgrad {
namespace simulator_lanes_test {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Two packs and an incomplete one.
constexpr int kBatchSize = 11;

struct Batch {
  std::shared_ptr<const Simulator> simulator;
  const Feedback* feedback = nullptr;
  std::shared_ptr<const Model> model;  // owner of the feedback
  MatrixXd x;
  MatrixXd contexts;

  const double* context(int s) const {
    return contexts.rows() == 0 ? nullptr : contexts.col(s).data();
  }
};

Batch MakeBatch(const std::string& specification) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_TRUE(CreateProblem(specification, nullptr, &problem, &error)) << error;
  Batch batch;
  if (problem.learning.has_value()) {
    batch.model = problem.learning->model;
    batch.simulator = batch.model->shared_simulator();
    batch.feedback = batch.model->feedback();
    // Every fifth sample, because neighbours may be alike.
    const DataSet& train = problem.learning->train;
    std::vector<int> indices;
    for (int k = 0; k < kBatchSize; ++k) {
      indices.push_back(5 * k % train.num_samples());
    }
    batch.contexts = train.Select(indices).contexts;
  } else {
    batch.simulator = problem.point->simulator;
    batch.contexts.resize(0, kBatchSize);
  }
  batch.x = RandomMatrix(batch.simulator->num_inputs(), kBatchSize, 3);
  return batch;
}

class SimulatorLanesTest : public testing::TestWithParam<const char*> {};

TEST_P(SimulatorLanesTest, GiveTheBitsOfOneSampleAtATime) {
  const Batch batch = MakeBatch(GetParam());
  const Simulator& simulator = *batch.simulator;
  EXPECT_EQ(simulator.WhyNoLanes(), "");
  const Index num_x = simulator.num_inputs();
  const Index num_y = simulator.num_outputs();
  const MatrixXd covectors = RandomMatrix(num_y, kBatchSize, 4);
  MatrixXd values(num_y, kBatchSize), y(num_y, kBatchSize);
  MatrixXd x_bar(num_x, kBatchSize);
  MatrixXd jacobians(num_x * num_y, kBatchSize);
  for (int s = 0; s < kBatchSize; ++s) {
    const double* const x_s = batch.x.col(s).data();
    const auto covector = [&](const double*, double* w) {
      Eigen::Map<VectorXd>(w, num_y) = covectors.col(s);
      return true;
    };
    ASSERT_TRUE(simulator.Evaluate(
        x_s, batch.context(s), values.col(s).data(), nullptr));
    ASSERT_TRUE(simulator.Evaluate(
        x_s, batch.context(s), y.col(s).data(), jacobians.col(s).data()));
    ASSERT_TRUE(simulator.Adjoint(
        x_s, batch.context(s), covector, y.col(s).data(), x_bar.col(s).data()));
  }
  MatrixXd batch_y(num_y, kBatchSize), batch_x_bar(num_x, kBatchSize);
  MatrixXd batch_jacobians(num_x * num_y, kBatchSize);
  for (const int count : {1, 3, 4, 8, kBatchSize}) {
    ASSERT_EQ(
        simulator.EvaluateBatch(
            count, batch.x.data(), batch.context(0), batch_y.data(), nullptr),
        count);
    EXPECT_EQ(batch_y.leftCols(count), values.leftCols(count));
    ASSERT_EQ(simulator.EvaluateBatch(count,
                                      batch.x.data(),
                                      batch.context(0),
                                      batch_y.data(),
                                      batch_jacobians.data()),
              count);
    EXPECT_EQ(batch_y.leftCols(count), y.leftCols(count));
    EXPECT_EQ(batch_jacobians.leftCols(count), jacobians.leftCols(count));
    MatrixXd at(num_y, kBatchSize);
    ASSERT_EQ(simulator.AdjointBatch(
                  count,
                  batch.x.data(),
                  batch.context(0),
                  [&](int s, const double* y_s, double* w) {
                    at.col(s) = Eigen::Map<const VectorXd>(y_s, num_y);
                    Eigen::Map<VectorXd>(w, num_y) = covectors.col(s);
                    return true;
                  },
                  batch_x_bar.data()),
              count);
    EXPECT_EQ(at.leftCols(count), y.leftCols(count));
    EXPECT_EQ(batch_x_bar.leftCols(count), x_bar.leftCols(count));
  }
}

class LoopLanesTest : public SimulatorLanesTest {};

TEST_P(LoopLanesTest, GiveTheBitsOfOneSampleAtATime) {
  const Batch batch = MakeBatch(GetParam());
  ASSERT_NE(batch.feedback, nullptr);
  const Feedback& feedback = *batch.feedback;
  const Index ns = feedback.state_size();
  const Index nc = feedback.control_size();
  const Index M_size = feedback.num_calls() * ns * (ns + nc);
  const MatrixXd controls = RandomMatrix(nc, kBatchSize, 5);
  MatrixXd next(ns, kBatchSize), M(M_size, kBatchSize);
  for (int s = 0; s < kBatchSize; ++s) {
    ASSERT_TRUE(feedback.Advance(
        batch.context(s), controls.col(s).data(), next.col(s).data()));
    ASSERT_TRUE(feedback.StepJacobians(
        batch.x.col(s).data(), batch.context(s), M.col(s).data()));
  }
  MatrixXd batch_next(ns, kBatchSize), batch_M(M_size, kBatchSize);
  ASSERT_EQ(
      feedback.AdvanceBatch(
          kBatchSize, batch.context(0), controls.data(), batch_next.data()),
      kBatchSize);
  EXPECT_EQ(batch_next, next);
  ASSERT_EQ(feedback.StepJacobiansBatch(
                kBatchSize, batch.x.data(), batch.context(0), batch_M.data()),
            kBatchSize);
  EXPECT_EQ(batch_M, M);
}

INSTANTIATE_TEST_SUITE_P(
    FunctorProblems,
    SimulatorLanesTest,
    testing::Values("squared_component",
                    "sine_point",
                    "sine",
                    "exponential",
                    "multimodal",
                    "poisson_pinn",
                    "quantum_dipole:num_steps=20",
                    "oscillator_chain",
                    "oscillator_chain:coupling=cubic",
                    "oscillator_chain:num_oscillators=5",
                    "oscillator_tracking",
                    "oscillator_tracking:num_oscillators=3:coupling=cubic",
                    "oscillator_correction",
                    "oscillator_correction:num_oscillators=3",
                    "burgers_control:num_cells=8:num_samples=16"));

INSTANTIATE_TEST_SUITE_P(
    FunctorProblems,
    LoopLanesTest,
    testing::Values("oscillator_tracking",
                    "oscillator_tracking:num_oscillators=3:coupling=cubic",
                    "oscillator_correction",
                    "oscillator_correction:num_oscillators=3",
                    "burgers_control:num_cells=8:num_samples=16"));

}  // namespace simulator_lanes_test
}  // namespace invgrad
