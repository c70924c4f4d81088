#include "invgrad/determined_step.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "Eigen/Cholesky"
#include "Eigen/Eigenvalues"
#include "fmt/core.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;

double DeterminedStepOptions::TauHigh() const {
  return tau_high == 0.0 ? std::min(std::sqrt(2.0) * tau, 1.0) : tau_high;
}

bool DeterminedStepOptions::IsValid(std::string* error) const {
  if (!(tau >= 1e-6 && tau < 1.0)) {
    *error = fmt::format("tau={} is out of range; allowed: [1e-6, 1)", tau);
    return false;
  }
  if (!(TauHigh() >= tau && TauHigh() <= 1.0)) {
    *error = fmt::format("tau_high={} is out of range; allowed: [tau, 1] or 0",
                         tau_high);
    return false;
  }
  for (const int size : group_sizes) {
    if (size <= 0) {
      *error = fmt::format("a group of {} unknowns", size);
      return false;
    }
  }
  return true;
}

double DeterminedStepOptions::TauForNormals(double sigma) {
  return std::clamp(2.0 * std::sqrt(3.0) * sigma, 1e-6, 0.99);
}

template <int kMaxSize>
BasicDeterminedStep<kMaxSize>::BasicDeterminedStep(
    const DeterminedStepOptions& options)
    : options_(options) {
  std::string error;
  CHECK(options_.IsValid(&error)) << error;
}

template <int kMaxSize>
void BasicDeterminedStep<kMaxSize>::FindScales(
    const Eigen::Ref<const Eigen::MatrixXd>& H) {
  const auto mean_length = [](double sum, int size) {
    return sum > 0.0 ? std::sqrt(sum / size) : 1.0;
  };
  scales_.resize(H.rows());
  if (options_.group_sizes.empty()) {
    for (Index i = 0; i < H.rows(); ++i) scales_[i] = mean_length(H(i, i), 1);
    return;
  }
  Index begin = 0;
  for (const int size : options_.group_sizes) {
    const double sum = H.diagonal().segment(begin, size).sum();
    scales_.segment(begin, size).setConstant(mean_length(sum, size));
    begin += size;
  }
}

template <int kMaxSize>
void BasicDeterminedStep<kMaxSize>::AddNoiseOfNormal(
    const Eigen::Vector3d& p, double sigma, Eigen::Matrix<double, 6, 6>* W) {
  Eigen::Matrix<double, 6, 3> M;
  M.topRows<3>().setIdentity();
  M.bottomRows<3>() << 0.0, -p[2], p[1], p[2], 0.0, -p[0], -p[1], p[0], 0.0;
  *W += sigma * sigma * M * M.transpose();
}

template <int kMaxSize>
bool BasicDeterminedStep<kMaxSize>::FindTransform(
    const Eigen::Ref<const Eigen::MatrixXd>& H, std::string* error) {
  const Index n = H.rows();
  FindScales(H);
  if (noise_.size() == 0) {
    transform_ = scales_.cwiseInverse().asDiagonal();
    inverse_transform_ = scales_.asDiagonal();
    return true;
  }
  CHECK_EQ(noise_.rows(), n) << "the noise has another size";
  // Directions without noise have that of rounding errors.
  constexpr double kRounding = 1e-12;
  Matrix W = noise_.template selfadjointView<Eigen::Lower>();
  W.diagonal() += kRounding * scales_.cwiseAbs2();
  const Eigen::LLT<Matrix> factor(W);
  if (!W.allFinite() || factor.info() != Eigen::Success) {
    *error = "the noise is not finite, or not positive semidefinite";
    return false;
  }
  inverse_transform_ = factor.matrixU();
  transform_.setIdentity(n, n);
  factor.matrixU().solveInPlace(transform_);
  return true;
}

template <int kMaxSize>
int BasicDeterminedStep<kMaxSize>::LeaveAlone(int num_low,
                                              int num_band,
                                              Matrix* basis) const {
  if (num_band == 0 || left_alone_.cols() == 0 ||
      left_alone_.rows() != basis->rows()) {
    return num_low;
  }
  // B L^-T spans the memory in scaled unknowns, with orthonormal columns.
  Matrix B = inverse_transform_ * left_alone_;
  B.colwise().normalize();
  const Matrix BtB = B.transpose() * B;
  const Eigen::LLT<Matrix> factor(BtB);
  if (factor.info() != Eigen::Success) return num_low;
  const Matrix band = basis->middleCols(num_low, num_band);
  // L^-1 B^T band; the squares of its singular values are those of the cosines.
  Matrix cosines = B.transpose() * band;
  factor.matrixL().solveInPlace(cosines);
  const Matrix squares = cosines.transpose() * cosines;
  const Eigen::SelfAdjointEigenSolver<Matrix> principal(squares);
  // The largest cosines first.
  const Matrix descending = principal.eigenvectors().rowwise().reverse();
  const Matrix rotated = band * descending;
  basis->middleCols(num_low, num_band) = rotated;
  return num_low +
         static_cast<int>((principal.eigenvalues().array() > 0.5).count());
}

template <int kMaxSize>
bool BasicDeterminedStep<kMaxSize>::Compute(
    const Eigen::Ref<const Eigen::MatrixXd>& H,
    const Eigen::Ref<const Eigen::VectorXd>& gradient,
    Vector* step,
    std::string* error) {
  const Index n = H.rows();
  CHECK(step != nullptr && error != nullptr);
  CHECK(n == H.cols() && n == gradient.size())
      << "H and the gradient have different sizes.";
  CHECK(kMaxSize == Eigen::Dynamic || n <= kMaxSize)
      << n << " unknowns; use DeterminedStepOfAnySize.";
  CHECK(options_.group_sizes.empty() ||
        std::accumulate(options_.group_sizes.begin(),
                        options_.group_sizes.end(),
                        Index{0}) == n)
      << "The sizes of the groups do not add up to " << n << ".";
  step->setZero(n);
  Matrix scaled = H.template selfadjointView<Eigen::Lower>();
  if (!scaled.allFinite() || !gradient.allFinite()) {
    *error = "the Gram matrix or the gradient is not finite";
    return false;
  }
  if (n == 0) {
    left_alone_.resize(0, 0);
    singular_values_.resize(0);
    left_alone_values_.resize(0);
    return true;
  }
  if (!FindTransform(H, error)) return false;
  const Matrix half_scaled = transform_.transpose() * scaled;
  scaled = half_scaled * transform_;
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(scaled);
  if (eigen.info() != Eigen::Success || !eigen.eigenvalues().allFinite()) {
    *error = "the eigenvalues of the scaled Gram matrix did not converge";
    return false;
  }
  // Of rounding, the smallest may be negative.
  const Vector squares = eigen.eigenvalues().cwiseMax(0.0);
  const double largest = squares[n - 1];
  const double scale = largest > 0.0 ? 1.0 / largest : 0.0;
  singular_values_ = (squares * scale).cwiseSqrt();
  // Of the squares: twice the noise, or tau s_max.
  const double low =
      noise_.size() > 0 ? 4.0 : options_.tau * options_.tau * largest;
  const double ratio = options_.TauHigh() / options_.tau;
  const int num_low = static_cast<int>((squares.array() <= low).count());
  const int num_band =
      static_cast<int>((squares.array() <= ratio * ratio * low).count()) -
      num_low;
  Matrix basis = eigen.eigenvectors();
  const int num_left_alone = LeaveAlone(num_low, num_band, &basis);

  const Matrix kept = basis.rightCols(n - num_left_alone);
  const Matrix kept_scaled = kept.transpose() * scaled;
  const Matrix curvature = kept_scaled * kept;
  const Vector scaled_gradient = transform_.transpose() * gradient;
  const Vector slope = kept.transpose() * scaled_gradient;
  if (kept.cols() > 0) {
    const Vector solution = curvature.ldlt().solve(slope);
    const Vector scaled_step = kept * solution;
    *step = -transform_ * scaled_step;
  }

  left_alone_ = basis.leftCols(num_left_alone);
  left_alone_values_.resize(num_left_alone);
  for (int i = 0; i < num_left_alone; ++i) {
    const Vector v = left_alone_.col(i);
    const Vector scaled_v = scaled * v;
    left_alone_values_[i] = std::sqrt(std::max(v.dot(scaled_v) * scale, 0.0));
    const Vector motion = transform_ * v;
    Index at = 0;
    motion.cwiseAbs().maxCoeff(&at);
    left_alone_.col(i) = motion / motion[at];
  }
  return true;
}

template <int kMaxSize>
std::string BasicDeterminedStep<kMaxSize>::Report() const {
  const Index n = singular_values_.size();
  if (num_left_alone() == 0) return fmt::format("all {} determined", n);
  constexpr int kMaxDirections = 3;
  constexpr int kMaxEntries = 4;
  constexpr double kSmallEntry = 0.01;
  std::string report = fmt::format("{} of {} left alone", num_left_alone(), n);
  for (int i = 0; i < std::min(num_left_alone(), kMaxDirections); ++i) {
    report += fmt::format(
        "{} s/s_max {:.2g}:", i == 0 ? ":" : ";", left_alone_values_[i]);
    std::vector<Index> entries(n);
    std::iota(entries.begin(), entries.end(), Index{0});
    const auto size = [&](Index row) { return std::abs(left_alone_(row, i)); };
    std::stable_sort(entries.begin(), entries.end(), [&](Index a, Index b) {
      return size(a) > size(b);
    });
    for (Index k = 0; k < std::min<Index>(n, kMaxEntries); ++k) {
      if (size(entries[k]) < kSmallEntry) break;
      report +=
          fmt::format(" {:+.2g} [{}]", left_alone_(entries[k], i), entries[k]);
    }
  }
  if (num_left_alone() > kMaxDirections) report += "; ...";
  return report;
}

template class BasicDeterminedStep<6>;
template class BasicDeterminedStep<Eigen::Dynamic>;

}  // namespace invgrad
