// An own update rule, known to the library by name.
//
//   step = -eta V phi(S) U^T g,   phi(s) = 1 / (s + lambda s_max),   J = U S V^T
//
// Problem:  y_i = a exp(-b t_i) + c exp(-d t_i) from 24 exact samples, which is
//           ill-conditioned: the singular values of J span a factor of 570.
// Unknown:  a, b, c, d.
// Truth:    a = 1, b = 1, c = 1.5, d = 4.
// Start:    a = 0.5, b = 0.5, c = 0.5, d = 2.
//
// Then the same rule trains a network: which push brings a pendulum to a wanted
// angle?
//
// write_update_rule.md explains this program piece by piece.

#include <cmath>
#include <cstdio>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "Eigen/SVD"
#include "ceres/autodiff_cost_function.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "glog/logging.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/minimize.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "invgrad/update_callback.h"

namespace {

// [rule]
// Damps small singular values by a shift.
class ShiftedInverse final : public invgrad::UpdateRule {
 public:
  struct Options {
    double shift = 1e-2;  // lambda >= 0

    void Describe(invgrad::OptionSet* set) {
      set->Add("shift", &shift, {0.0, 1.0}, "lambda, in units of s_max");
    }
  };

  explicit ShiftedInverse(const Options& options) : options_(options) {}

  invgrad::LinearizationParts Needs() const override {
    invgrad::LinearizationParts parts = invgrad::LinearizationParts::Jacobian();
    parts.factorization = true;
    return parts;
  }

  bool ComputeStep(const invgrad::Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    Eigen::MatrixXd J;
    at_x.jacobian->ToDense(&J);
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(
        J, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const Eigen::ArrayXd s = svd.singularValues();
    const Eigen::VectorXd phi = 1.0 / (s + options_.shift * s[0]);
    const Eigen::VectorXd Utg = svd.matrixU().transpose() * at_x.loss_gradient;
    const Eigen::VectorXd d = svd.matrixV() * phi.cwiseProduct(Utg);
    // The eta that minimizes L - eta g . (J d) + 1/2 eta^2 (J d) . H_L (J d).
    const Eigen::VectorXd Jd = J * d;
    const Eigen::VectorXd curved =
        at_x.loss_hessian_times ? at_x.loss_hessian_times(Jd) : Jd;
    const double eta = at_x.loss_gradient.dot(Jd) / Jd.dot(curved);
    if (!std::isfinite(eta)) {
      *error = "the step size is not finite";
      return false;
    }
    *step = -eta * d;
    return true;
  }

 private:
  const Options options_;
};
// [/rule]

// [problem]
struct TwoExponentials {
  double t, y;

  template <typename T>
  bool operator()(const T* x, T* residual) const {
    using std::exp;
    residual[0] = x[0] * exp(-x[1] * t) + x[2] * exp(-x[3] * t) - y;
    return true;
  }
};

// The problem, and its unknowns.
struct Fit {
  double x[4] = {0.5, 0.5, 0.5, 2.0};
  ceres::Problem problem;

  Fit() {
    for (int i = 0; i < 24; ++i) {
      const double t = 0.05 * i;
      const double y = std::exp(-t) + 1.5 * std::exp(-4.0 * t);
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<TwoExponentials, 1, 4>(
              new TwoExponentials{t, y}),
          nullptr,
          x);
    }
  }
};
// [/problem]

void Print(const std::string& label, int num_steps, Fit* fit) {
  double cost = 0.0;
  CHECK(fit->problem.Evaluate({}, &cost, nullptr, nullptr, nullptr));
  std::printf("%-43s  %5d  %8.1e  %6.3f %6.3f %6.3f %6.3f\n",
              label.c_str(),
              num_steps,
              cost,
              fit->x[0],
              fit->x[1],
              fit->x[2],
              fit->x[3]);
}

// Ceres' Levenberg-Marquardt with the rule's proposals, or alone for "".
void SolveByCeres(const std::string& rule_text) {
  Fit fit;
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-14;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  if (rule_text.empty()) {
    ceres::Solve(options, &fit.problem, &summary);
  } else {
    // [solve]
    const auto rule = invgrad::MakeRule(rule_text);
    invgrad::UpdateCallback callback(rule.get(), &fit.problem);
    callback.AddTo(&options);
    ceres::Solve(options, &fit.problem, &summary);
    // [/solve]
  }
  Print("ceres_lm" + (rule_text.empty() ? "" : "+" + rule_text),
        static_cast<int>(summary.iterations.size()) - 1,
        &fit);
}

// The rule's steps alone.
void MinimizeBy(const std::string& rule_text) {
  Fit fit;
  // [minimize]
  invgrad::MinimizerOptions options;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-14;
  invgrad::MinimizerSummary summary;
  const auto rule = invgrad::MakeRule(rule_text);
  invgrad::Minimize(options, rule.get(), &fit.problem, &summary);
  // [/minimize]
  Print(rule_text, summary.num_steps(), &fit);
}

// A pendulum at rest gets a constant push x [1/s^2] for one second; y is its
// angle [rad] then.
struct Pendulum {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    using std::sin;
    T angle(0.0);
    T velocity(0.0);
    for (int i = 0; i < 100; ++i) {
      velocity += 0.01 * (x[0] - 9.81 * sin(angle) - 0.5 * velocity);
      angle += 0.01 * velocity;
    }
    y[0] = angle;
    return true;
  }
};

// [train]
void TrainBy(const std::string& method) {
  const invgrad::Model model(
      invgrad::DenseNetwork({1, 16, 1}, invgrad::Activation::kTanh),
      std::make_shared<invgrad::AutoDiffSimulator<Pendulum, 1, 1>>(),
      std::make_shared<invgrad::SquaredNormLoss>(1, 0.5),
      invgrad::Reduction::kMean);
  const Eigen::MatrixXd angles = Eigen::RowVectorXd::LinSpaced(256, -1.0, 1.0);
  const invgrad::TrainResult result =
      invgrad::Train(model, {angles, angles}, method);
  if (!result.error.empty()) {
    std::printf("%s\n", result.error.c_str());
    return;
  }
  std::printf("%-15s  loss %.1e after %ld steps, %s\n",
              method.c_str(),
              result.history.back().train_loss,
              result.summary.num_steps,
              result.summary.message.c_str());
}
// [/train]

}  // namespace

int main(int /*argc*/, char** argv) {
  invgrad::SetBlasThreads(1);
  google::InitGoogleLogging(argv[0]);
  // [register]
  invgrad::RegisterRule<ShiftedInverse>(
      "shifted_inverse", "step = -eta V (S + lambda s_max)^-1 U^T g");
  // [/register]
  std::printf("%-43s  steps      cost       a      b      c      d\n", "");
  SolveByCeres("");
  for (const char* rule : {"half_inverse:step_size=auto:rho=1",
                           "gauss_newton:step_size=auto:rho=1",
                           "shifted_inverse",
                           "shifted_inverse:shift=1e-3"}) {
    SolveByCeres(rule);
    MinimizeBy(rule);
  }
  std::printf("\n");
  for (const char* rule : {"shifted_inverse", "adaptive", "adam"}) {
    TrainBy(rule);
  }
  // [error]
  std::string error;
  if (invgrad::MakeRule("shifted_inverse:shft=0.1", &error) == nullptr) {
    std::printf("\n%s\n", error.c_str());
  }
  // [/error]
  return 0;
}
