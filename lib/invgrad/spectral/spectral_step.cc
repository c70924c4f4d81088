#include <algorithm>
#include <cmath>
#include <limits>

#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/core/shared_jacobian.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/internal/logging.h"
#include "invgrad/spectral.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// After a Gram matrix that was not accurate enough, this many steps take svd.
constexpr int kSvdSteps = 20;

bool GradientRoute(const SpectralProblem& problem) {
  VectorXd* d = problem.d;
  SpectralStepSummary* summary = problem.summary;
  CHECK(problem.filter.IsGradientDescent())
      << "The route gradient only computes phi(s) = s.";
  problem.J.TransposeTimes(problem.g, d);
  summary->estimated_error = RoundingError();
  return d->allFinite() || (CheckJacobianFinite(problem.J, &summary->message) &&
                            CheckFinite("J^T g", *d, &summary->message));
}

bool TakeRoute(const SpectralProblem& problem,
               SpectralRoute route,
               double memory_limit) {
  SpectralStepSummary* summary = problem.summary;
  *summary = SpectralStepSummary();
  summary->route = route;
  const Communicator* const communicator = RanksOf(problem.J);
  const double bytes =
      SpectralStepBytes(route,
                        problem.m(),
                        problem.n(),
                        communicator == nullptr ? 1 : communicator->size());
  // Before a message is composed: a step on warm memory allocates nothing.
  bool fits = FitsInMemory(bytes, memory_limit);
  // The machines of ranks may differ.
  if (communicator != nullptr)
    fits = communicator->Agree(fits, &summary->message);
  if (!fits) {
    FitsInMemory(fmt::format("route {} with J {} x {}",
                             SpectralRouteName(route),
                             problem.m(),
                             problem.n()),
                 {{"its matrices", bytes}},
                 memory_limit,
                 &summary->message);
    summary->message +=
        "; Golub-Kahan steps (rule krylov) need products with J alone";
    return false;
  }
  switch (route) {
    case SpectralRoute::kGram:
      return GramRoute(problem);
    case SpectralRoute::kSvd:
      return SvdRoute(problem);
    case SpectralRoute::kGradient:
      return GradientRoute(problem);
    case SpectralRoute::kAuto:
      break;
  }
  LOG(FATAL) << "auto is no single route.";
  return false;
}

// A tolerance that a gram step violates; none if `option` is null.
struct Violation {
  std::string reason;
  const char* option = nullptr;
};

Violation ViolationBy(const SpectralStepSummary& gram,
                      const SpectralStepOptions& options) {
  if (gram.num_undecided > 0 &&
      gram.threshold_resolution > options.threshold_tolerance) {
    return {fmt::format("gram: {} singular values undecided, threshold "
                        "resolved to {:.2g} > {}",
                        gram.num_undecided,
                        gram.threshold_resolution,
                        options.threshold_tolerance),
            "threshold_tolerance"};
  }
  if (gram.estimated_error <= options.tolerance) return {};
  return {fmt::format("gram: estimated error {:.2g} > {}",
                      gram.estimated_error,
                      options.tolerance),
          "tolerance"};
}

// Route gram, then svd if gram is not accurate enough.
bool AutoStep(const SpectralProblem& problem,
              const SpectralStepOptions& options,
              VectorXd* workspace_history) {
  SpectralStepSummary* summary = problem.summary;
  VectorXd& history = *workspace_history;
  if (history.size() != SpectralWorkspace::kHistorySize ||
      history[0] != static_cast<double>(problem.m()) ||
      history[1] != static_cast<double>(problem.n())) {
    history.resize(SpectralWorkspace::kHistorySize);
    history << static_cast<double>(problem.m()),
        static_cast<double>(problem.n()), 0.0;
  }
  double& num_svd_steps = history[2];
  const auto take = [&](SpectralRoute route) {
    return TakeRoute(problem, route, options.memory_limit);
  };
  if (num_svd_steps > 0.0) {
    num_svd_steps -= 1.0;
    return take(SpectralRoute::kSvd);
  }
  std::string reason;
  if (take(SpectralRoute::kGram)) {
    const Violation violation = ViolationBy(*summary, options);
    if (violation.option == nullptr) return true;
    reason = violation.reason;
  } else {
    reason = "gram: " + summary->message;
    // An SVD would find the same, or not fit into memory.
    if (!CheckJacobianFinite(problem.J, &summary->message)) return false;
  }
  // If the SVD fails too, its message matters more than the reason.
  if (!take(SpectralRoute::kSvd)) return false;
  num_svd_steps = kSvdSteps;
  summary->message = reason;
  return true;
}

bool CheckCovectorFinite(const JacobianOperator& J,
                         const VectorXd& g,
                         std::string* message) {
  for (int row = 0; row < g.size(); ++row) {
    if (!std::isfinite(g[row])) {
      *message =
          fmt::format("g is not finite: {} is {}", J.RowName(row), g[row]);
      return false;
    }
  }
  return true;
}

}  // namespace

double JumpOf(const SpectralFilter& filter) {
  if (filter.tau > 0.0) return filter.clamp ? 0.0 : filter.tau;
  return filter.IsDamped() || filter.kappa < 0.0 ? -1.0 : 0.0;
}

void SummarizeSpectrum(const SpectralProblem& problem,
                       const VectorXd& s,
                       double s_max,
                       int power,
                       double resolution) {
  const SpectralFilter& filter = problem.filter;
  SpectralStepSummary* summary = problem.summary;
  summary->s_max = s_max;
  const double jump = JumpOf(filter);
  summary->threshold_resolution =
      jump < 0.0 ? 0.0 : resolution / (power * std::pow(jump, power));
  for (const double value : s) {
    if (filter.Keeps(value, s_max)) {
      summary->s_min_kept =
          summary->rank == 0 ? value : std::min(summary->s_min_kept, value);
      ++summary->rank;
    }
    const double distance =
        std::abs(std::pow(value / s_max, power) - std::pow(jump, power));
    if (jump >= 0.0 && distance <= resolution) ++summary->num_undecided;
  }
}

bool CheckJacobianFinite(const JacobianOperator& J, std::string* message) {
  // A row is finite if its product with tiny numbers is.
  VectorXd product;
  J.Times(VectorXd::Constant(J.cols(), std::numeric_limits<double>::min()),
          &product);
  for (int row = 0; row < product.size(); ++row) {
    if (!std::isfinite(product[row])) {
      *message = "J is not finite: " + J.RowName(row);
      return false;
    }
  }
  return true;
}

SpectralStepOptions SpectralStepOptions::ForTraining() {
  SpectralStepOptions options;
  options.tolerance = 1e-2;
  options.threshold_tolerance = 0.25;
  return options;
}

SpectralWorkspace::SpectralWorkspace()
    : buffers_(std::make_unique<SpectralBuffers>()) {}
SpectralWorkspace::~SpectralWorkspace() = default;
SpectralWorkspace::SpectralWorkspace(SpectralWorkspace&&) noexcept = default;
SpectralWorkspace& SpectralWorkspace::operator=(SpectralWorkspace&&) noexcept =
    default;

const char* SpectralRouteName(SpectralRoute route) {
  constexpr const char* kNames[] = {"auto", "gram", "svd", "gradient"};
  return kNames[static_cast<int>(route)];
}

double SpectralStepBytes(SpectralRoute route, Index m, Index n, int num_ranks) {
  const auto rows = static_cast<double>(m);
  const auto cols = static_cast<double>(n);
  const double size = std::min(rows, cols);
  constexpr double kDouble = sizeof(double);
  switch (route) {
    case SpectralRoute::kGram:
      // The Gram matrix, the buffers of its reduction and function, and for
      // J^T J a dense J and, of ranks, the part that they sum.
      return kDouble * size * size / num_ranks + 800.0 * size +
             Tridiagonalization::Bytes(size) +
             (cols < rows ? kDouble * rows * cols / num_ranks : 0.0) +
             (cols < rows && num_ranks > 1 ? kDouble * size * size : 0.0);
    case SpectralRoute::kSvd:
      return kDouble *
             ((cols > rows ? 3.0 : 2.0) * rows * cols + 7.0 * size * size);
    case SpectralRoute::kGradient:
      return kDouble * cols;
    case SpectralRoute::kAuto:
      break;
  }
  LOG(FATAL) << "auto is no single route.";
  return 0.0;
}

bool SpectralStep(const JacobianOperator& J,
                  const VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  SpectralWorkspace* workspace,
                  VectorXd* d,
                  SpectralStepSummary* summary) {
  CHECK_EQ(g.size(), J.rows());
  CHECK_GT(J.rows(), 0);
  CHECK_GT(J.cols(), 0);
  CHECK_GT(options.tolerance, 0.0);
  std::string invalid;
  CHECK(filter.IsValid(&invalid)) << invalid;
  *summary = SpectralStepSummary();
  if (!CheckCovectorFinite(J, g, &summary->message)) return false;
  const SpectralProblem problem{
      J, g, filter, &workspace->buffers(), d, summary};
  if (options.route == SpectralRoute::kAuto && !filter.IsGradientDescent()) {
    return AutoStep(problem, options, &workspace->history);
  }
  const SpectralRoute route = options.route == SpectralRoute::kAuto
                                  ? SpectralRoute::kGradient
                                  : options.route;
  if (!TakeRoute(problem, route, options.memory_limit)) return false;
  if (route != SpectralRoute::kGram) return true;
  const Violation violation = ViolationBy(*summary, options);
  if (violation.option == nullptr) return true;
  summary->message =
      fmt::format("route {}; take route auto or svd, or a larger {}",
                  violation.reason,
                  violation.option);
  return false;
}

bool SpectralStep(const JacobianOperator& J,
                  const VectorXd& g,
                  const SpectralFilter& filter,
                  const SpectralStepOptions& options,
                  VectorXd* d,
                  SpectralStepSummary* summary) {
  SpectralWorkspace workspace;
  return SpectralStep(J, g, filter, options, &workspace, d, summary);
}

}  // namespace invgrad
