// Measures how accurate the routes of the half-inverse step are on the
// Jacobians of the problems, at the initial weights and after some training.
//
//   error = |d - d_exact| / |d_exact|
//
// Sample runs:
//
//   accuracy
//   accuracy --problems=quantum_dipole --truncations=1e-5,1e-10
//   accuracy --problems=poisson --truncations=1e-5
//
// d_exact is computed in long double, by QR and Jacobi's SVD, if the batch has
// at most --long_double_rows rows (m = 448 takes some minutes), and by the
// route svd otherwise, whose error is about epsilon / truncation. A cell holds
// the error and, in brackets, the route's estimate.
//
//   auto        the route of a rule with default tolerances
//   gram, svd   the routes, for any error
//   sgesdd      LAPACK's SVD in single precision, which the code that came with
//               the paper uses

#include <lapacke.h>

#include <algorithm>
#include <iostream>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "bin/support/parse_list.h"
#include "bin/support/program.h"
#include "bin/support/spectral_reference.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "invgrad/spectral/spectral_step.h"
#include "problems/problems.h"
#include "report/table.h"

DEFINE_string(problems,
              "oscillator_chain,oscillator_chain:coupling=cubic,quantum_dipole",
              "learning problems, name[:key=value...],...");
DEFINE_string(truncations,
              "1e-2,1e-3,1e-4,1e-5,1e-6,1e-7,1e-8,1e-10",
              "tau: singular values s <= tau s_max are dropped");
DEFINE_int32(train_steps, 1000, "Adam steps before the second measurement");
DEFINE_int32(batch_size, 0, "samples of the batch; 0: as published");
DEFINE_int32(long_double_rows,
             512,
             "largest m for which the reference is long double");

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::MatrixXf;
using Eigen::VectorXd;
using Eigen::VectorXf;

// J = U S V^T by LAPACK's sgesdd.
class SingleSvd {
 public:
  explicit SingleSvd(const MatrixXd& J) {
    MatrixXf A = J.cast<float>();
    const auto m = static_cast<int>(A.rows());
    const auto n = static_cast<int>(A.cols());
    const int k = std::min(m, n);
    U_.resize(m, k);
    s_.resize(k);
    Vt_.resize(k, n);
    converged_ = LAPACKE_sgesdd(LAPACK_COL_MAJOR,
                                'S',
                                m,
                                n,
                                A.data(),
                                m,
                                s_.data(),
                                U_.data(),
                                m,
                                Vt_.data(),
                                k) == 0;
  }

  // NaN if the iteration did not converge.
  VectorXd Step(const SpectralFilter& filter, const VectorXd& g) const {
    if (!converged_)
      return VectorXd::Constant(Vt_.cols(),
                                std::numeric_limits<double>::quiet_NaN());
    VectorXf c = U_.transpose() * g.cast<float>();
    for (Index i = 0; i < c.size(); ++i) {
      c[i] *= static_cast<float>(filter(s_[i], s_[0]));
    }
    return (Vt_.transpose() * c).cast<double>();
  }

 private:
  MatrixXf U_;
  VectorXf s_;
  MatrixXf Vt_;
  bool converged_ = false;
};

double RelativeError(const VectorXd& d, const VectorXd& exact) {
  return (d - exact).norm() / exact.norm();
}

void Measure(const Linearization& at_weights,
             const std::vector<double>& truncations) {
  const JacobianOperator& J = *at_weights.jacobian;
  const VectorXd& g = at_weights.loss_gradient;
  MatrixXd dense;
  J.ToDense(&dense);
  std::unique_ptr<const SpectralReference> reference;
  if (J.rows() <= FLAGS_long_double_rows) {
    reference = std::make_unique<SpectralReference>(dense);
    const LongVector& s = reference->s();
    std::cout << fmt::format("s_min / s_max = {:.1e}\n\n",
                             static_cast<double>(s[s.size() - 1] / s[0]));
  }
  const SingleSvd single(dense);
  Table table({{"tau"},
               {"rank"},
               {"route", Table::Align::kLeft},
               {"auto"},
               {"gram"},
               {"svd"},
               {"sgesdd"}});
  for (const double tau : truncations) {
    const SpectralFilter filter = SpectralFilter::HalfInverse(tau);
    SpectralStepSummary summary;
    VectorXd exact;
    if (reference != nullptr) {
      exact = reference->Step(filter, g).cast<double>();
    } else {
      SpectralStepOptions by_svd;
      by_svd.route = SpectralRoute::kSvd;
      if (!SpectralStep(J, g, filter, by_svd, &exact, &summary)) {
        Warn(summary.message);
        continue;
      }
    }
    // The error of a route, with its estimate in brackets.
    const auto cell = [&](SpectralRoute route) -> std::string {
      constexpr double kInfinity = std::numeric_limits<double>::infinity();
      SpectralStepOptions options = SpectralStepOptions::ForTraining();
      options.route = route;
      if (route != SpectralRoute::kAuto) {
        options.tolerance = options.threshold_tolerance = kInfinity;
      }
      VectorXd d;
      if (!SpectralStep(J, g, filter, options, &d, &summary)) return "refused";
      std::string text = fmt::format(
          "{:.1e} ({:.0e})", RelativeError(d, exact), summary.estimated_error);
      if (summary.num_undecided > 0) {
        text += fmt::format(", {} undecided", summary.num_undecided);
      }
      return text;
    };
    const std::string by_auto = cell(SpectralRoute::kAuto);
    const std::string route = SpectralRouteName(summary.route);
    const std::string rank = std::to_string(summary.rank);
    const double single_error = RelativeError(single.Step(filter, g), exact);
    table.AddRow(
        {fmt::format("{:.0e}", tau),
         rank,
         route,
         by_auto,
         cell(SpectralRoute::kGram),
         reference != nullptr ? cell(SpectralRoute::kSvd) : "reference",
         fmt::format("{:.1e}", single_error)});
  }
  std::cout << table.ToMarkdown() << "\n" << std::flush;
}

int Run() {
  std::vector<Specification> problems;
  std::vector<double> truncations;
  std::string error;
  if (!ParseSpecifications(FLAGS_problems, &problems, &error)) {
    return Fail("--problems: " + error);
  }
  if (!ParseNumbers(FLAGS_truncations, &truncations, &error)) {
    return Fail("--truncations: " + error);
  }
  for (const double tau : truncations) {
    if (tau >= 1.0) return Fail("--truncations: must be below 1");
  }
  if (FLAGS_train_steps < 0) return Fail("--train_steps: must not be negative");
  if (FLAGS_batch_size < 0) return Fail("--batch_size: must not be negative");
  for (const Specification& specification : problems) {
    PhysicsProblem problem;
    if (!CreateProblem(specification.text, nullptr, &problem, &error)) {
      return Fail("--problems: " + error);
    }
    if (!problem.learning.has_value()) {
      return Fail("--problems: " + specification.text +
                  " has no network; allowed are learning problems");
    }
    std::vector<int> train_steps = {0};
    if (FLAGS_train_steps > 0) train_steps.push_back(FLAGS_train_steps);
    for (const int num_steps : train_steps) {
      Linearization at_weights;
      if (!LinearizeAfterTraining(*problem.learning,
                                  FLAGS_batch_size,
                                  num_steps,
                                  &at_weights,
                                  &error)) {
        return Fail(specification.text + ": " + error);
      }
      std::cout << fmt::format(
                       "**{}**, {}: J {} x {}\n",
                       specification.text,
                       num_steps == 0
                           ? "initial weights"
                           : fmt::format("after {} steps of Adam", num_steps),
                       at_weights.jacobian->rows(),
                       at_weights.jacobian->cols())
                << std::flush;
      Measure(at_weights, truncations);
    }
  }
  return 0;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(argc,
                             argv,
                             "measures the errors of the half-inverse step's "
                             "routes on the Jacobians of the problems",
                             invgrad::Run);
}
