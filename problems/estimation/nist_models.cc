#include "problems/estimation/nist_models.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <type_traits>

#include "ceres/autodiff_cost_function.h"
#include "fmt/format.h"
#include "glog/logging.h"
#include "invgrad/core/option_set.h"

namespace invgrad {
namespace {

// For double; argument-dependent lookup finds the functions for Jets.
using std::atan2;
using std::cos;
using std::exp;
using std::pow;
using std::sin;

constexpr double kPi = 3.14159265358979323846;

template <typename T>
T Square(const T& value) {
  return value * value;
}

template <typename Function, int kNumPredictors>
struct Residual {
  Function f;
  std::array<double, kNumPredictors> x;
  double response;

  template <typename T>
  bool operator()(const T* b, T* residual) const {
    residual[0] = response - f(x.data(), b);
    return true;
  }
};

// f: a function of x and b for any scalar type of b.
template <int kNumParameters, int kNumPredictors = 1, typename Function>
NistModel Model(const std::string& name,
                const std::string& formula,
                Function f,
                bool log_response = false) {
  NistModel model;
  model.name = name;
  model.formula = formula;
  model.num_parameters = kNumParameters;
  model.num_predictors = kNumPredictors;
  model.log_response = log_response;
  model.value = [f](const double* x, const double* b) { return f(x, b); };
  model.make_cost = [f, log_response](const double* x, double y) {
    using Cost = Residual<Function, kNumPredictors>;
    auto* residual = new Cost{f, {}, log_response ? std::log(y) : y};
    std::copy_n(x, kNumPredictors, residual->x.begin());
    return new ceres::AutoDiffCostFunction<Cost, 1, kNumParameters>(residual);
  };
  return model;
}

std::vector<NistModel> MakeModels() {
  // Functions of several data sets.
  const auto one_minus_exp = [](const double* x, const auto* b) {
    return b[0] * (1.0 - exp(-b[1] * x[0]));
  };
  const auto exp_over_line = [](const double* x, const auto* b) {
    return exp(-b[0] * x[0]) / (b[1] + b[2] * x[0]);
  };
  const auto three_exps = [](const double* x, const auto* b) {
    return b[0] * exp(-b[1] * x[0]) + b[2] * exp(-b[3] * x[0]) +
           b[4] * exp(-b[5] * x[0]);
  };
  const auto exp_and_two_peaks = [](const double* x, const auto* b) {
    return b[0] * exp(-b[1] * x[0]) +
           b[2] * exp(-Square((x[0] - b[3]) / b[4])) +
           b[5] * exp(-Square((x[0] - b[6]) / b[7]));
  };
  const auto cubic_over_cubic = [](const double* x, const auto* b) {
    return (b[0] + x[0] * (b[1] + x[0] * (b[2] + x[0] * b[3]))) /
           (1.0 + x[0] * (b[4] + x[0] * (b[5] + x[0] * b[6])));
  };
  const std::string one_minus_exp_text = "y = b1 (1 - exp(-b2 x))";
  const std::string exp_over_line_text = "y = exp(-b1 x) / (b2 + b3 x)";
  const std::string three_exps_text =
      "y = b1 exp(-b2 x) + b3 exp(-b4 x) + b5 exp(-b6 x)";
  const std::string exp_and_two_peaks_text =
      "y = b1 exp(-b2 x) + b3 exp(-((x - b4) / b5)^2) + b6 exp(-((x - b7) / "
      "b8)^2)";
  const std::string cubic_over_cubic_text =
      "y = (b1 + b2 x + b3 x^2 + b4 x^3) / (1 + b5 x + b6 x^2 + b7 x^3)";
  return {
      Model<2>("Misra1a", one_minus_exp_text, one_minus_exp),
      Model<3>("Chwirut2", exp_over_line_text, exp_over_line),
      Model<3>("Chwirut1", exp_over_line_text, exp_over_line),
      Model<6>("Lanczos3", three_exps_text, three_exps),
      Model<8>("Gauss1", exp_and_two_peaks_text, exp_and_two_peaks),
      Model<8>("Gauss2", exp_and_two_peaks_text, exp_and_two_peaks),
      Model<2>("DanWood",
               "y = b1 x^b2",
               [](const double* x, const auto* b) {
                 using T = std::decay_t<decltype(*b)>;
                 return b[0] * pow(T(x[0]), b[1]);
               }),
      Model<2>("Misra1b",
               "y = b1 (1 - (1 + b2 x / 2)^-2)",
               [](const double* x, const auto* b) {
                 return b[0] * (1.0 - pow(1.0 + b[1] * x[0] / 2.0, -2.0));
               }),
      Model<5>("Kirby2",
               "y = (b1 + b2 x + b3 x^2) / (1 + b4 x + b5 x^2)",
               [](const double* x, const auto* b) {
                 return (b[0] + x[0] * (b[1] + x[0] * b[2])) /
                        (1.0 + x[0] * (b[3] + x[0] * b[4]));
               }),
      Model<7>("Hahn1", cubic_over_cubic_text, cubic_over_cubic),
      Model<3, 2>(
          "Nelson",
          "log y = b1 - b2 x1 exp(-b3 x2)",
          [](const double* x, const auto* b) {
            return b[0] - b[1] * x[0] * exp(-b[2] * x[1]);
          },
          /*log_response=*/true),
      Model<5>("MGH17",
               "y = b1 + b2 exp(-b4 x) + b3 exp(-b5 x)",
               [](const double* x, const auto* b) {
                 return b[0] + b[1] * exp(-b[3] * x[0]) +
                        b[2] * exp(-b[4] * x[0]);
               }),
      Model<6>("Lanczos1", three_exps_text, three_exps),
      Model<6>("Lanczos2", three_exps_text, three_exps),
      Model<8>("Gauss3", exp_and_two_peaks_text, exp_and_two_peaks),
      Model<2>("Misra1c",
               "y = b1 (1 - (1 + 2 b2 x)^-0.5)",
               [](const double* x, const auto* b) {
                 return b[0] * (1.0 - pow(1.0 + 2.0 * b[1] * x[0], -0.5));
               }),
      Model<2>("Misra1d",
               "y = b1 b2 x / (1 + b2 x)",
               [](const double* x, const auto* b) {
                 return b[0] * b[1] * x[0] / (1.0 + b[1] * x[0]);
               }),
      // arctan in (-pi/2, pi/2) for b3 > 0, x < b4
      Model<4>("Roszman1",
               "y = b1 - b2 x - arctan(b3 / (x - b4)) / pi",
               [](const double* x, const auto* b) {
                 return b[0] - b[1] * x[0] + atan2(b[2], b[3] - x[0]) / kPi;
               }),
      // arctan in (0, pi) for b3 > 0
      Model<4>("Roszman1",
               "y = b1 - b2 x - atan2(b3, x - b4) / pi",
               [](const double* x, const auto* b) {
                 return b[0] - b[1] * x[0] - atan2(b[2], x[0] - b[3]) / kPi;
               }),
      Model<9>("ENSO",
               "y = b1 + b2 cos(2 pi x / 12) + b3 sin(2 pi x / 12) + b5 cos(2 "
               "pi x / b4) + b6 sin(2 pi x / b4) + b8 cos(2 pi x / b7) + b9 "
               "sin(2 pi x / b7)",
               [](const double* x, const auto* b) {
                 const double year = 2.0 * kPi * x[0] / 12.0;
                 const auto el_nino = 2.0 * kPi * x[0] / b[3];
                 const auto oscillation = 2.0 * kPi * x[0] / b[6];
                 return b[0] + b[1] * cos(year) + b[2] * sin(year) +
                        b[4] * cos(el_nino) + b[5] * sin(el_nino) +
                        b[7] * cos(oscillation) + b[8] * sin(oscillation);
               }),
      Model<4>("MGH09",
               "y = b1 (x^2 + b2 x) / (x^2 + b3 x + b4)",
               [](const double* x, const auto* b) {
                 return b[0] * x[0] * (x[0] + b[1]) /
                        (x[0] * (x[0] + b[2]) + b[3]);
               }),
      Model<7>("Thurber", cubic_over_cubic_text, cubic_over_cubic),
      Model<2>("BoxBOD", one_minus_exp_text, one_minus_exp),
      Model<3>("Rat42",
               "y = b1 / (1 + exp(b2 - b3 x))",
               [](const double* x, const auto* b) {
                 return b[0] / (1.0 + exp(b[1] - b[2] * x[0]));
               }),
      Model<3>("MGH10",
               "y = b1 exp(b2 / (x + b3))",
               [](const double* x, const auto* b) {
                 return b[0] * exp(b[1] / (x[0] + b[2]));
               }),
      Model<3>("Eckerle4",
               "y = b1 / b2 exp(-0.5 ((x - b3) / b2)^2)",
               [](const double* x, const auto* b) {
                 return b[0] / b[1] * exp(-0.5 * Square((x[0] - b[2]) / b[1]));
               }),
      Model<4>("Rat43",
               "y = b1 / (1 + exp(b2 - b3 x))^(1 / b4)",
               [](const double* x, const auto* b) {
                 return b[0] * pow(1.0 + exp(b[1] - b[2] * x[0]), -1.0 / b[3]);
               }),
      Model<3>("Bennett5",
               "y = b1 (b2 + x)^(-1 / b3)",
               [](const double* x, const auto* b) {
                 return b[0] * pow(b[1] + x[0], -1.0 / b[2]);
               }),
  };
}

}  // namespace

const std::vector<NistModel>& NistModels() {
  static const auto& models = *new std::vector<NistModel>(MakeModels());
  return models;
}

const NistModel* FindNistModel(const NistData& data, std::string* error) {
  const NistModel* nearest = nullptr;
  const NistModel* of_other_size = nullptr;
  double least = std::numeric_limits<double>::infinity();
  std::vector<std::string> names;
  for (const NistModel& model : NistModels()) {
    if (names.empty() || names.back() != model.name) {
      names.push_back(model.name);
    }
    if (model.name != data.name) continue;
    if (data.num_parameters() != model.num_parameters ||
        data.predictors.cols() != model.num_predictors) {
      of_other_size = &model;
      continue;
    }
    const double difference =
        std::abs(SumOfSquares(model, data, data.certified) -
                 data.certified_sum_of_squares);
    if (nearest == nullptr || difference < least) {
      nearest = &model;
      least = difference;
    }
  }
  if (nearest != nullptr) return nearest;
  if (of_other_size != nullptr) {
    *error = fmt::format(
        "{} has {} parameters and {} predictors; expected {} and {} for {}",
        data.name,
        data.num_parameters(),
        data.predictors.cols(),
        of_other_size->num_parameters,
        of_other_size->num_predictors,
        of_other_size->formula);
  } else {
    *error = fmt::format("{}; there are {}",
                         UnknownNameMessage("NIST model", data.name, names),
                         fmt::join(names, " "));
  }
  return nullptr;
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
