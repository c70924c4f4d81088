// The program estimate, run as a user runs it, and its small inputs, for tests.
#ifndef INVGRAD_TESTS_PROGRAMS_ESTIMATE_PROGRAM_H_
#define INVGRAD_TESTS_PROGRAMS_ESTIMATE_PROGRAM_H_

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "problems/estimation/bal_file.h"
#include "problems/estimation/nist_file.h"
#include "tests/support/compress_bzip2.h"
#include "tests/support/program_runner.h"

namespace invgrad {

class EstimateProgram : public ProgramRunner {
 protected:
  EstimateProgram() : ProgramRunner("estimate") {}

  std::string WriteText(const std::string& name,
                        const std::string& text) const {
    std::string error;
    EXPECT_TRUE(WriteFile(Path(name), text, &error)) << error;
    return Path(name);
  }

  // y = 2 (1 - exp(-0.5 x)), exactly.
  std::string WriteMisra1a(const std::string& name = "Misra1a") const {
    NistData data;
    data.name = name;
    data.predictors = Eigen::VectorXd::LinSpaced(8, 0.5, 4.0);
    data.responses = 2.0 * (1.0 - (-0.5 * data.predictors.array()).exp());
    data.starts.resize(2, 2);
    data.starts << 1.5, 2.5, 0.6, 0.4;
    data.certified = Eigen::Vector2d(2.0, 0.5);
    data.standard_deviations = Eigen::Vector2d(1e-9, 1e-9);
    std::string error;
    EXPECT_TRUE(WriteNistFile(Path(name + ".dat"), data, &error)) << error;
    return Path(name + ".dat");
  }

  // Two cameras and three points, a few pixels off.
  std::string WriteBal(const std::string& name) const {
    BalData data;
    data.cameras.setZero(9, 2);
    data.cameras.row(6).setConstant(500.0);
    data.cameras(3, 1) = -1.0;
    data.points.resize(3, 5);
    data.points << -1.0, 1.0, 0.5, 0.0, 1.5, 0.2, -0.4, 1.0, -1.0, 0.1, -8.0,
        -9.0, -10.0, -8.5, -9.5;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 5; ++j) {
        const Eigen::Vector3d P =
            data.points.col(j) + data.cameras.block<3, 1>(3, i);
        data.observations.push_back({i,
                                     j,
                                     -500.0 * P[0] / P[2] + 2.0 * (j % 3 - 1),
                                     -500.0 * P[1] / P[2] - 3.0 * (i - 0.5)});
      }
    }
    const bool is_compressed =
        std::filesystem::path(name).extension() == ".bz2";
    return WriteText(
        name, is_compressed ? CompressBzip2(BalText(data)) : BalText(data));
  }

  // A square whose last edge does not close.
  std::string WriteG2o2d() const {
    return WriteText("square.g2o",
                     "VERTEX_SE2 0 0 0 0\n"
                     "VERTEX_SE2 1 1.1 0 1.5\n"
                     "VERTEX_SE2 2 1 1.2 3.1\n"
                     "VERTEX_SE2 3 0 1 -1.6\n"
                     "EDGE_SE2 0 1 1 0 1.5708 10 0 0 10 0 100\n"
                     "EDGE_SE2 1 2 1 0 1.5708 10 0 0 10 0 100\n"
                     "EDGE_SE2 2 3 1 0 1.5708 10 0 0 10 0 100\n"
                     "EDGE_SE2 3 0 1.1 0 1.5708 10 0 0 10 0 100\n");
  }

  std::string WriteG2o3d() const {
    const std::string information =
        " 9 0 0 0 0 0 9 0 0 0 0 9 0 0 0 40 1 0 40 0 "
        "40\n";
    return WriteText("triangle.g2o",
                     "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n"
                     "VERTEX_SE3:QUAT 1 1 0.1 0 0 0 0.1 1\n"
                     "VERTEX_SE3:QUAT 2 1 1 0.2 0.1 0 0 1\n"
                     "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1" +
                         information + "EDGE_SE3:QUAT 1 2 0 1 0 0 0 0 1" +
                         information + "EDGE_SE3:QUAT 2 0 -1 -1.1 0 0 0 0 1" +
                         information);
  }

  // The rows of a table in results.csv, split at commas.
  std::vector<std::vector<std::string>> Results(
      const std::string& directory) const {
    std::istringstream lines(ReadAll(Path(directory) + "/results.csv"));
    std::vector<std::vector<std::string>> rows;
    std::string line;
    std::getline(lines, line);  // titles
    while (std::getline(lines, line)) {
      rows.emplace_back();
      std::istringstream fields(line);
      for (std::string field; std::getline(fields, field, ',');) {
        rows.back().push_back(field);
      }
    }
    return rows;
  }

  // A run without pictures.
  Output RunQuietly(const std::string& input,
                    const std::string& output,
                    std::vector<std::string> arguments = {},
                    int exit_code = 0) const {
    arguments.insert(arguments.end(),
                     {"--input=" + input,
                      "--output=" + Path(output),
                      "--plots=false",
                      "--progress=false"});
    Output result = Run(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.text;
    return result;
  }
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_PROGRAMS_ESTIMATE_PROGRAM_H_
