#include "invgrad/linalg/bulge_chase.h"

#include <algorithm>

#include "glog/logging.h"
#include "invgrad/linalg/householder.h"
#include "invgrad/linalg/simd.h"

namespace invgrad {
namespace {

using Eigen::Index;
using simd::At;
using simd::kPack;
using simd::Pack;

constexpr int b = BulgeChase::kBandwidth;
static_assert(b % kPack == 0);

// Column j of the band lies at Column(j), its diagonal first: b rows of the
// band and b - 1 of the bulge follow. The difference of two columns' addresses
// is kStride for the same row, so that squares are ordinary matrices.
// Squares are read in whole packs, which reach up to kPack - 1 places above the
// diagonal: the gap between two columns.
constexpr Index kStride = 2 * b + kPack;

// The band is continued by zeros after row m - 1, and all squares are whole.
Index BandSize(int m) { return (m + 2 * b) * (kStride + 1) + kPack; }

// How many reflectors sweep s needs: those that start above row m - 1.
int NumReflectors(int m, int s) { return s + 3 > m ? 0 : (m - 3 - s) / b + 1; }

Index TotalReflectors(int m) {
  Index total = 0;
  for (int s = 0; s + 2 < m; ++s) total += NumReflectors(m, s);
  return total;
}

// 1 in the lanes of column k of a square on the diagonal that lie on and below
// the diagonal, and strictly below it.
constexpr double kLower[kPack][kPack] = {
    {1, 1, 1, 1}, {0, 1, 1, 1}, {0, 0, 1, 1}, {0, 0, 0, 1}};
constexpr double kStrictlyLower[kPack][kPack] = {
    {0, 1, 1, 1}, {0, 0, 1, 1}, {0, 0, 0, 1}, {0, 0, 0, 0}};

// Four neighbouring columns.
struct Quad {
  INVGRAD_INLINE Quad(double* A, int j) {
    for (int k = 0; k < kPack; ++k) a[k] = A + (j + k) * kStride;
  }
  double* a[kPack];
};

// w = A v for the lower triangle of the symmetric A, and for the square C
// below it: v: b; w: 2 b.
INVGRAD_INLINE inline void Multiply(double* A, const double* v, double* w) {
  std::fill(w, w + 2 * b, 0.0);
  for (int j = 0; j < b; j += kPack) {
    const Quad column(A, j);
    Pack sum[kPack];
    Pack v_j[kPack];
    Pack w_i = At(w + j);
    for (int k = 0; k < kPack; ++k) {
      v_j[k] = Pack{} + v[j + k];
      const Pack& a = At(column.a[k] + j);
      w_i += a * (At(kLower[k]) * v_j[k]);
      sum[k] = a * (At(kStrictlyLower[k]) * At(v + j));
    }
    At(w + j) = w_i;
    for (int i = j + kPack; i < b; i += kPack) {
      const Pack v_i = At(v + i);
      w_i = At(w + i);
      for (int k = 0; k < kPack; ++k) {
        const Pack& a = At(column.a[k] + i);
        w_i += a * v_j[k];
        sum[k] += a * v_i;
      }
      At(w + i) = w_i;
    }
    for (int i = b; i < 2 * b; i += kPack) {
      w_i = At(w + i);
      for (int k = 0; k < kPack; ++k) w_i += At(column.a[k] + i) * v_j[k];
      At(w + i) = w_i;
    }
    for (int k = 0; k < kPack; ++k) w[j + k] += simd::Sum(sum[k]);
  }
}

// A -= v w^T + w v^T, the lower triangle.
INVGRAD_INLINE inline void UpdateTriangle(double* A,
                                          const double* v,
                                          const double* w) {
  for (int j = 0; j < b; j += kPack) {
    const Quad column(A, j);
    Pack v_j[kPack];
    Pack w_j[kPack];
    for (int k = 0; k < kPack; ++k) {
      v_j[k] = Pack{} + v[j + k];
      w_j[k] = Pack{} + w[j + k];
      At(column.a[k] + j) -= At(v + j) * (At(kLower[k]) * w_j[k]) +
                             At(w + j) * (At(kLower[k]) * v_j[k]);
    }
    for (int i = j + kPack; i < b; i += kPack) {
      const Pack v_i = At(v + i);
      const Pack w_i = At(w + i);
      for (int k = 0; k < kPack; ++k) {
        Pack& a = At(column.a[k] + i);
        a = a - v_i * w_j[k] - w_i * v_j[k];
      }
    }
  }
}

// C = H (C - w v^T), H = I - tau u u^T, except for its first column.
INVGRAD_INLINE inline void UpdateSquare(
    double* C, const double* v, const double* w, const double* u, double tau) {
  const double u_w = simd::Dot(b, u, w);
  for (int j = 0; j < b; j += kPack) {
    const Quad column(C, j);
    Pack sum[kPack] = {};
    for (int i = 0; i < b; i += kPack) {
      const Pack u_i = At(u + i);
      for (int k = 0; k < kPack; ++k) sum[k] += At(column.a[k] + i) * u_i;
    }
    Pack v_j[kPack];
    Pack z_j[kPack];
    for (int k = 0; k < kPack; ++k) {
      v_j[k] = Pack{} + v[j + k];
      z_j[k] = Pack{} + tau * (simd::Sum(sum[k]) - u_w * v[j + k]);
    }
    for (int i = 0; i < b; i += kPack) {
      const Pack u_i = At(u + i);
      const Pack w_i = At(w + i);
      for (int k = 0; k < kPack; ++k) {
        Pack& c = At(column.a[k] + i);
        c = c - w_i * v_j[k] - u_i * z_j[k];
      }
    }
  }
}

// Applies the reflector (v, tau) from both sides to the triangle A on the
// diagonal, and from the right to the square below it; makes the reflector
// (u, tau_u) that clears that square's first column, and applies it from the
// left.
INVGRAD_INLINE inline void ChaseOneSquare(
    double* A, const double* v, double tau, double* u, double* tau_u) {
  double w[2 * b];
  Multiply(A, v, w);
  for (int i = 0; i < 2 * b; ++i) w[i] *= tau;
  const double c = 0.5 * tau * simd::Dot(b, w, v);
  for (int i = 0; i < b; ++i) w[i] -= c * v[i];
  UpdateTriangle(A, v, w);

  double* C = A + b;
  for (int i = 0; i < b; ++i) u[i] = C[i] - w[b + i];
  const double beta = MakeReflector(b, u, tau_u);
  UpdateSquare(C, v, w + b, u, *tau_u);
  C[0] = beta;
  std::fill(C + 1, C + b, 0.0);
}

#ifndef GSW
#define GSW 8
#endif
constexpr int kSweeps = GSW;

INVGRAD_INLINE inline void Chase(int m,
                                 double* band,
                                 double* reflectors,
                                 double* tau) {
  // Where the reflectors of the sweeps under way begin, and one place for the
  // empty ones after the last of a sweep.
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
        double* u = reflectors + (first[g] + t) * b;
        double* tau_u = tau + first[g] + t;
        if (t == 0) {
          double* column = band + s * (kStride + 1) + 1;
          std::copy(column, column + b, u);
          column[0] = MakeReflector(b, u, tau_u);
          std::fill(column + 1, column + b, 0.0);
        }
        const bool last = t + 1 == count;
        ChaseOneSquare(band + (s + 1 + t * b) * (kStride + 1),
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
      ApplyReflector(
          b, reflectors + (first + t) * b, tau[first + t], x + s + 1 + t * b);
    }
    if (transpose) first += count;
  }
}

}  // namespace

void BulgeChase::Compute(const Eigen::MatrixXd& K,
                         Eigen::VectorXd* diagonal,
                         Eigen::VectorXd* off_diagonal) {
  CHECK_EQ(K.rows(), K.cols());
  const int m = static_cast<int>(K.rows());
  size_ = m;
  diagonal->resize(m);
  off_diagonal->resize(std::max(0, m - 1));
  double* storage = band_.Reserve(BandSize(m));
  double* reflectors = reflectors_.Reserve(TotalReflectors(m) * b);
  double* tau = tau_.Reserve(TotalReflectors(m) + m + b);
  std::fill(storage, storage + BandSize(m), 0.0);
  double* band = storage + kPack;
  for (int j = 0; j < m; ++j) {
    const double* k = K.data() + j * K.rows();
    std::copy(k + j, k + std::min(m, j + b + 1), band + j * (kStride + 1));
  }
  simd::Run([&]() INVGRAD_INLINE { Chase(m, band, reflectors, tau); });
  for (int j = 0; j < m; ++j) {
    (*diagonal)[j] = band[j * (kStride + 1)];
    if (j + 1 < m) (*off_diagonal)[j] = band[j * (kStride + 1) + 1];
  }
}

void BulgeChase::ApplyQ(bool transpose, Eigen::VectorXd* x) {
  CHECK_EQ(x->size(), size_);
  // Reflectors reach over the end, with zeros.
  double* padded = band_.Reserve(BandSize(size_));
  std::copy(x->data(), x->data() + size_, padded);
  std::fill(padded + size_, padded + size_ + b, 0.0);
  simd::Run([&]() INVGRAD_INLINE {
    Apply(size_, reflectors_.data(), tau_.data(), transpose, padded);
  });
  std::copy(padded, padded + size_, x->data());
}

int64_t BulgeChase::Bytes(int m) {
  return static_cast<int64_t>(sizeof(double)) *
         (BandSize(m) + TotalReflectors(m) * (b + 1) + m + b);
}

}  // namespace invgrad
