// Leaving samples out beside a step, to be timed.
#ifndef BIN_SUPPORT_LEAVE_ONE_OUT_STEP_H_
#define BIN_SUPPORT_LEAVE_ONE_OUT_STEP_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "fmt/core.h"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/spectral/leave_one_out.h"
#include "invgrad/spectral/spectral_filter.h"

namespace invgrad {

// Three exponents with six dampings each, among which a controller may choose.
inline std::vector<SpectralFilter> EighteenFilters() {
  std::vector<SpectralFilter> filters;
  for (const double kappa : {0.5, 0.75, 1.0}) {
    for (const double damping : {1e-12, 1e-9, 1e-6, 1e-4, 1e-2, 1e-1}) {
      filters.push_back(SpectralFilter::Power(kappa, 0.0));
      filters.back().relative_damping = damping;
    }
  }
  return filters;
}

class LeftOutStep {
 public:
  // At most that many samples (0: all), for one filter or for eighteen.
  LeftOutStep(int max_num_samples, bool is_choice) : is_choice_(is_choice) {
    options_.max_num_samples = max_num_samples;
  }

  // Factorizes, and returns the scores of the first filter, or a failure.
  std::string Run(const JacobianOperator& J,
                  const Eigen::VectorXd& g,
                  int num_samples,
                  const SpectralFilter& filter) {
    const std::vector<int> rows(num_samples, J.rows() / num_samples);
    std::string message;
    if (!leave_one_out_.Factorize(J, g, rows, options_, &message)) {
      return message;
    }
    const auto filters = is_choice_ ? EighteenFilters() : std::vector{filter};
    Eigen::MatrixXd changes;
    std::vector<LeaveOneOutSummary> summaries;
    leave_one_out_.Evaluate(filters, &changes, &summaries);
    return fmt::format("{} shifts, decrease {:.2g}",
                       summaries[0].num_shifts,
                       summaries[0].score.RelativeDecrease());
  }

 private:
  bool is_choice_;
  LeaveOneOutOptions options_;
  LeaveOneOut leave_one_out_;
};

}  // namespace invgrad

#endif  // BIN_SUPPORT_LEAVE_ONE_OUT_STEP_H_
