#include "invgrad/linalg/spectral_step.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>

#include "glog/logging.h"
#include "invgrad/linalg/blas.h"
#include "invgrad/linalg/finite.h"
#include "invgrad/linalg/spectral_routes.h"
#include "invgrad/linalg/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

// Smaller problems are slowed down by a second BLAS thread.
constexpr Index kSmallestThreaded = 1000;

// A Gram matrix that was not accurate enough is tried again after this many
// steps.
constexpr int kStepsBetweenTries = 20;

bool FitsInMemory(const SpectralProblem& problem,
                  SpectralRoute route,
                  const SpectralStepOptions& options,
                  std::string* message) {
  const double needed = SpectralStepBytes(route, problem.m(), problem.n());
  const double allowed =
      options.memory_limit > 0.0
          ? options.memory_limit
          : 0.75 * sysconf(_SC_PHYS_PAGES) * sysconf(_SC_PAGESIZE);
  if (needed <= allowed) return true;
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << "route "
       << SpectralRouteName(route) << " with J " << problem.m() << " x "
       << problem.n() << " needs " << needed * 1e-9 << " GB, allowed are "
       << allowed * 1e-9;
  *message = text.str();
  return false;
}

bool TakeRoute(const SpectralProblem& problem,
               SpectralRoute route,
               const SpectralStepOptions& options,
               SpectralWorkspace* workspace,
               VectorXd* d,
               SpectralStepSummary* summary) {
  *summary = SpectralStepSummary();
  summary->route = route;
  if (!FitsInMemory(problem, route, options, &summary->message)) return false;
  switch (route) {
    case SpectralRoute::kSvd:
      return SvdRoute(problem, workspace, d, summary);
    case SpectralRoute::kGram:
    case SpectralRoute::kParameterGram:
      return GramRoute(problem, route, workspace, d, summary);
    case SpectralRoute::kCascade:
      return CascadeRoute(problem, false, workspace, d, summary);
    case SpectralRoute::kGradient:
      return GradientRoute(problem, d, summary);
    case SpectralRoute::kAuto:
      break;
  }
  LOG(FATAL) << "kAuto is no route.";
  return false;
}

// Whether the answer may be kept; otherwise *reason says why not.
bool IsAccepted(bool computed,
                const SpectralStepSummary& summary,
                const SpectralStepOptions& options,
                std::string* reason) {
  std::ostringstream text;
  text << SpectralRouteName(summary.route) << ": ";
  if (!computed) {
    text << summary.message;
  } else if (summary.num_undecided > 0 &&
             summary.threshold_resolution > options.threshold_tolerance) {
    text << summary.num_undecided << " values undecided";
  } else if (!(summary.estimated_error <= options.tolerance)) {
    text << "estimated error " << summary.estimated_error << " > "
         << options.tolerance;
  } else {
    return true;
  }
  *reason = text.str();
  return false;
}

// The routes from cheap to accurate, until one is accurate enough.
bool ClimbLadder(const SpectralProblem& problem,
                 const SpectralStepOptions& options,
                 SpectralWorkspace* workspace,
                 VectorXd* d,
                 SpectralStepSummary* summary) {
  const SpectralRoute cheap = problem.m() <= problem.n()
                                  ? SpectralRoute::kGram
                                  : SpectralRoute::kParameterGram;
  // What the last step of this shape took, if that was not the cheapest.
  enum { kRows, kCols, kRoute, kSteps, kHistorySize };
  VectorXd& history = workspace->history;
  if (history.size() != kHistorySize || history[kRows] != problem.m() ||
      history[kCols] != problem.n()) {
    history.resize(kHistorySize);
    history << problem.m(), problem.n(), static_cast<double>(cheap), 0.0;
  }
  SpectralRoute first = static_cast<SpectralRoute>(history[kRoute]);
  if (history[kSteps] >= kStepsBetweenTries) first = cheap;

  std::string reasons;
  const auto is_accepted = [&](bool computed) {
    std::string reason;
    if (IsAccepted(computed, *summary, options, &reason)) return true;
    reasons += (reasons.empty() ? "" : "; ") + reason;
    return false;
  };
  const auto remember = [&](SpectralRoute route) {
    history[kRoute] = static_cast<double>(route);
    history[kSteps] = first == cheap ? 0.0 : history[kSteps] + 1.0;
  };
  const bool may_cascade = GramIsReduced(problem);
  if (first == cheap) {
    if (is_accepted(
            TakeRoute(problem, cheap, options, workspace, d, summary))) {
      remember(cheap);
      return true;
    }
  }
  if (may_cascade && first != SpectralRoute::kSvd) {
    const bool reduced =
        first == cheap && summary->s_max > 0.0 &&
        workspace->reduction.method() == Tridiagonalization::Method::kOneStage;
    if (is_accepted(reduced ? CascadeRoute(problem, true, workspace, d, summary)
                            : TakeRoute(problem,
                                        SpectralRoute::kCascade,
                                        options,
                                        workspace,
                                        d,
                                        summary))) {
      remember(SpectralRoute::kCascade);
      summary->message = reasons;
      return true;
    }
  }
  const bool success =
      TakeRoute(problem, SpectralRoute::kSvd, options, workspace, d, summary);
  remember(SpectralRoute::kSvd);
  // What stopped the SVD matters more than why it was tried.
  if (success) summary->message = reasons;
  return success;
}

}  // namespace

double JumpOf(const SpectralFilter& filter) {
  if (filter.tau > 0.0) return filter.clamp ? 0.0 : filter.tau;
  const bool vanishes =
      filter.kind == SpectralFilter::Kind::kLevenbergMarquardt
          ? filter.damping > 0.0 || filter.relative_damping > 0.0
          : filter.kappa < 0.0;
  return vanishes ? -1.0 : 0.0;
}

double SvdResolution(Index m, Index n) {
  return 2.0 * kEpsilon * std::sqrt(static_cast<double>(m + n));
}

double GramResolution(Index size, Index other_size) {
  return 2.0 * kEpsilon * (size + std::sqrt(static_cast<double>(other_size)));
}

void SummarizeSpectrum(const SpectralFilter& filter,
                       const VectorXd& s,
                       double s_max,
                       int power,
                       double resolution,
                       SpectralStepSummary* summary) {
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

bool GradientRoute(const SpectralProblem& problem,
                   VectorXd* d,
                   SpectralStepSummary* summary) {
  CHECK(problem.filter.IsGradientDescent())
      << "The gradient route only computes phi(s) = s.";
  problem.J.TransposeTimes(problem.g, d);
  summary->estimated_error = RoundingError();
  return d->allFinite() || (CheckJacobianFinite(problem.J, &summary->message) &&
                            CheckFinite("J^T g", *d, &summary->message));
}

const char* SpectralRouteName(SpectralRoute route) {
  switch (route) {
    case SpectralRoute::kAuto:
      return "auto";
    case SpectralRoute::kSvd:
      return "svd";
    case SpectralRoute::kGram:
      return "gram";
    case SpectralRoute::kParameterGram:
      return "parameter_gram";
    case SpectralRoute::kCascade:
      return "cascade";
    case SpectralRoute::kGradient:
      return "gradient";
  }
  return "unknown";
}

double SpectralStepBytes(SpectralRoute route, Index m, Index n) {
  const double rows = static_cast<double>(m);
  const double cols = static_cast<double>(n);
  const double size = std::min(rows, cols);
  constexpr double kDouble = sizeof(double);
  // A Gram matrix and the buffers of its reduction and function.
  const auto gram = [](double k, Tridiagonalization::Method method) {
    return kDouble * k * k + 700.0 * k +
           static_cast<double>(
               Tridiagonalization::Bytes(static_cast<int>(k), method));
  };
  switch (route) {
    case SpectralRoute::kSvd:
      return kDouble *
             ((cols > rows ? 2.0 : 1.0) * rows * cols + 7.0 * size * size);
    case SpectralRoute::kGram:
      return gram(rows, Tridiagonalization::Method::kAuto);
    case SpectralRoute::kParameterGram:
      return kDouble * rows * cols +
             gram(cols, Tridiagonalization::Method::kAuto);
    case SpectralRoute::kCascade:
      return gram(size, Tridiagonalization::Method::kOneStage) +
             (cols < rows ? kDouble * rows * cols : 0.0);
    case SpectralRoute::kGradient:
    case SpectralRoute::kAuto:
      break;
  }
  return kDouble * cols;
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
  std::string invalid;
  CHECK(filter.IsValid(&invalid)) << invalid;
  *summary = SpectralStepSummary();
  for (int row = 0; row < g.size(); ++row) {
    if (!std::isfinite(g[row])) {
      std::ostringstream message;
      message << "g is not finite: " << J.RowName(row) << " is " << g[row];
      summary->message = message.str();
      return false;
    }
  }
  const SpectralProblem problem{J, g, filter};
  const SingleBlasThread single(std::min(J.rows(), J.cols()) <
                                kSmallestThreaded);
  if (options.route != SpectralRoute::kAuto) {
    return TakeRoute(problem, options.route, options, workspace, d, summary);
  }
  if (filter.IsGradientDescent()) {
    return TakeRoute(
        problem, SpectralRoute::kGradient, options, workspace, d, summary);
  }
  return ClimbLadder(problem, options, workspace, d, summary);
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
