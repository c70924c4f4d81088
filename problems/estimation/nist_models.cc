#include "problems/estimation/nist_models.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "ceres/autodiff_cost_function.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/core/specification.h"
#include "invgrad/option_set.h"
#include "invgrad/separable.h"

namespace invgrad {
namespace {

// For double; argument-dependent lookup finds the functions for Jets.
using std::atan2;
using std::cos;
using std::exp;
using std::pow;
using std::sin;

template <typename T>
T Square(const T& value) {
  return value * value;
}

// x, or a number if there is one predictor.
template <int kNumPredictors>
auto Predictors(const double* x) {
  if constexpr (kNumPredictors == 1) {
    return *x;
  } else {
    return x;
  }
}

template <typename Function, int kNumPredictors>
struct Residual {
  Function f;
  std::array<double, kNumPredictors> x;
  double response;

  template <typename T>
  bool operator()(const T* b, T* residual) const {
    residual[0] = response - f(Predictors<kNumPredictors>(x.data()), b);
    return true;
  }
};

// The model of data sets. f: a function of x (a number, or a pointer to several
// predictors) and b (a pointer to any scalar type).
template <int kNumParameters, int kNumPredictors = 1, typename Function>
std::vector<NistModel> Models(const std::vector<std::string>& names,
                              const std::string& formula,
                              Function f) {
  const bool log_response = formula.rfind("log y", 0) == 0;
  const auto value = [f](const double* x, const double* b) {
    return f(Predictors<kNumPredictors>(x), b);
  };
  const auto make_cost = [f, log_response](const double* x, double y) {
    using Cost = Residual<Function, kNumPredictors>;
    auto* residual = new Cost{f, {}, log_response ? std::log(y) : y};
    std::copy_n(x, kNumPredictors, residual->x.begin());
    return new ceres::AutoDiffCostFunction<Cost, 1, kNumParameters>(residual);
  };
  // The proof depends on numbers only where a model compares them.
  Residual<Function, kNumPredictors> any{f, {}, 1.0};
  any.x.fill(1.0);
  std::array<double, kNumParameters> b;
  b.fill(1.0);
  const std::vector<int> linear =
      LinearParameters<kNumParameters>(any, 1, b.data());
  std::vector<NistModel> models;
  models.reserve(names.size());
  for (const std::string& name : names) {
    models.push_back({name,
                      formula,
                      kNumParameters,
                      kNumPredictors,
                      log_response,
                      linear,
                      value,
                      make_cost});
  }
  return models;
}

using ModelGroups = std::vector<std::vector<NistModel>>;

// By NIST's level of difficulty of the easiest data set of each model.
ModelGroups LowerModels() {
  return {
      Models<2>({"Misra1a", "BoxBOD"},
                "y = b1 (1 - exp(-b2 x))",
                [](auto x, auto b) { return b[0] * (1.0 - exp(-b[1] * x)); }),
      Models<3>(
          {"Chwirut1", "Chwirut2"},
          "y = exp(-b1 x) / (b2 + b3 x)",
          [](auto x, auto b) { return exp(-b[0] * x) / (b[1] + b[2] * x); }),
      Models<6>({"Lanczos1", "Lanczos2", "Lanczos3"},
                "y = b1 exp(-b2 x) + b3 exp(-b4 x) + b5 exp(-b6 x)",
                [](auto x, auto b) {
                  return b[0] * exp(-b[1] * x) + b[2] * exp(-b[3] * x) +
                         b[4] * exp(-b[5] * x);
                }),
      Models<8>({"Gauss1", "Gauss2", "Gauss3"},
                "y = b1 exp(-b2 x) + b3 exp(-((x - b4) / b5)^2) + b6 exp(-((x "
                "- b7) / b8)^2)",
                [](auto x, auto b) {
                  return b[0] * exp(-b[1] * x) +
                         b[2] * exp(-Square((x - b[3]) / b[4])) +
                         b[5] * exp(-Square((x - b[6]) / b[7]));
                }),
      Models<2>({"DanWood"},
                "y = b1 x^b2",
                [](auto x, auto b) { return b[0] * pow(x, b[1]); }),
      Models<2>({"Misra1b"},
                "y = b1 (1 - (1 + b2 x / 2)^-2)",
                [](auto x, auto b) {
                  return b[0] * (1.0 - pow(1.0 + b[1] * x / 2.0, -2.0));
                }),
  };
}

ModelGroups AverageModels() {
  return {
      Models<5>({"Kirby2"},
                "y = (b1 + b2 x + b3 x^2) / (1 + b4 x + b5 x^2)",
                [](auto x, auto b) {
                  return (b[0] + x * (b[1] + x * b[2])) /
                         (1.0 + x * (b[3] + x * b[4]));
                }),
      Models<7>(
          {"Hahn1", "Thurber"},
          "y = (b1 + b2 x + b3 x^2 + b4 x^3) / (1 + b5 x + b6 x^2 + b7 x^3)",
          [](auto x, auto b) {
            return (b[0] + x * (b[1] + x * (b[2] + x * b[3]))) /
                   (1.0 + x * (b[4] + x * (b[5] + x * b[6])));
          }),
      Models<3, 2>({"Nelson"},
                   "log y = b1 - b2 x1 exp(-b3 x2)",
                   [](auto x, auto b) {
                     return b[0] - b[1] * x[0] * exp(-b[2] * x[1]);
                   }),
      Models<5>({"MGH17"},
                "y = b1 + b2 exp(-b4 x) + b3 exp(-b5 x)",
                [](auto x, auto b) {
                  return b[0] + b[1] * exp(-b[3] * x) + b[2] * exp(-b[4] * x);
                }),
      Models<2>({"Misra1c"},
                "y = b1 (1 - (1 + 2 b2 x)^-0.5)",
                [](auto x, auto b) {
                  return b[0] * (1.0 - pow(1.0 + 2.0 * b[1] * x, -0.5));
                }),
      Models<2>(
          {"Misra1d"},
          "y = b1 b2 x / (1 + b2 x)",
          [](auto x, auto b) { return b[0] * b[1] * x / (1.0 + b[1] * x); }),
      // arctan in (-pi/2, pi/2) for b3 > 0, x < b4
      Models<4>({"Roszman1"},
                "y = b1 - b2 x - arctan(b3 / (x - b4)) / pi",
                [](auto x, auto b) {
                  return b[0] - b[1] * x + atan2(b[2], b[3] - x) / M_PI;
                }),
      // arctan in (0, pi) for b3 > 0
      Models<4>({"Roszman1"},
                "y = b1 - b2 x - atan2(b3, x - b4) / pi",
                [](auto x, auto b) {
                  return b[0] - b[1] * x - atan2(b[2], x - b[3]) / M_PI;
                }),
      Models<9>({"ENSO"},
                "y = b1 + b2 cos(2 pi x / 12) + b3 sin(2 pi x / 12) + b5 cos(2 "
                "pi x / b4) + b6 sin(2 pi x / b4) + b8 cos(2 pi x / b7) + b9 "
                "sin(2 pi x / b7)",
                [](auto x, auto b) {
                  const double year = 2.0 * M_PI * x / 12.0;
                  const auto el_nino = 2.0 * M_PI * x / b[3];
                  const auto oscillation = 2.0 * M_PI * x / b[6];
                  return b[0] + b[1] * cos(year) + b[2] * sin(year) +
                         b[4] * cos(el_nino) + b[5] * sin(el_nino) +
                         b[7] * cos(oscillation) + b[8] * sin(oscillation);
                }),
  };
}

ModelGroups HigherModels() {
  return {
      Models<4>({"MGH09"},
                "y = b1 (x^2 + b2 x) / (x^2 + b3 x + b4)",
                [](auto x, auto b) {
                  return b[0] * x * (x + b[1]) / (x * (x + b[2]) + b[3]);
                }),
      Models<3>(
          {"Rat42"},
          "y = b1 / (1 + exp(b2 - b3 x))",
          [](auto x, auto b) { return b[0] / (1.0 + exp(b[1] - b[2] * x)); }),
      Models<3>({"MGH10"},
                "y = b1 exp(b2 / (x + b3))",
                [](auto x, auto b) { return b[0] * exp(b[1] / (x + b[2])); }),
      Models<3>({"Eckerle4"},
                "y = b1 / b2 exp(-0.5 ((x - b3) / b2)^2)",
                [](auto x, auto b) {
                  return b[0] / b[1] * exp(-0.5 * Square((x - b[2]) / b[1]));
                }),
      Models<4>({"Rat43"},
                "y = b1 / (1 + exp(b2 - b3 x))^(1 / b4)",
                [](auto x, auto b) {
                  return b[0] * pow(1.0 + exp(b[1] - b[2] * x), -1.0 / b[3]);
                }),
      Models<3>(
          {"Bennett5"},
          "y = b1 (b2 + x)^(-1 / b3)",
          [](auto x, auto b) { return b[0] * pow(b[1] + x, -1.0 / b[2]); }),
  };
}

std::vector<NistModel> MakeModels() {
  std::vector<NistModel> models;
  for (const ModelGroups& level :
       {LowerModels(), AverageModels(), HigherModels()}) {
    for (const std::vector<NistModel>& group : level) {
      models.insert(models.end(), group.begin(), group.end());
    }
  }
  return models;
}

}  // namespace

const std::vector<NistModel>& NistModels() {
  static const auto& models = *new std::vector<NistModel>(MakeModels());
  return models;
}

const NistModel* FindNistModel(const NistData& data, std::string* error) {
  const NistModel* nearest = nullptr;
  double least = 0.0;
  std::vector<std::string> names;
  for (const NistModel& model : NistModels()) {
    if (names.empty() || names.back() != model.name) {
      names.push_back(model.name);
    }
    if (model.name != data.name) continue;
    if (data.num_parameters() != model.num_parameters ||
        data.predictors.cols() != model.num_predictors) {
      *error = fmt::format(
          "{} has {} parameters and {} predictors; expected {} and {} for {}",
          data.name,
          data.num_parameters(),
          data.predictors.cols(),
          model.num_parameters,
          model.num_predictors,
          model.formula);
      return nullptr;
    }
    const double difference =
        std::abs(SumOfSquares(model, data, data.certified) -
                 data.certified_sum_of_squares);
    if (nearest == nullptr || difference < least) {
      nearest = &model;
      least = difference;
    }
  }
  if (nearest == nullptr) {
    *error = fmt::format(
        "'{}' is not one of NIST's {} data sets, which --list shows; expected "
        "--model=\"FORMULA\" for a model of your own",
        Printable(data.name, 40),
        names.size());
  }
  return nearest;
}

double SumOfSquares(const NistModel& model,
                    const NistData& data,
                    const Eigen::VectorXd& b) {
  CHECK_EQ(b.size(), model.num_parameters);
  CHECK_EQ(data.predictors.cols(), model.num_predictors);
  double sum = 0.0;
  for (Eigen::Index i = 0; i < data.responses.size(); ++i) {
    const Eigen::VectorXd x = data.predictors.row(i);
    const double y = data.responses[i];
    sum += Square((model.log_response ? std::log(y) : y) -
                  model.value(x.data(), b.data()));
  }
  return sum;
}

bool HasCertifiedSum(const NistData& data,
                     const Eigen::VectorXd& responses,
                     double sum_of_squares) {
  const double tolerance =
      1e-6 * data.certified_sum_of_squares + 1e-12 * responses.squaredNorm();
  return std::abs(sum_of_squares - data.certified_sum_of_squares) <= tolerance;
}

Eigen::VectorXd LogRelativeErrors(const Eigen::VectorXd& estimates,
                                  const Eigen::VectorXd& certified) {
  CHECK_EQ(estimates.size(), certified.size());
  Eigen::VectorXd digits(estimates.size());
  for (Eigen::Index i = 0; i < digits.size(); ++i) {
    const double lre =
        -std::log10(std::abs((estimates[i] - certified[i]) / certified[i]));
    digits[i] = lre > 0.0 ? std::min(lre, kMaxNistDigits) : 0.0;  // NaN: 0
  }
  return digits;
}

bool IsNistSolution(const Eigen::VectorXd& log_relative_errors) {
  return log_relative_errors.minCoeff() > kNistDigitsOfSolution;
}

}  // namespace invgrad
