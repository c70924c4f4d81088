#include <algorithm>

#include "invgrad/internal/logging.h"
#include "invgrad/spectral/routes/householder.h"
#include "invgrad/spectral/routes/two_stage.h"

namespace invgrad {
namespace {

using Eigen::Index;
using simd::At;
using simd::kPack;
using simd::Pack;

constexpr int b = kBandwidth;
static_assert(b % kPack == 0);

// Column j of the band lies at j (kStride + 1), its diagonal first: b rows of
// the band and b - 1 of the bulge follow. The difference of two columns'
// addresses is kStride for the same row, so that squares are ordinary matrices.
constexpr Index kStride = 2 * b;

// The band is continued by zeros after row m - 1, and all squares are whole.
Index BandSize(int m) { return (m + 2 * b) * (kStride + 1); }

// The number of reflectors of sweep s: those that start above row m - 1.
int NumReflectors(int m, int s) { return s + 3 > m ? 0 : (m - 3 - s) / b + 1; }

Index TotalReflectors(int m) {
  Index total = 0;
  for (int s = 0; s + 2 < m; ++s) total += NumReflectors(m, s);
  return total;
}

// 1 in the lanes from `lane` on, 0 in those before it: for packs that the
// diagonal crosses. Entries above the diagonal belong to the end of an earlier
// column and must not change.
INVGRAD_INLINE inline const double* From(int lane) {
  static constexpr double kStep[2 * kPack] = {0, 0, 0, 0, 1, 1, 1, 1};
  return kStep + kPack - lane;
}

// The columns j, ..., j + kPack - 1.
struct Columns {
  INVGRAD_INLINE Columns(double* A, int j) {
    for (int k = 0; k < kPack; ++k) a[k] = A + (j + k) * kStride;
  }
  double* a[kPack];
};

// w = [A; C] v for the b x b symmetric A, of which the lower triangle is read,
// and C below it.
INVGRAD_INLINE inline void Multiply(double* A, const double* v, double* w) {
  for (int i = 0; i < 2 * b; i += kPack) At(w + i).v = Pack{};
  for (int j = 0; j < b; j += kPack) {
    const Columns column(A, j);
    Pack v_j[kPack];
    Pack sum[kPack] = {};
    for (int k = 0; k < kPack; ++k) v_j[k] = Pack{} + v[j + k];
    for (int i = j + kPack; i < b; i += kPack) {
      const Pack v_i = At(v + i).v;
      Pack w_i = At(w + i).v;
      for (int k = 0; k < kPack; ++k) {
        const Pack a = At(column.a[k] + i).v;
        w_i += a * v_j[k];
        sum[k] += a * v_i;
      }
      At(w + i).v = w_i;
    }
    for (int i = b; i < 2 * b; i += kPack) {
      Pack w_i = At(w + i).v;
      for (int k = 0; k < kPack; ++k) w_i += At(column.a[k] + i).v * v_j[k];
      At(w + i).v = w_i;
    }
    // The square on the diagonal.
    const Pack v_i = At(v + j).v;
    Pack w_i = At(w + j).v;
    for (int k = 0; k < kPack; ++k) {
      const Pack a = At(column.a[k] + j).v;
      w_i += a * (At(From(k)).v * v_j[k]);
      sum[k] += a * (At(From(k + 1)).v * v_i);
    }
    for (int k = 0; k < kPack; ++k) w_i[k] += simd::Sum(sum[k]);
    At(w + j).v = w_i;
  }
}

// A -= v w^T + w v^T, the lower triangle, and C = H (C - w v^T) with
// H = I - tau u u^T and the last b entries of w.
INVGRAD_INLINE inline void Update(
    double* A, const double* v, const double* w, const double* u, double tau) {
  const double u_w = simd::Dot(b, u, w + b);
  for (int j = 0; j < b; j += kPack) {
    const Columns column(A, j);
    Pack sum[kPack] = {};
    for (int i = b; i < 2 * b; i += kPack) {
      const Pack u_i = At(u + i - b).v;
      for (int k = 0; k < kPack; ++k) sum[k] += At(column.a[k] + i).v * u_i;
    }
    Pack v_j[kPack];
    Pack w_j[kPack];
    Pack z_j[kPack];
    for (int k = 0; k < kPack; ++k) {
      v_j[k] = Pack{} + v[j + k];
      w_j[k] = Pack{} + w[j + k];
      z_j[k] = Pack{} + tau * (simd::Sum(sum[k]) - u_w * v[j + k]);
      // The square on the diagonal.
      simd::Slot& a = At(column.a[k] + j);
      const Pack mask = At(From(k)).v;
      a.v = a.v - At(v + j).v * (mask * w_j[k]) - At(w + j).v * (mask * v_j[k]);
    }
    for (int i = j + kPack; i < b; i += kPack) {
      const Pack v_i = At(v + i).v;
      const Pack w_i = At(w + i).v;
      for (int k = 0; k < kPack; ++k) {
        simd::Slot& a = At(column.a[k] + i);
        a.v = a.v - v_i * w_j[k] - w_i * v_j[k];
      }
    }
    for (int i = b; i < 2 * b; i += kPack) {
      const Pack u_i = At(u + i - b).v;
      const Pack w_i = At(w + i).v;
      for (int k = 0; k < kPack; ++k) {
        simd::Slot& a = At(column.a[k] + i);
        a.v = a.v - u_i * z_j[k] - w_i * v_j[k];
      }
    }
  }
}

// The result of a reflector on the column that defines it.
INVGRAD_INLINE inline void ClearColumn(double beta, double* column) {
  std::fill(column, column + b, 0.0);
  column[0] = beta;
}

// One step of a sweep, at the square that starts at `row`: applies the
// reflector (v, tau) from both sides to the triangle A on the diagonal, and
// from the right to the square C below it; makes the reflector (u, tau_u) that
// clears C's first column, and applies it from the left.
INVGRAD_INLINE inline void ChaseOneSquare(double* band,
                                          int row,
                                          const double* v,
                                          double tau,
                                          double* u,
                                          double* tau_u) {
  double* A = band + row * (kStride + 1);
  alignas(64) double w[2 * b];
  Multiply(A, v, w);
  const double c = 0.5 * tau * tau * simd::Dot(b, w, v);
  for (int i = 0; i < 2 * b; ++i) w[i] *= tau;
  for (int i = 0; i < b; ++i) w[i] -= c * v[i];
  for (int i = 0; i < b; ++i) u[i] = A[b + i] - w[b + i];
  const double beta = MakeReflector(b, u, tau_u);
  Update(A, v, w, u, *tau_u);
  ClearColumn(beta, A + b);
}

// The number of concurrent sweeps: eight squares of 2 b x b take 0.3 MB.
constexpr int kSweeps = 8;

INVGRAD_INLINE inline void Chase(int m,
                                 double* band,
                                 double* reflectors,
                                 double* tau) {
  // The start of the reflectors of each concurrent sweep, and one place for the
  // empty reflectors after the end of a sweep.
  Index first[kSweeps];
  double none[b];
  double tau_none;
  Index next = 0;
  for (int s0 = 0; s0 + 2 < m; s0 += kSweeps) {
    for (int g = 0; g < kSweeps; ++g) {
      first[g] = next;
      next += NumReflectors(m, s0 + g);
    }
    // Sweep s0 + g is g squares behind sweep s0.
    const int end = NumReflectors(m, s0) + kSweeps - 1;
    for (int time = 0; time < end; ++time) {
      for (int g = 0; g <= std::min(time, kSweeps - 1); ++g) {
        const int s = s0 + g;
        const int t = time - g;
        const int count = NumReflectors(m, s);
        if (t >= count) continue;
        const int row = s + 1 + t * b;
        double* u = reflectors + (first[g] + t) * b;
        double* tau_u = tau + first[g] + t;
        if (t == 0) {
          double* column = band + s * (kStride + 1) + 1;
          std::copy(column, column + b, u);
          ClearColumn(MakeReflector(b, u, tau_u), column);
        }
        const bool last = t + 1 == count;
        ChaseOneSquare(band,
                       row,
                       u,
                       *tau_u,
                       last ? none : u + b,
                       last ? &tau_none : tau_u + 1);
      }
    }
  }
}

INVGRAD_INLINE inline void Apply(int m,
                                 const double* reflectors,
                                 const double* tau,
                                 bool transpose,
                                 double* x) {
  Index first = transpose ? 0 : TotalReflectors(m);
  for (int k = 0; k + 2 < m; ++k) {
    const int s = transpose ? k : m - 3 - k;
    const int count = NumReflectors(m, s);
    if (!transpose) first -= count;
    // The reflectors of one sweep have no row in common.
    for (int t = 0; t < count; ++t) {
      const int row = s + 1 + t * b;
      ApplyReflector(b, reflectors + (first + t) * b, tau[first + t], x + row);
    }
    if (transpose) first += count;
  }
}

}  // namespace

void BulgeChase::Compute(const ColumnStrips& strips,
                         const Eigen::MatrixXd& K,
                         Eigen::VectorXd* diagonal,
                         Eigen::VectorXd* off_diagonal) {
  CHECK_EQ(K.rows(), strips.size());
  CHECK_EQ(K.cols(), strips.num_local());
  const int m = static_cast<int>(K.rows());
  size_ = m;
  communicator_ = strips.communicator();
  diagonal->resize(m);
  off_diagonal->resize(std::max(0, m - 1));
  double* band = band_.Reserve(BandSize(m));
  std::fill(band, band + BandSize(m), 0.0);
  strips.ForOwn([&](Index first, Index count) {
    for (Index j = first; j < first + count; ++j) {
      const double* k = K.data() + strips.Local(j) * m;
      std::copy(
          k + j, k + std::min<Index>(m, j + b + 1), band + j * (kStride + 1));
    }
  });
  if (communicator_ != nullptr) communicator_->Sum(band, BandSize(m));
  if (strips.rank() == 0) {
    double* reflectors = reflectors_.Reserve(TotalReflectors(m) * b);
    double* tau = tau_.Reserve(TotalReflectors(m));
    padded_x_.Reserve(m + b);
    simd::Run([&]() INVGRAD_INLINE { Chase(m, band, reflectors, tau); });
    for (int j = 0; j < m; ++j) {
      (*diagonal)[j] = band[j * (kStride + 1)];
      if (j + 1 < m) (*off_diagonal)[j] = band[j * (kStride + 1) + 1];
    }
  }
  if (communicator_ != nullptr) {
    communicator_->Broadcast(0, diagonal->data(), m);
    communicator_->Broadcast(0, off_diagonal->data(), m - 1);
  }
}

void BulgeChase::ApplyQ(bool transpose, Eigen::VectorXd* x) const {
  CHECK_EQ(x->size(), size_);
  if (communicator_ != nullptr && communicator_->rank() > 0) {
    communicator_->Broadcast(0, x->data(), size_);
    return;
  }
  // Reflectors extend past the end, with zeros.
  double* padded = padded_x_.Reserve(size_ + b);
  std::copy(x->data(), x->data() + size_, padded);
  std::fill(padded + size_, padded + size_ + b, 0.0);
  simd::Run([&]() INVGRAD_INLINE {
    Apply(size_, reflectors_.data(), tau_.data(), transpose, padded);
  });
  std::copy(padded, padded + size_, x->data());
  if (communicator_ != nullptr) communicator_->Broadcast(0, x->data(), size_);
}

}  // namespace invgrad
