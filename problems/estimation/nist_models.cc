#include "problems/estimation/nist_models.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "ceres/autodiff_cost_function.h"
#include "glog/logging.h"
#include "invgrad/core/option_set.h"

namespace invgrad {

namespace {

constexpr double kPi = 3.14159265358979323846;

template <typename T>
T Square(const T& value) {
  return value * value;
}

// A model is its sizes and Value(x, b) for any scalar type.
struct OneMinusExp {
  static constexpr int kNumParameters = 2;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] * (1.0 - exp(-b[1] * x[0]));
  }
};

struct InverseSquare {
  static constexpr int kNumParameters = 2;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::pow;
    return b[0] * (1.0 - pow(1.0 + b[1] * x[0] / 2.0, -2.0));
  }
};

struct InverseRoot {
  static constexpr int kNumParameters = 2;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::pow;
    return b[0] * (1.0 - pow(1.0 + 2.0 * b[1] * x[0], -0.5));
  }
};

struct Hyperbola {
  static constexpr int kNumParameters = 2;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    return b[0] * b[1] * x[0] / (1.0 + b[1] * x[0]);
  }
};

struct ExpOverLine {
  static constexpr int kNumParameters = 3;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return exp(-b[0] * x[0]) / (b[1] + b[2] * x[0]);
  }
};

struct ThreeExps {
  static constexpr int kNumParameters = 6;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] * exp(-b[1] * x[0]) + b[2] * exp(-b[3] * x[0]) +
           b[4] * exp(-b[5] * x[0]);
  }
};

struct ExpAndTwoPeaks {
  static constexpr int kNumParameters = 8;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] * exp(-b[1] * x[0]) +
           b[2] * exp(-Square((x[0] - b[3]) / b[4])) +
           b[5] * exp(-Square((x[0] - b[6]) / b[7]));
  }
};

struct Power {
  static constexpr int kNumParameters = 2;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::pow;
    return b[0] * pow(T(x[0]), b[1]);
  }
};

struct QuadraticOverQuadratic {
  static constexpr int kNumParameters = 5;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    return (b[0] + x[0] * (b[1] + x[0] * b[2])) /
           (1.0 + x[0] * (b[3] + x[0] * b[4]));
  }
};

struct CubicOverCubic {
  static constexpr int kNumParameters = 7;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    return (b[0] + x[0] * (b[1] + x[0] * (b[2] + x[0] * b[3]))) /
           (1.0 + x[0] * (b[4] + x[0] * (b[5] + x[0] * b[6])));
  }
};

struct LogDegradation {
  static constexpr int kNumParameters = 3;
  static constexpr int kNumPredictors = 2;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] - b[1] * x[0] * exp(-b[2] * x[1]);
  }
};

struct ConstantAndTwoExps {
  static constexpr int kNumParameters = 5;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] + b[1] * exp(-b[3] * x[0]) + b[2] * exp(-b[4] * x[0]);
  }
};

// arctan in (-pi/2, pi/2) for b3 > 0, x < b4
struct LineAndArctan {
  static constexpr int kNumParameters = 4;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::atan2;
    return b[0] - b[1] * x[0] + atan2(b[2], b[3] - x[0]) / kPi;
  }
};

// arctan in (0, pi) for b3 > 0
struct LineAndPositiveArctan {
  static constexpr int kNumParameters = 4;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::atan2;
    return b[0] - b[1] * x[0] - atan2(b[2], x[0] - b[3]) / kPi;
  }
};

struct ThreeWaves {
  static constexpr int kNumParameters = 9;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::cos;
    using std::sin;
    const double year = 2.0 * kPi * x[0] / 12.0;
    const T el_nino = 2.0 * kPi * x[0] / b[3];
    const T oscillation = 2.0 * kPi * x[0] / b[6];
    return b[0] + b[1] * cos(year) + b[2] * sin(year) + b[4] * cos(el_nino) +
           b[5] * sin(el_nino) + b[7] * cos(oscillation) +
           b[8] * sin(oscillation);
  }
};

struct LinearOverQuadratic {
  static constexpr int kNumParameters = 4;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    return b[0] * x[0] * (x[0] + b[1]) / (x[0] * (x[0] + b[2]) + b[3]);
  }
};

struct Logistic {
  static constexpr int kNumParameters = 3;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] / (1.0 + exp(b[1] - b[2] * x[0]));
  }
};

struct RichardsCurve {
  static constexpr int kNumParameters = 4;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    using std::pow;
    return b[0] * pow(1.0 + exp(b[1] - b[2] * x[0]), -1.0 / b[3]);
  }
};

struct Peak {
  static constexpr int kNumParameters = 3;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] / b[1] * exp(-0.5 * Square((x[0] - b[2]) / b[1]));
  }
};

struct ExpOfInverse {
  static constexpr int kNumParameters = 3;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::exp;
    return b[0] * exp(b[1] / (x[0] + b[2]));
  }
};

struct PowerOfInverse {
  static constexpr int kNumParameters = 3;
  static constexpr int kNumPredictors = 1;
  template <typename T>
  static T Value(const double* x, const T* b) {
    using std::pow;
    return b[0] * pow(b[1] + x[0], -1.0 / b[2]);
  }
};

template <typename Model>
struct Residual {
  std::array<double, Model::kNumPredictors> x;
  double response;

  template <typename T>
  bool operator()(const T* b, T* residual) const {
    residual[0] = response - Model::Value(x.data(), b);
    return true;
  }
};

template <typename Model>
NistModel Row(const std::string& name,
              const std::string& formula,
              bool log_response = false) {
  NistModel row;
  row.name = name;
  row.formula = formula;
  row.num_parameters = Model::kNumParameters;
  row.num_predictors = Model::kNumPredictors;
  row.log_response = log_response;
  row.value = [](const double* x, const double* b) {
    return Model::Value(x, b);
  };
  row.make_cost = [log_response](const double* x, double y) {
    auto* residual = new Residual<Model>;
    std::copy_n(x, Model::kNumPredictors, residual->x.begin());
    residual->response = log_response ? std::log(y) : y;
    return new ceres::AutoDiffCostFunction<Residual<Model>,
                                           1,
                                           Model::kNumParameters>(residual);
  };
  return row;
}

}  // namespace

const std::vector<NistModel>& NistModels() {
  static const auto* const models = new std::vector<NistModel>{
      Row<OneMinusExp>("Misra1a", "y = b1 (1 - exp(-b2 x))"),
      Row<ExpOverLine>("Chwirut2", "y = exp(-b1 x) / (b2 + b3 x)"),
      Row<ExpOverLine>("Chwirut1", "y = exp(-b1 x) / (b2 + b3 x)"),
      Row<ThreeExps>("Lanczos3",
                     "y = b1 exp(-b2 x) + b3 exp(-b4 x) + b5 exp(-b6 x)"),
      Row<ExpAndTwoPeaks>("Gauss1",
                          "y = b1 exp(-b2 x) + b3 exp(-((x - b4) / b5)^2) + b6 "
                          "exp(-((x - b7) / b8)^2)"),
      Row<ExpAndTwoPeaks>("Gauss2",
                          "y = b1 exp(-b2 x) + b3 exp(-((x - b4) / b5)^2) + b6 "
                          "exp(-((x - b7) / b8)^2)"),
      Row<Power>("DanWood", "y = b1 x^b2"),
      Row<InverseSquare>("Misra1b", "y = b1 (1 - (1 + b2 x / 2)^-2)"),
      Row<QuadraticOverQuadratic>(
          "Kirby2", "y = (b1 + b2 x + b3 x^2) / (1 + b4 x + b5 x^2)"),
      Row<CubicOverCubic>(
          "Hahn1",
          "y = (b1 + b2 x + b3 x^2 + b4 x^3) / (1 + b5 x + b6 x^2 + b7 x^3)"),
      Row<LogDegradation>("Nelson", "log y = b1 - b2 x1 exp(-b3 x2)", true),
      Row<ConstantAndTwoExps>("MGH17",
                              "y = b1 + b2 exp(-b4 x) + b3 exp(-b5 x)"),
      Row<ThreeExps>("Lanczos1",
                     "y = b1 exp(-b2 x) + b3 exp(-b4 x) + b5 exp(-b6 x)"),
      Row<ThreeExps>("Lanczos2",
                     "y = b1 exp(-b2 x) + b3 exp(-b4 x) + b5 exp(-b6 x)"),
      Row<ExpAndTwoPeaks>("Gauss3",
                          "y = b1 exp(-b2 x) + b3 exp(-((x - b4) / b5)^2) + b6 "
                          "exp(-((x - b7) / b8)^2)"),
      Row<InverseRoot>("Misra1c", "y = b1 (1 - (1 + 2 b2 x)^-0.5)"),
      Row<Hyperbola>("Misra1d", "y = b1 b2 x / (1 + b2 x)"),
      Row<LineAndArctan>("Roszman1",
                         "y = b1 - b2 x - arctan(b3 / (x - b4)) / pi"),
      Row<LineAndPositiveArctan>("Roszman1",
                                 "y = b1 - b2 x - atan2(b3, x - b4) / pi"),
      Row<ThreeWaves>("ENSO",
                      "y = b1 + b2 cos(2 pi x / 12) + b3 sin(2 pi x / 12) + b5 "
                      "cos(2 pi x / b4) + b6 sin(2 pi x / b4) + b8 cos(2 pi x "
                      "/ b7) + b9 sin(2 pi x / b7)"),
      Row<LinearOverQuadratic>("MGH09",
                               "y = b1 (x^2 + b2 x) / (x^2 + b3 x + b4)"),
      Row<CubicOverCubic>(
          "Thurber",
          "y = (b1 + b2 x + b3 x^2 + b4 x^3) / (1 + b5 x + b6 x^2 + b7 x^3)"),
      Row<OneMinusExp>("BoxBOD", "y = b1 (1 - exp(-b2 x))"),
      Row<Logistic>("Rat42", "y = b1 / (1 + exp(b2 - b3 x))"),
      Row<ExpOfInverse>("MGH10", "y = b1 exp(b2 / (x + b3))"),
      Row<Peak>("Eckerle4", "y = b1 / b2 exp(-0.5 ((x - b3) / b2)^2)"),
      Row<RichardsCurve>("Rat43", "y = b1 / (1 + exp(b2 - b3 x))^(1 / b4)"),
      Row<PowerOfInverse>("Bennett5", "y = b1 (b2 + x)^(-1 / b3)"),
  };
  return *models;
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
    *error = data.name + " has " + std::to_string(data.num_parameters()) +
             " parameters and " + std::to_string(data.predictors.cols()) +
             " predictors; expected " +
             std::to_string(of_other_size->num_parameters) + " and " +
             std::to_string(of_other_size->num_predictors) + " for " +
             of_other_size->formula;
    return nullptr;
  }
  *error = UnknownNameMessage("NIST model", data.name, names) + "; there are";
  for (const std::string& known : names) *error += " " + known;
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
