#include "bin/registration/methods.h"

#include <algorithm>

#include "Eigen/Dense"
#include "bin/support/program.h"
#include "ceres/solver.h"
#include "fmt/core.h"
#include "invgrad/rules.h"
#include "invgrad/update_callback.h"

namespace invgrad {
namespace {

using Kind = RegistrationMethod::Kind;

class EigenvalueRule final : public UpdateRule {
 public:
  explicit EigenvalueRule(double threshold) : threshold_(threshold) {}

  LinearizationParts Needs() const override {
    return LinearizationParts::Jacobian();
  }
  std::string LastStepReport() const override { return report_; }

  bool ComputeStep(const Linearization& at_x,
                   Eigen::VectorXd* step,
                   std::string* error) override {
    Eigen::MatrixXd H;
    Eigen::VectorXd gradient;
    at_x.jacobian->ParameterGram(&H);
    at_x.jacobian->TransposeTimes(at_x.loss_gradient, &gradient);
    int num_left_alone = 0;
    if (!EigenvalueStep(
            H, gradient, threshold_, step, &num_left_alone, error)) {
      return false;
    }
    report_ = fmt::format("{} of {} left alone", num_left_alone, step->size());
    return true;
  }

 private:
  const double threshold_;
  std::string report_;
};

}  // namespace

bool EigenvalueStep(const Eigen::MatrixXd& H,
                    const Eigen::VectorXd& gradient,
                    double threshold,
                    Eigen::VectorXd* step,
                    int* num_left_alone,
                    std::string* error) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(H);
  if (eigen.info() != Eigen::Success || !gradient.allFinite()) {
    *error = "H has no eigenvalues, or the gradient is not finite";
    return false;
  }
  const Eigen::MatrixXd& V = eigen.eigenvectors();
  Eigen::VectorXd c = V.transpose() * gradient;
  *num_left_alone = 0;
  for (Eigen::Index i = 0; i < c.size(); ++i) {
    const double value = eigen.eigenvalues()[i];
    const bool is_left_alone = value <= threshold;
    c[i] = is_left_alone ? 0.0 : c[i] / value;
    *num_left_alone += is_left_alone ? 1 : 0;
  }
  *step = -V * c;
  return true;
}

bool ParseRegistrationMethods(const std::string& text,
                              std::vector<RegistrationMethod>* methods,
                              std::string* error) {
  const std::string kEigenvalue = "eigenvalue:";
  methods->clear();
  for (const std::string& label : SplitList(text)) {
    RegistrationMethod method;
    method.label = label;
    if (label.compare(0, kEigenvalue.size(), kEigenvalue) == 0) {
      const std::string threshold = label.substr(kEigenvalue.size());
      std::vector<double> numbers;
      if (!ParseNumbers(threshold, &numbers, error) || numbers.size() != 1) {
        *error = fmt::format(
            "'{}' needs a positive threshold, as eigenvalue:100", label);
        return false;
      }
      method.kind = Kind::kEigenvalue;
      method.eigenvalue = numbers[0];
    } else if (label == "gauss_newton") {
      method.kind = Kind::kEigenvalue;
    } else if (label == "odometry") {
      method.kind = Kind::kOdometry;
    } else if (label == "lm") {
      method.kind = Kind::kLm;
    } else if (label == "half_inverse") {
      method.kind = Kind::kHalfInverse;
    } else if (label == "determined") {
      method.kind = Kind::kDetermined;
    } else {
      *error = fmt::format(
          "unknown method '{}'; known: odometry, lm, half_inverse, "
          "gauss_newton, eigenvalue:THRESHOLD, determined",
          label);
      return false;
    }
    methods->push_back(method);
  }
  if (methods->empty()) *error = "expected a method";
  return !methods->empty();
}

std::unique_ptr<UpdateRule> MakeRegistrationRule(
    const RegistrationMethod& method, double tau) {
  switch (method.kind) {
    case Kind::kHalfInverse:
      return MakeRule("half_inverse:step_size=auto:rho=1");
    case Kind::kDetermined:
      return MakeRule(fmt::format("determined:groups=blocks:truncation={}",
                                  std::clamp(tau, 1e-6, 0.5)));
    case Kind::kEigenvalue:
      return std::make_unique<EigenvalueRule>(method.eigenvalue);
    default:
      return nullptr;
  }
}

void SolveAlignment(UpdateRule* rule, ceres::Problem* problem) {
  ceres::Solver::Options options;
  options.logging_type = ceres::SILENT;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 5;
  ceres::Solver::Summary summary;
  if (rule == nullptr) {
    ceres::Solve(options, problem, &summary);
    return;
  }
  UpdateCallback::Options callback_options;
  callback_options.only_proposals = true;
  UpdateCallback callback(rule, problem, callback_options);
  callback.AddTo(&options);
  ceres::Solve(options, problem, &summary);
}

int NumLeftAlone(const RegistrationMethod& method, const UpdateRule* rule) {
  if (method.kind != Kind::kDetermined && method.kind != Kind::kEigenvalue) {
    return -1;
  }
  // "1 of 6 left alone: ...", or "all 6 determined".
  const std::string report = rule->LastStepReport();
  const size_t end = report.find(" of ");
  return end == std::string::npos ? 0 : std::stoi(report.substr(0, end));
}

}  // namespace invgrad
