// The program accuracy, run as a user runs it.

#include <sstream>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/program_runner.h"

namespace invgrad {
namespace accuracy_program_test {

class AccuracyProgram : public ProgramRunner {
 protected:
  AccuracyProgram() : ProgramRunner("accuracy") {}

  // The cells of the rows below the titles, of all tables.
  static std::vector<std::vector<std::string>> Rows(const Output& output) {
    std::vector<std::vector<std::string>> rows;
    std::istringstream lines(output.text);
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("| 1e-", 0) != 0) continue;
      rows.emplace_back();
      std::istringstream cells(line.substr(1));
      for (std::string cell; std::getline(cells, cell, '|');) {
        rows.back().push_back(cell);
      }
    }
    return rows;
  }
};

// One small batch, before and after training. The bounds are those of
// epsilon / tau and epsilon / tau^2, and of single precision.
TEST_F(AccuracyProgram, ErrorsAreThoseOfTheRoutes) {
  const Output output = Run({"--problems=oscillator_chain:num_samples=64",
                             "--batch_size=16",
                             "--train_steps=20",
                             "--truncations=1e-2,1e-3"});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output,
             {"initial weights: J 64 x 1444",
              "after 20 steps of Adam: J 64 x 1444",
              "| tau | rank | route |"});
  const auto rows = Rows(output);
  ASSERT_EQ(rows.size(), 4u) << output.text;
  for (const auto& row : rows) {
    ASSERT_EQ(row.size(), 7u);
    const double tau = std::stod(row[0]);
    constexpr double kEpsilon = 2.3e-16;
    constexpr double kSingleEpsilon = 1.2e-7;
    EXPECT_EQ(row[2].substr(1, 4), "gram");
    EXPECT_LE(std::stod(row[4]), 10.0 * kEpsilon / (tau * tau));  // gram
    EXPECT_LE(std::stod(row[5]), 5.0 * kEpsilon / tau);           // svd
    EXPECT_GE(std::stod(row[6]), kSingleEpsilon);                 // sgesdd
    EXPECT_LE(std::stod(row[6]), 5.0 * kSingleEpsilon / tau);
  }
}

// With the route svd as the reference, it has nothing to say about itself.
TEST_F(AccuracyProgram, LargeBatchesAreComparedWithTheSvd) {
  const Output output = Run({"--problems=oscillator_chain:num_samples=64",
                             "--batch_size=16",
                             "--train_steps=0",
                             "--long_double_rows=10",
                             "--truncations=1e-2"});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  const auto rows = Rows(output);
  ASSERT_EQ(rows.size(), 1u) << output.text;
  EXPECT_EQ(rows[0][5], " reference ");
}

TEST_F(AccuracyProgram, TakesAllSamplesWhereAProblemHasNoBatchSize) {
  const Output output = Run({"--problems=toy_network:num_samples=16",
                             "--train_steps=0",
                             "--truncations=1e-2"});
  EXPECT_EQ(output.exit_code, 0) << output.text;
  ExpectSays(output, {"J 32 x 30"});
}

TEST_F(AccuracyProgram, RefusesBadInput) {
  Output output = Run({"--problems=oscilator_chain"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"--problems", "oscilator_chain"});
  output = Run({"--problems=linear_scale"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"linear_scale", "learning problems"});
  output = Run({"--truncations=2"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"--truncations"});
  output = Run({"--truncations=tiny"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"--truncations", "tiny"});
  output = Run({"--train_steps=-1"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"--train_steps"});
  output =
      Run({"--problems=oscillator_chain:num_samples=64", "--batch_size=65"});
  EXPECT_EQ(output.exit_code, 1);
  ExpectSays(output, {"oscillator_chain", "65"});
  output = Run({"stray"});
  EXPECT_EQ(output.exit_code, 1);
}

}  // namespace accuracy_program_test
}  // namespace invgrad
