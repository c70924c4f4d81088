#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>

#include "Eigen/Cholesky"
#include "Eigen/Core"
#include "bin/fit_speed/fit_parts.h"
#include "fmt/core.h"
#include "invgrad/fit/streaming_gram.h"
#include "report/table.h"

namespace invgrad {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

// Columns 1 + e cos(pi j (i + 1/2) / rows), which agree but for e: the
// condition number is of order 1 / e.
void CompareFactors(RunCounts* counts) {
  constexpr int kRows = 10000;
  constexpr int kColumns = 10;
  using Step = Eigen::Matrix<double, kColumns, 1>;
  Table table({{"e"},
               {"error by R"},
               {"error by J^T J"},
               {"ns a row, R"},
               {"ns a row, J^T J"}});
  for (const double e : {1.0, 1e-2, 1e-4, 1e-6, 1e-8}) {
    Eigen::MatrixXd J_transposed(kColumns, kRows);
    for (int i = 0; i < kRows; ++i) {
      for (int j = 0; j < kColumns; ++j) {
        constexpr double kPi = 3.14159265358979323846;
        J_transposed(j, i) = 1.0 + e * std::cos(kPi * j * (i + 0.5) / kRows);
      }
    }
    // The step is one everywhere.
    const Eigen::VectorXd r = -J_transposed.colwise().sum();
    Step by_root;
    Step by_products;
    double seconds[2] = {kInfinity, kInfinity};
    for (int repetition = 0; repetition < FLAGS_repetitions; ++repetition) {
      const auto compute_root = [&] {
        // [gram]
        StreamingGram<kColumns> gram;
        for (int i = 0; i < kRows; ++i) {
          gram.AddRow(J_transposed.col(i).data(), r[i]);
        }
        const GramRoot<kColumns>& root = gram.Finish();
        by_root = -root.R.triangularView<Eigen::Upper>().solve(root.c);
        // [/gram]
      };
      const auto compute_products = [&] {
        using Matrix = Eigen::Matrix<double, kColumns, kColumns>;
        Matrix JtJ = Matrix::Zero();
        Step gradient = Step::Zero();
        for (int i = 0; i < kRows; ++i) {
          const Step row = J_transposed.col(i);
          JtJ += row * row.transpose();
          gradient += row * r[i];
        }
        by_products = -JtJ.ldlt().solve(gradient);
      };
      seconds[0] = std::min(seconds[0], Seconds(compute_root));
      seconds[1] = std::min(seconds[1], Seconds(compute_products));
    }
    const auto error = [](const Step& step) {
      return fmt::format("{:.0e}", (step.array() - 1.0).abs().maxCoeff());
    };
    table.AddRow({fmt::format("{:.0e}", e),
                  error(by_root),
                  error(by_products),
                  fmt::format("{:.1f}", 1e9 * seconds[0] / kRows),
                  fmt::format("{:.1f}", 1e9 * seconds[1] / kRows)});
    counts->Add(true);
  }
  std::cout << table.ToMarkdown();
}

}  // namespace invgrad
