// The nonlinear regression models of NIST's StRD: 27 data sets by name.
//
//   residual_i = y_i - f(x_i; b),   log y_i in place of y_i for Nelson
//
// Cost:    one evaluation of f with a Jet of n derivatives an observation.
// Fails:   residuals are not finite where f is not, for instance a power of a
//          negative number; Ceres then rejects the step.
//
// Roszman1 has two rows, because two versions of the file exist, with different
// branches of arctan[b3 / (x - b4)]. NIST's b1 = 0.2020 belongs to the branch
// in (-pi/2, pi/2), -atan2(b3, b4 - x) for the data; Ceres' copy has
// b1 = 1.2020 for the branch in (0, pi), atan2(b3, x - b4). Both are smooth
// at x = b4.
//
// [1] https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml
#ifndef PROBLEMS_ESTIMATION_NIST_MODELS_H_
#define PROBLEMS_ESTIMATION_NIST_MODELS_H_

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "problems/estimation/nist_file.h"

namespace invgrad {

struct NistModel {
  std::string name;     // of the data set: "Misra1a"
  std::string formula;  // one line
  int num_parameters;   // n, one parameter block
  int num_predictors;
  bool log_response;  // f is log y
  // The parameters in which f is affine, by LinearParameters
  // (separable.h); for all data.
  std::vector<int> linear;
  // f(x; b), with num_predictors and num_parameters entries.
  std::function<double(const double* x, const double* b)> value;
  // The residual of one observation; the caller owns it.
  std::function<ceres::CostFunction*(const double* x, double y)> make_cost;
};

const std::vector<NistModel>& NistModels();

// The model of the file; of several models with this name, the one whose sum of
// squares at the certified values is closest to the certified sum. Null, with
// *error set, if no model has this name and these sizes.
const NistModel* FindNistModel(const NistData& data, std::string* error);

// sum_i residual_i^2 at b.
double SumOfSquares(const NistModel& model,
                    const NistData& data,
                    const Eigen::VectorXd& b);

// Whether a sum of squares is the certified one, up to its ten digits. For an
// almost exact fit the sum consists of rounding errors of the responses.
bool HasCertifiedSum(const NistData& data,
                     const Eigen::VectorXd& responses,
                     double sum_of_squares);

// The number of digits of each parameter that agree with the certified value:
//
//   -log10(|estimate - certified| / |certified|), in [0, kMaxNistDigits]
//
// 0 where the estimate is not finite. The certified values have 11 digits.
constexpr double kMaxNistDigits = 11.0;
Eigen::VectorXd LogRelativeErrors(const Eigen::VectorXd& estimates,
                                  const Eigen::VectorXd& certified);

// More than kNistDigitsOfSolution digits in every parameter.
constexpr double kNistDigitsOfSolution = 4.0;
bool IsNistSolution(const Eigen::VectorXd& log_relative_errors);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_NIST_MODELS_H_
