// What compare counts as the calls of a simulator of fields.

#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/chain/counted_simulator.h"
#include "problems/burgers_initial.h"
#include "tests/support/program_runner.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace simulator_calls_test {

using Eigen::VectorXd;

class CallsOfBurgers : public ProgramRunner {
 protected:
  CallsOfBurgers() : ProgramRunner("compare") {}

  // The column `calls` of a run.
  std::vector<int> Calls(const std::string& method,
                         const std::string& file,
                         int num_steps) {
    const Output output = Run({"--problem=burgers_initial",
                               "--rules=" + method,
                               "--steps=" + std::to_string(num_steps),
                               "--plots=false",
                               "--overwrite",
                               "--output=" + Path("run")});
    EXPECT_EQ(output.exit_code, 0) << output.text;
    ExpectSays(output, {"calls"});
    std::istringstream csv(ReadAll(Path("run") + "/path-" + file + ".csv"));
    std::string line;
    std::getline(csv, line);
    EXPECT_EQ(line, "iteration,loss,x_norm,distance,seconds,calls");
    std::vector<int> calls;
    while (std::getline(csv, line)) {
      calls.push_back(std::stoi(line.substr(line.rfind(',') + 1)));
    }
    return calls;
  }
};

// A gradient is a value and a J^T w.
TEST_F(CallsOfBurgers, AGradientIsTwo) {
  EXPECT_EQ(
      Calls("gradient_descent:step_size=5", "gradient_descent-step_size-5", 3),
      (std::vector<int>{2, 4, 6, 8}));
}

// A value and J^T g, then J^T g and k products each with J and J^T.
TEST_F(CallsOfBurgers, AKrylovStepCountsItsProducts) {
  EXPECT_EQ(Calls("krylov:iterations=3:step_size=5",
                  "krylov-iterations-3-step_size-5",
                  2),
            (std::vector<int>{2, 2 + 9, 2 + 18}));
}

// Ceres forms J by 128 products.
TEST_F(CallsOfBurgers, AFormedJacobianIsItsProducts) {
  EXPECT_EQ(Calls("ceres_lm", "ceres_lm", 1).at(0), 1 + 1 + 128);
}

TEST(CountedSimulator, ComputesTheSame) {
  const auto simulator =
      std::make_shared<BurgersSimulator>(16, 4, /*diffusion=*/0.1, 2.0);
  const CountedSimulator counted(simulator);
  const VectorXd x = 0.3 * NormalVector(16, 1);
  ExpectAdjointIdentity(counted, x, nullptr);
  VectorXd y(16), same(16);
  EXPECT_TRUE(simulator->Value(x.data(), nullptr, y.data()));
  const long before = counted.num_calls();
  EXPECT_TRUE(counted.Evaluate(x.data(), nullptr, same.data(), nullptr));
  EXPECT_EQ(y, same);
  EXPECT_EQ(counted.num_calls(), before + 1);
  Eigen::MatrixXd J(16, 16);
  EXPECT_TRUE(counted.Evaluate(x.data(), nullptr, y.data(), J.data()));
  EXPECT_EQ(counted.num_calls(), before + 1 + 1 + 16);
}

}  // namespace simulator_calls_test
}  // namespace invgrad
