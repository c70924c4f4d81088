#include "invgrad/spectral/spectral_step.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "glog/logging.h"
#include "invgrad/core/blas.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/step_error.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kRoundoff = std::numeric_limits<double>::epsilon();

// Smaller problems are slowed down by a second BLAS thread.
constexpr Index kSmallestThreaded = 1000;

// Golub-Kahan pays for large problems of which the filter keeps a small share:
// it takes 1.2 to 2 iterations a kept value, each of two products with J and a
// reorthogonalization.
constexpr Index kSmallestKrylov = 1000;
constexpr double kLargestKrylovShare = 1.0 / 12.0;

// Smaller Gram matrices are reduced sooner than some sparse factorizations.
constexpr Index kSmallestSparse = 500;

// From here on a matrix is larger than any machine, and its size may leave the
// range of int: for estimates of memory.
constexpr double kLargestSize = 1 << 24;

// A Gram matrix that was not accurate enough is tried again after this many
// steps.
constexpr int kStepsBetweenTries = 20;

bool RouteFits(const SpectralProblem& problem,
               SpectralRoute route,
               double memory_limit,
               std::string* message) {
  const double bytes = SpectralStepBytes(route, problem.m(), problem.n());
  // Before a message is composed: a step on warm memory allocates nothing.
  if (FitsInMemory(bytes, memory_limit)) return true;
  std::ostringstream who;
  who << "route " << SpectralRouteName(route) << " with J " << problem.m()
      << " x " << problem.n();
  return FitsInMemory(
      who.str(), {{"its matrices", bytes}}, memory_limit, message);
}

bool TakeRoute(const SpectralProblem& problem,
               SpectralRoute route,
               const SpectralStepOptions& options,
               SpectralWorkspace* workspace,
               VectorXd* d,
               SpectralStepSummary* summary) {
  *summary = SpectralStepSummary();
  summary->route = route;
  if (!RouteFits(problem, route, options.memory_limit, &summary->message)) {
    return false;
  }
  switch (route) {
    case SpectralRoute::kSvd:
      return SvdRoute(problem, workspace, d, summary);
    case SpectralRoute::kGram:
    case SpectralRoute::kParameterGram:
      return GramRoute(problem, route, workspace, d, summary);
    case SpectralRoute::kCascade:
      return CascadeRoute(
          problem, options.tolerance, false, workspace, d, summary);
    case SpectralRoute::kGolubKahan:
      return GolubKahanRoute(
          problem,
          options.tolerance,
          options.memory_limit > 0.0 ? options.memory_limit : MemoryLimit(),
          workspace,
          d,
          summary);
    case SpectralRoute::kCholesky:
      return CholeskyRoute(problem,
                           options.tolerance,
                           options.memory_limit,
                           workspace,
                           d,
                           summary);
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

// What a workspace remembers of the last step of the same shape.
class History {
 public:
  History(const SpectralProblem& problem,
          SpectralRoute cheapest,
          VectorXd* memory)
      : memory_(*memory) {
    if (memory_.size() == kSize && memory_[kRows] == problem.m() &&
        memory_[kCols] == problem.n()) {
      return;
    }
    memory_.resize(kSize);
    memory_[kRows] = problem.m();
    memory_[kCols] = problem.n();
    memory_[kRoute] = static_cast<double>(cheapest);
    memory_[kRank] = problem.m() + problem.n();
    memory_[kSteps] = 0.0;
    memory_[kKrylovSteps] = kStepsBetweenTries;
  }
  SpectralRoute route() const {
    return static_cast<SpectralRoute>(memory_[kRoute]);
  }
  double rank() const { return memory_[kRank]; }
  double steps_since_try() const { return memory_[kSteps]; }
  double steps_since_krylov_failed() const { return memory_[kKrylovSteps]; }
  void KrylovFailed() { memory_[kKrylovSteps] = 0.0; }

  // `tried`: the cheapest route was.
  void Remember(const SpectralStepSummary& summary, bool tried) {
    memory_[kRoute] = static_cast<double>(summary.route);
    memory_[kRank] = summary.rank;
    memory_[kSteps] = tried ? 0.0 : memory_[kSteps] + 1.0;
    memory_[kKrylovSteps] += 1.0;
  }

 private:
  enum { kRows, kCols, kRoute, kRank, kSteps, kKrylovSteps };
  static constexpr int kSize = SpectralWorkspace::kHistorySize;
  VectorXd& memory_;
};

// The routes from cheap to accurate, until one is accurate enough.
bool ClimbLadder(const SpectralProblem& problem,
                 const SpectralStepOptions& options,
                 SpectralWorkspace* workspace,
                 VectorXd* d,
                 SpectralStepSummary* summary) {
  const SpectralRoute gram = problem.m() <= problem.n()
                                 ? SpectralRoute::kGram
                                 : SpectralRoute::kParameterGram;
  History history(problem, gram, &workspace->history);
  SpectralRoute first = history.route();
  if (first == SpectralRoute::kGolubKahan ||
      first == SpectralRoute::kCholesky ||
      history.steps_since_try() >= kStepsBetweenTries) {
    first = gram;
  }
  std::string reasons;
  const auto is_accepted = [&](bool computed) {
    std::string reason;
    if (IsAccepted(computed, *summary, options, &reason)) {
      history.Remember(*summary, first == gram);
      summary->message = reasons;
      return true;
    }
    reasons += (reasons.empty() ? "" : "; ") + reason;
    return false;
  };
  const auto take = [&](SpectralRoute route) {
    return TakeRoute(problem, route, options, workspace, d, summary);
  };

  const Index size = std::min(problem.m(), problem.n());
  if (size >= kSmallestSparse && IsForCholesky(problem) &&
      is_accepted(take(SpectralRoute::kCholesky))) {
    return true;
  }
  if (size >= kSmallestKrylov && history.rank() <= kLargestKrylovShare * size &&
      JumpOf(problem.filter) > 0.0 &&
      is_accepted(take(SpectralRoute::kGolubKahan))) {
    return true;
  }
  if (first == gram && is_accepted(take(gram))) return true;
  // A dearer route would only find the same, or not fit into memory.
  if (first == gram && summary->s_max == 0.0 &&
      !CheckJacobianFinite(problem.J, &summary->message)) {
    return false;
  }
  if (GramIsReduced(problem) && first != SpectralRoute::kSvd) {
    const bool reduced =
        first == gram && summary->s_max > 0.0 &&
        workspace->reduction.method() == Tridiagonalization::Method::kOneStage;
    if (is_accepted(
            reduced
                ? CascadeRoute(
                      problem, options.tolerance, true, workspace, d, summary)
                : take(SpectralRoute::kCascade))) {
      return true;
    }
  }
  const bool success = take(SpectralRoute::kSvd);
  // What stopped the SVD matters more than why it was tried.
  if (success) {
    history.Remember(*summary, first == gram);
    summary->message = reasons;
  }
  return success;
}

}  // namespace

double JumpOf(const SpectralFilter& filter) {
  if (filter.tau > 0.0) return filter.clamp ? 0.0 : filter.tau;
  return filter.IsDamped() || filter.kappa < 0.0 ? -1.0 : 0.0;
}

double SvdResolution(Index m, Index n) {
  return 2.0 * kRoundoff * std::sqrt(static_cast<double>(m + n));
}

double GramResolution(Index size, Index other_size) {
  return 2.0 * kRoundoff * (size + std::sqrt(static_cast<double>(other_size)));
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

bool GolubKahanRoute(const SpectralProblem& problem,
                     double tolerance,
                     double memory_limit,
                     SpectralWorkspace* workspace,
                     VectorXd* d,
                     SpectralStepSummary* summary) {
  summary->route = SpectralRoute::kGolubKahan;
  GolubKahanOptions options;
  options.tolerance = tolerance;
  // The bases hold m + n numbers an iteration, and twice that while they grow.
  const double affordable =
      memory_limit / (2.0 * sizeof(double) * (problem.m() + problem.n()));
  options.max_iterations = static_cast<int>(std::clamp(
      affordable, 1.0, std::min(problem.m(), problem.n()) * 2.0 / 3.0 + 50.0));
  GolubKahanSummary result;
  const bool computed = GolubKahanStep(problem.J,
                                       problem.g,
                                       problem.filter,
                                       options,
                                       &workspace->golub_kahan,
                                       d,
                                       &result);
  summary->rank = result.rank;
  summary->s_max = result.s_max;
  summary->s_min_kept = result.s_min_kept;
  summary->estimated_error = result.estimated_error;
  summary->num_undecided = result.num_undecided;
  summary->message = result.message;
  return computed && result.converged;
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
    case SpectralRoute::kGolubKahan:
      return "golub_kahan";
    case SpectralRoute::kCholesky:
      return "cholesky";
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
    return kDouble * k * k + 800.0 * k +
           static_cast<double>(Tridiagonalization::Bytes(
               static_cast<int>(std::min(k, kLargestSize)), method));
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
    case SpectralRoute::kGolubKahan:
    case SpectralRoute::kCholesky:
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
  CHECK_GT(options.tolerance, 0.0);
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
