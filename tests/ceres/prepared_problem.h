// A problem whose cost function reads what an evaluation callback prepared.
//
//   r = x^2 - 2
#ifndef INVGRAD_TESTS_CERES_PREPARED_PROBLEM_H_
#define INVGRAD_TESTS_CERES_PREPARED_PROBLEM_H_

#include <limits>

#include "ceres/evaluation_callback.h"
#include "ceres/problem.h"
#include "ceres/sized_cost_function.h"

namespace invgrad {

struct PreparedProblem final : public ceres::EvaluationCallback {
  explicit PreparedProblem(double start) : x(start), problem(Options()) {
    problem.AddResidualBlock(new Cost(this), nullptr, &x);
  }

  void PrepareForEvaluation(bool, bool) override { square = x * x; }

  class Cost final : public ceres::SizedCostFunction<1, 1> {
   public:
    explicit Cost(const PreparedProblem* prepared) : prepared_(*prepared) {}
    bool Evaluate(double const* const* parameters,
                  double* residuals,
                  double** jacobians) const override {
      residuals[0] = prepared_.square - 2.0;
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        jacobians[0][0] = 2.0 * parameters[0][0];
      }
      return true;
    }

   private:
    const PreparedProblem& prepared_;
  };

  ceres::Problem::Options Options() {
    ceres::Problem::Options options;
    options.evaluation_callback = this;
    return options;
  }

  double x;
  double square = std::numeric_limits<double>::quiet_NaN();
  ceres::Problem problem;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_CERES_PREPARED_PROBLEM_H_
