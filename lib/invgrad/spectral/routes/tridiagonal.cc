#include "invgrad/spectral/routes/tridiagonal.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Shifts are handled in groups of one vector, two groups at a time, which hides
// the latency of the divisions.
constexpr int kLanes = simd::kPack;
constexpr int kGroups = 2;
constexpr int kShifts = kGroups * kLanes;
// Counting needs fewer registers per row, so it uses more groups.
constexpr int kCountGroups = 4;
constexpr int kCountShifts = kCountGroups * kLanes;

using Lanes = simd::Pack;
typedef std::int64_t Mask __attribute__((vector_size(32), aligned(8)));

// Replaces a zero pivot: this changes the shift by much less than a rounding
// error.
constexpr double kSmallestPivot = 1e-290;

INVGRAD_INLINE inline void CountShifts(Index size,
                                       const double* diagonal,
                                       const double* squared_off_diagonal,
                                       const Lanes* shifts,
                                       Mask* counts) {
  const Lanes zero = {};
  Lanes pivot[kCountGroups];
  Mask count[kCountGroups] = {};
  for (Lanes& group : pivot) group = zero + 1.0;
  for (Index i = 0; i < size; ++i) {
    for (int k = 0; k < kCountGroups; ++k) {
      const Lanes next =
          (diagonal[i] - shifts[k]) - squared_off_diagonal[i] / pivot[k];
      const Mask tiny = (next < kSmallestPivot) & (next > -kSmallestPivot);
      pivot[k] = tiny ? zero - kSmallestPivot : next;
      count[k] -= pivot[k] < 0.0;
    }
  }
  for (int k = 0; k < kCountGroups; ++k) counts[k] = count[k];
}

struct Complex {
  Lanes re, im;
};
struct ResolventLanes {
  Complex z, c;
};

INVGRAD_INLINE inline Complex Select(const Mask& first,
                                     const Complex& a,
                                     const Complex& b) {
  return {first ? a.re : b.re, first ? a.im : b.im};
}
INVGRAD_INLINE inline Complex Product(const Complex& a, const Complex& b) {
  return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
// a - b c.
INVGRAD_INLINE inline Complex MinusProduct(const Complex& a,
                                           const Complex& b,
                                           const Complex& c) {
  return {a.re - b.re * c.re + b.im * c.im, a.im - b.re * c.im - b.im * c.re};
}

// A row of the triangular factor of T - z: the inverse pivot, the two entries
// right of it, and what the elimination of the row below took.
struct FactorRow {
  Complex inverse_pivot;
  Complex right;
  Lanes second;  // real
  Complex multiplier;
  Mask swapped;
  Complex x;  // the right-hand side, then the solution
};

// The row before pivoting: (d, u) and its right-hand side r.
struct OpenRow {
  Complex d, u, r;
};

// One step of Gaussian elimination with partial pivoting; the row below is
// (e, a - z, f) with the right-hand side h.
INVGRAD_INLINE inline void Eliminate(double e,
                                     double a,
                                     double f,
                                     double h,
                                     const Complex& z,
                                     OpenRow* open,
                                     FactorRow* row) {
  const Lanes zero = {};
  const Complex below = {zero + e, zero};
  const Lanes f_lanes = zero + f;
  const Complex diagonal = {a - z.re, -z.im};
  const Complex d = open->d;
  const Lanes squared_d = d.re * d.re + d.im * d.im;
  const Lanes squared_e = below.re * below.re;
  const Mask swap = squared_d < squared_e;
  const Lanes scale = 1.0 / (swap ? squared_e : squared_d);
  row->inverse_pivot = {(swap ? below.re : d.re) * scale,
                        (swap ? zero : -d.im) * scale};
  row->right = Select(swap, diagonal, open->u);
  row->second = swap ? f_lanes : zero;
  row->multiplier = Product(Select(swap, d, below), row->inverse_pivot);
  row->swapped = swap;
  const Complex h_lanes = {zero + h, zero};
  row->x = Select(swap, h_lanes, open->r);
  const Complex l = row->multiplier;
  open->d = MinusProduct(Select(swap, open->u, diagonal), l, row->right);
  open->u = {(swap ? zero : f_lanes) - l.re * row->second, -l.im * row->second};
  open->r = MinusProduct(Select(swap, open->r, h_lanes), l, row->x);
}

// Back substitution: y += sign Im[c x], summed over the shifts.
INVGRAD_INLINE inline void Substitute(Index size,
                                      const ResolventLanes* lanes,
                                      double sign,
                                      FactorRow* rows,
                                      double* y) {
  // The solution in the two rows below.
  Complex x1[kGroups] = {};
  Complex x2[kGroups] = {};
  for (Index i = size - 1; i >= 0; --i) {
    Lanes sum = {};
    for (int k = 0; k < kGroups; ++k) {
      FactorRow& row = rows[kGroups * i + k];
      Complex b = MinusProduct(row.x, row.right, x1[k]);
      b = {b.re - row.second * x2[k].re, b.im - row.second * x2[k].im};
      x2[k] = x1[k];
      x1[k] = row.x = Product(row.inverse_pivot, b);
      const Complex& c = lanes[k].c;
      sum += c.re * x1[k].im + c.im * x1[k].re;
    }
    y[i] += sign * simd::Sum(sum);
  }
}

// x = (T - z)^-1 h in rows[i].x; y -= Im[c x], summed over the shifts. The rows
// of the two groups alternate. a and e have a zero after their end.
INVGRAD_INLINE inline void Solve(Index size,
                                 const double* a,
                                 const double* e,
                                 const double* h,
                                 const ResolventLanes* lanes,
                                 FactorRow* rows,
                                 double* y) {
  const Lanes zero = {};
  OpenRow open[kGroups];
  for (int k = 0; k < kGroups; ++k) {
    open[k] = {{a[0] - lanes[k].z.re, -lanes[k].z.im},
               {zero + e[0], zero},
               {zero + h[0], zero}};
  }
  for (Index i = 0; i < size; ++i) {
    for (int k = 0; k < kGroups; ++k) {
      Eliminate(e[i],
                a[i + 1],
                e[i + 1],
                i + 1 < size ? h[i + 1] : 0.0,
                lanes[k].z,
                &open[k],
                &rows[kGroups * i + k]);
    }
  }
  Substitute(size, lanes, -1.0, rows, y);
}

// After Solve: the change of y by T -> T + E, to first order,
//   d(T - z)^-1 h = -(T - z)^-1 E x,
// for each E = u_p v_p^T + v_p u_p^T; `uv` holds u_0, v_0, u_1, ... row by row,
// `changes` the results one after the other.
INVGRAD_INLINE inline void Perturb(Index size,
                                   const double* uv,
                                   const ResolventLanes* lanes,
                                   FactorRow* rows,
                                   double* changes) {
  constexpr int kVectors = 2 * Tridiagonal::kNumPerturbations;
  const Lanes zero = {};
  // products[k][q] = (the partner of vector q) . x of group k.
  Complex products[kGroups][kVectors] = {};
  for (Index i = 0; i < size; ++i) {
    const double* signs = uv + kVectors * i;
    for (int k = 0; k < kGroups; ++k) {
      const Complex& x = rows[kGroups * i + k].x;
      for (int q = 0; q < kVectors; ++q) {
        products[k][q].re += signs[q ^ 1] * x.re;
        products[k][q].im += signs[q ^ 1] * x.im;
      }
    }
  }
  for (int p = 0; p < Tridiagonal::kNumPerturbations; ++p) {
    // Entry i of E x; zero after the end.
    const auto product = [&](Index i, int k) INVGRAD_INLINE {
      if (i == size) return Complex{zero, zero};
      const double u = uv[kVectors * i + 2 * p];
      const double v = uv[kVectors * i + 2 * p + 1];
      const Complex& vx = products[k][2 * p];
      const Complex& ux = products[k][2 * p + 1];
      return Complex{u * vx.re + v * ux.re, u * vx.im + v * ux.im};
    };
    Complex r[kGroups];
    for (int k = 0; k < kGroups; ++k) r[k] = product(0, k);
    for (Index i = 0; i < size; ++i) {
      for (int k = 0; k < kGroups; ++k) {
        FactorRow& row = rows[kGroups * i + k];
        const Complex next = product(i + 1, k);
        row.x = Select(row.swapped, next, r[k]);
        r[k] = MinusProduct(
            Select(row.swapped, r[k], next), row.multiplier, row.x);
      }
    }
    Substitute(size, lanes, 1.0, rows, changes + p * size);
  }
}

}  // namespace

void Tridiagonal::Set(const VectorXd& diagonal, const VectorXd& off_diagonal) {
  const Index m = diagonal.size();
  CHECK_GT(m, 0);
  CHECK_EQ(off_diagonal.size(), m - 1);
  size_ = static_cast<int>(m);
  diagonal_.resize(m + 1);
  diagonal_.head(m) = diagonal;
  diagonal_[m] = 0.0;
  off_diagonal_.setZero(m + 1);
  off_diagonal_.head(m - 1) = off_diagonal;
  squared_off_diagonal_.resize(m);
  squared_off_diagonal_[0] = 0.0;
  squared_off_diagonal_.tail(m - 1) = off_diagonal.cwiseAbs2();
  lower_bound_ = std::numeric_limits<double>::infinity();
  upper_bound_ = -lower_bound_;
  for (Index i = 0; i < m; ++i) {
    const double radius = std::abs(off_diagonal_[i]) +
                          (i == 0 ? 0.0 : std::abs(off_diagonal_[i - 1]));
    lower_bound_ = std::min(lower_bound_, diagonal_[i] - radius);
    upper_bound_ = std::max(upper_bound_, diagonal_[i] + radius);
  }
}

void Tridiagonal::CountBelow(const double* shifts,
                             int num_shifts,
                             int* counts) const {
  Lanes group[kCountGroups];
  Mask group_counts[kCountGroups];
  for (int first = 0; first < num_shifts; first += kCountShifts) {
    const int count = std::min(kCountShifts, num_shifts - first);
    for (int k = 0; k < kCountShifts; ++k) {
      group[k / kLanes][k % kLanes] = shifts[first + std::min(k, count - 1)];
    }
    simd::Run([&]() INVGRAD_INLINE {
      CountShifts(size_,
                  diagonal_.data(),
                  squared_off_diagonal_.data(),
                  group,
                  group_counts);
    });
    for (int k = 0; k < count; ++k) {
      counts[first + k] =
          static_cast<int>(group_counts[k / kLanes][k % kLanes]);
    }
  }
}

double Tridiagonal::Eigenvalue(int index) const {
  const double radius =
      std::max(std::abs(lower_bound_), std::abs(upper_bound_));
  return Eigenvalue(index,
                    lower_bound_,
                    upper_bound_,
                    2.0 * std::numeric_limits<double>::epsilon() * radius);
}

double Tridiagonal::Eigenvalue(int index,
                               double low,
                               double high,
                               double tolerance) const {
  CHECK_GE(index, 0);
  CHECK_LT(index, size_);
  constexpr int kSections = kCountShifts + 1;
  constexpr int kMaxPasses = 40;  // NaN never converges
  double shifts[kCountShifts];
  int counts[kCountShifts];
  for (int pass = 0; pass < kMaxPasses && high - low > tolerance; ++pass) {
    for (int k = 1; k < kSections; ++k) {
      shifts[k - 1] = low + (high - low) * (static_cast<double>(k) / kSections);
    }
    CountBelow(shifts, kCountShifts, counts);
    for (int k = kSections - 1; k > 0; --k) {
      if (counts[k - 1] <= index) {
        low = shifts[k - 1];
        break;
      }
      high = shifts[k - 1];
    }
  }
  return 0.5 * (low + high);
}

void Tridiagonal::Times(const VectorXd& x, VectorXd* y) const {
  CHECK_EQ(x.size(), size_);
  *y = diagonal_.head(size_).cwiseProduct(x);
  const auto e = off_diagonal_.head(size_ - 1);
  y->head(size_ - 1) += e.cwiseProduct(x.tail(size_ - 1));
  y->tail(size_ - 1) += e.cwiseProduct(x.head(size_ - 1));
}

void Tridiagonal::ApplyResolvents(const std::vector<std::complex<double>>& z,
                                  const std::vector<std::complex<double>>& c,
                                  const VectorXd& h,
                                  VectorXd* y,
                                  const Perturbations* perturbations,
                                  Changes* changes) {
  CHECK_EQ(z.size(), c.size());
  CHECK_EQ(h.size(), size_);
  if (perturbations != nullptr) CHECK_EQ(perturbations->cols(), size_);
  auto* rows = reinterpret_cast<FactorRow*>(
      rows_.Reserve(kGroups * size_ * (sizeof(FactorRow) / sizeof(double))));
  y->setZero(size_);
  if (perturbations != nullptr) changes->setZero(size_, kNumPerturbations);
  for (size_t first = 0; first < z.size(); first += kShifts) {
    ResolventLanes lanes[kGroups];
    for (size_t k = 0; k < kShifts; ++k) {
      const bool padding = first + k >= z.size();
      const size_t j = padding ? z.size() - 1 : first + k;
      ResolventLanes& group = lanes[k / kLanes];
      const size_t lane = k % kLanes;
      group.z.re[lane] = z[j].real();
      group.z.im[lane] = z[j].imag();
      group.c.re[lane] = padding ? 0.0 : c[j].real();
      group.c.im[lane] = padding ? 0.0 : c[j].imag();
    }
    simd::Run([&]() INVGRAD_INLINE {
      Solve(size_,
            diagonal_.data(),
            off_diagonal_.data(),
            h.data(),
            lanes,
            rows,
            y->data());
      if (perturbations != nullptr) {
        Perturb(size_, perturbations->data(), lanes, rows, changes->data());
      }
    });
  }
  if (perturbations != nullptr) *changes /= std::sqrt(2.0);
}

}  // namespace invgrad
