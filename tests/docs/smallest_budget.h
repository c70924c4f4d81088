// A command with the smallest budget: one step, ten samples, one seed, one cell
// of a grid, small files in place of published ones. Names and flags stay, so
// that the program checks them.
#ifndef INVGRAD_TESTS_DOCS_SMALLEST_BUDGET_H_
#define INVGRAD_TESTS_DOCS_SMALLEST_BUDGET_H_

#include <algorithm>
#include <cmath>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "problems/estimation/bal_file.h"
#include "problems/estimation/nist_file.h"
#include "problems/problems.h"
#include "tests/docs/recorder.h"

namespace invgrad {

constexpr int kNumSamples = 10;

// "oscillator_chain" -> "oscillator_chain:num_samples=10". A point problem
// stays.
inline std::string SmallProblem(std::string problem) {
  problem = std::regex_replace(
      problem,
      std::regex(":num_(samples|interior|boundary|t|x|y|points|face)=[0-9]+"),
      "");
  problem = std::regex_replace(
      problem, std::regex(":resolution=[0-9]{2,}"), ":resolution=16");
  PhysicsProblem created;
  std::string error;
  for (const std::string& small :
       {":num_samples=" + std::to_string(kNumSamples),
        std::string(":num_interior=16:num_boundary=8"),
        std::string(":num_t=2:num_x=8"),
        std::string(":num_x=4:num_y=4"),
        std::string(":num_points=16:num_face=2")}) {
    if (CreateProblem(problem + small, nullptr, &created, &error)) {
      return problem + small;
    }
  }
  return problem;
}

// Batches of 2^k samples become batches of k: small, and as different as
// before.
inline std::string WithSmallBatches(const std::string& text) {
  const std::regex batch_size("batch_size=([1-9][0-9]*)");
  std::string small;
  std::string rest = text;
  for (std::smatch match; std::regex_search(rest, match, batch_size);) {
    const int k = static_cast<int>(std::log2(std::stod(match[1])));
    small += match.prefix().str() +
             "batch_size=" + std::to_string(std::clamp(k, 1, kNumSamples));
    rest = match.suffix();
  }
  return small + rest;
}

// The first value of each axis but `rule`, of which all rules stay, each with
// the first of its alternatives.
inline std::string OneCell(const std::string& grid) {
  std::string cell;
  std::istringstream axes(grid);
  for (std::string axis; std::getline(axes, axis, ';');) {
    const bool is_rule = axis.find("rule=") == axis.find_first_not_of(" \t\n");
    cell += (cell.empty() ? "" : ";") +
            (is_rule ? std::regex_replace(axis, std::regex("\\|[^:,>]*"), "")
                     : axis.substr(0, axis.find(',')));
  }
  return cell;
}

// Small files in place of published ones.
class SmallFiles {
 public:
  explicit SmallFiles(const std::string& folder) : folder_(folder) {
    std::string error;
    NistData nist;  // y = 2 (1 - exp(-0.5 x))
    nist.name = "Misra1a";
    nist.predictors = Eigen::VectorXd::LinSpaced(8, 0.5, 4.0);
    nist.responses = 2.0 * (1.0 - (-0.5 * nist.predictors.array()).exp());
    nist.starts.resize(2, 2);
    nist.starts << 1.5, 2.5, 0.6, 0.4;
    nist.certified = Eigen::Vector2d(2.0, 0.5);
    nist.standard_deviations = Eigen::Vector2d(1e-9, 1e-9);
    EXPECT_TRUE(WriteNistFile(Path("dat"), nist, &error)) << error;
    BalData bal;  // two cameras and five points, a pixel off
    bal.cameras.setZero(9, 2);
    bal.cameras.row(6).setConstant(500.0);
    bal.cameras(3, 1) = -1.0;
    bal.points.resize(3, 5);
    bal.points << -1.0, 1.0, 0.5, 0.0, 1.5, 0.2, -0.4, 1.0, -1.0, 0.1, -8.0,
        -9.0, -10.0, -8.5, -9.5;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 5; ++j) {
        const Eigen::Vector3d P =
            bal.points.col(j) + bal.cameras.block<3, 1>(3, i);
        bal.observations.push_back(
            {i, j, -500.0 * P[0] / P[2] + (j % 3 - 1), -500.0 * P[1] / P[2]});
      }
    }
    EXPECT_TRUE(WriteBalFile(Path("txt"), bal, &error)) << error;
    Write(Path("g2o"),
          "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1.1 0 1.5\n"
          "VERTEX_SE2 2 1 1.2 3.1\n"
          "EDGE_SE2 0 1 1 0 1.5708 10 0 0 10 0 100\n"
          "EDGE_SE2 1 2 1 0 1.5708 10 0 0 10 0 100\n"
          "EDGE_SE2 2 0 1 1 3.1416 10 0 0 10 0 100\n");
    Write(Path("csv"),
          "time,signal,sigma\n0,3.2,0.1\n1,1.7,0.1\n2,1,0.1\n3,0.6,0.1\n");
  }

  // The small files for "M3500.g2o,nist/BoxBOD.dat", each kind once.
  std::string For(const std::string& input) const {
    std::set<std::string> paths;
    std::istringstream files(input);
    for (std::string file; std::getline(files, file, ',');) {
      const bool is_graph = file.find(".g2o") != std::string::npos;
      const bool is_bal = file.find(".txt") != std::string::npos;
      const bool is_table = file.find(".csv") != std::string::npos;
      paths.insert(Path(is_graph   ? "g2o"
                        : is_bal   ? "txt"
                        : is_table ? "csv"
                                   : "dat"));
    }
    std::string joined;
    for (const std::string& path : paths) {
      joined += (joined.empty() ? "" : ",") + path;
    }
    return joined;
  }

 private:
  std::string Path(const std::string& ending) const {
    return folder_ + "/small_" + ending + "." + ending;
  }

  const std::string folder_;
};

// The program compare, for our problems or for that of the tutorial.
inline bool IsCompare(const std::string& program) {
  return program == "compare" || program == "compare_methods";
}

// The flags that override a command's budget; the last one of a name counts.
inline Words SmallBudget(const std::string& program) {
  const Words quiet = {"--plots=false", "--progress=false"};
  if (IsCompare(program) || program == "sweep") {
    return {"--steps=1", "--epochs=0", "--seconds=0", quiet[0], quiet[1]};
  }
  if (program == "estimate") return {"--max_iterations=1", quiet[0], quiet[1]};
  if (program == "time_windows") {
    return {"--steps=1", "--seconds=0", quiet[0]};
  }
  if (program == "trajectories") return {"--steps=1", "--grid=3"};
  if (program == "registration") return {"--scans=1", quiet[0]};
  if (program == "proposals") return {"--radii=1e4"};
  if (program == "bench") return {"--benchmark_list_tests=true"};
  if (program == "propose_steps") return {"--starts=2"};
  if (program == "solve_equation" || program == "find_coefficient") {
    return {"--steps=2"};
  }
  if (program == "use_inverse_simulator" ||
      program == "train_robot_controller" ||
      program == "write_field_simulator") {
    return {"--seconds=0.01"};
  }
  if (program == "train_torch_network") return {"0.1"};
  // The others have no flags, and take seconds.
  return {};
}

// Programs that take care of the folder of an earlier run.
inline bool HasOutput(const std::string& program) {
  return IsCompare(program) || program == "estimate" || program == "sweep" ||
         program == "trajectories" || program == "time_windows" ||
         program == "registration";
}

// The command with the smallest budget.
inline Words Small(const Words& command, const SmallFiles& files) {
  const std::string& program = command[0];
  const bool trains = IsCompare(program) || program == "sweep";
  Words small = {program};
  bool has_problem = program == "compare_methods";
  bool has_rules = !IsCompare(program);
  bool has_input = program != "estimate";
  for (size_t i = 1; i < command.size(); ++i) {
    const std::string& word = command[i];
    const std::string value = word.substr(word.find('=') + 1);
    if ((trains || program == "time_windows") &&
        StartsWith(word, "--problem=")) {
      small.push_back("--problem=" + SmallProblem(value));
      has_problem = true;
    } else if (StartsWith(word, "--grid=") && program == "sweep") {
      small.push_back(WithSmallBatches("--grid=" + OneCell(value)));
    } else if (StartsWith(word, "--seeds=")) {
      small.push_back(word.substr(0, word.find_first_of(",.")));
    } else if (StartsWith(word, "--hidden=")) {
      small.push_back(std::regex_replace(word, std::regex("[0-9]+"), "4"));
    } else if (StartsWith(word, "--input=")) {
      small.push_back("--input=" + files.For(value));
      has_input = true;
    } else if (word == "--list_jobs") {
      continue;  // runs them, for a --collect after it
    } else if (StartsWith(word, "--list")) {
      return command;
    } else {
      small.push_back(trains ? WithSmallBatches(word) : word);
      has_rules = has_rules || StartsWith(word, "--rules=");
    }
  }
  if (trains && !has_problem) {
    small.push_back("--problem=" + SmallProblem("oscillator_chain"));
  }
  if (trains && !has_rules) small.push_back("--rules=adam,half_inverse");
  if (!has_input) small.push_back("--input=" + files.For("any.dat"));
  const bool has_scans =
      std::find(small.begin(), small.end(), "--cylinder") == small.end();
  for (const std::string& flag : SmallBudget(program)) {
    if (has_scans || flag != "--scans=1") small.push_back(flag);
  }
  return small;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_DOCS_SMALLEST_BUDGET_H_
