// The picture of three panels a method: its numbers, computed again from the
// network at the end.

#include <cmath>
#include <map>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/dense_network.h"
#include "tests/programs/compare_program.h"
#include "tests/programs/csv_lines.h"

namespace invgrad {
namespace methods_picture_test {

constexpr int kNumSamples = 32;
constexpr double kTolerance = 1e-8;  // ten digits

double Number(const CsvLines& lines, const std::string& column) {
  return std::stod(lines.back().at(column));
}

TEST_F(CompareProgram, DrawsLossActivationsAndPathOfEveryMethod) {
  const Output output = Run({"--problem=toy_network:num_samples=32:lambda=0.5",
                             "--rules=half_inverse,adam:step_size=1e-2",
                             "--steps=20",
                             "--track_sample=3",
                             "--output=" + Path("run")});
  ASSERT_EQ(output.exit_code, 0) << output.text;
  std::map<std::pair<int, int>, CsvLines> panels;  // by panel and line
  const std::regex blank_lines("\n+");
  const std::string csv = std::regex_replace(
      ReadAll(Path("run") + "/methods.csv"), blank_lines, "\n");
  for (const auto& line : ReadCsv(csv)) {
    panels[{std::stoi(line.at("panel")), std::stoi(line.at("line"))}].push_back(
        line);
  }
  const std::vector<std::string> methods = {"half_inverse",
                                            "adam-step_size-1e-2"};
  const Eigen::RowVectorXd a =
      Eigen::RowVectorXd::LinSpaced(kNumSamples, -1.0, 1.0);
  int line = 0;  // numbered through the panels
  for (int k = 0; k < 2; ++k) {
    const std::string folder = Path("run") + "/" + methods[k] + "-seed1";
    SCOPED_TRACE(folder);
    const CsvLines history = ReadCsv(ReadAll(folder + "/history.csv"));
    const CsvLines& loss = panels.at({3 * k + 1, ++line});
    EXPECT_NEAR(Number(loss, "y"), Number(history, "train_loss"), kTolerance);
    EXPECT_EQ(Number(loss, "x"), 20.0);

    Eigen::VectorXd weights;
    std::string error;
    const auto network = ReadNetwork(folder + "/network.txt", &weights, &error);
    ASSERT_TRUE(network.has_value()) << error;
    DenseNetwork::Activations activations;
    network->Forward(weights, a, false, &activations);
    Eigen::ArrayXXd hidden = activations.inputs[1].topRows(7);
    for (int i = 0; i < 7; ++i) {
      if (hidden.row(i).mean() < 0.0) hidden.row(i) *= -1.0;
    }
    const double mean = hidden.mean();
    const double deviation = std::sqrt((hidden - mean).square().mean());
    const CsvLines& activation = panels.at({3 * k + 2, ++line});
    EXPECT_GT(deviation, 0.1);
    EXPECT_NEAR(Number(activation, "y"), mean, kTolerance);
    EXPECT_NEAR(Number(activation, "low"), mean - deviation, kTolerance);
    EXPECT_NEAR(Number(activation, "high"), mean + deviation, kTolerance);

    const CsvLines& path = panels.at({3 * k + 3, ++line});
    const CsvLines& target = panels.at({3 * k + 3, ++line});
    EXPECT_EQ(path.size(), activation.size());
    EXPECT_NEAR(Number(path, "x"), activations.outputs(0, 3), kTolerance);
    EXPECT_NEAR(Number(path, "y"), 0.5 * activations.outputs(1, 3), kTolerance);
    EXPECT_NEAR(Number(target, "x"), std::sin(6.0 * a[3]), kTolerance);
    EXPECT_NEAR(Number(target, "y"), std::cos(9.0 * a[3]), kTolerance);
  }
}

}  // namespace methods_picture_test
}  // namespace invgrad
