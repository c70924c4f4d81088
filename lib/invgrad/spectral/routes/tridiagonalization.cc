#include "invgrad/spectral/routes/tridiagonalization.h"

#include <algorithm>
#include <utility>

#include "invgrad/internal/communicator.h"
#include "invgrad/internal/logging.h"
#include "invgrad/spectral/routes/householder.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Method = Tridiagonalization::Method;
using simd::At;
using simd::kPack;
using simd::Pack;

// Rows and columns are padded with zeros to whole packs.
int PaddedSize(int m) { return (m + kPack - 1) / kPack * kPack; }

// Pads each column by one cache line, so that columns whose length is a power
// of two do not map to the same cache lines.
Eigen::Index Stride(int m) { return PaddedSize(m) + 8; }

// The lower triangle of A in squares of kPack x kPack; the squares on the
// diagonal are full.
struct Triangle {
  int size;  // a multiple of kPack
  double* data;
  Eigen::Index stride;

  INVGRAD_INLINE double* Column(int j) const { return data + j * stride; }
};

// The square on the diagonal: A -= v w^T + w v^T, p += A u.
INVGRAD_INLINE inline void SweepDiagonalSquare(const Triangle& A,
                                               int first,
                                               const double* v,
                                               const double* w,
                                               const double* u,
                                               double* p) {
  Pack p_i = At(p + first).v;
  for (int j = first; j < first + kPack; ++j) {
    double* a = A.Column(j) + first;
    const Pack a_ij = At(a).v - At(v + first).v * w[j] - At(w + first).v * v[j];
    At(a).v = a_ij;
    p_i += a_ij * u[j];
  }
  At(p + first).v = p_i;
}

// The columns first, ..., first + kPack - 1 below it: the same, and
// p += A^T u. Four columns share the loads of v, w, u and p.
INVGRAD_INLINE inline void SweepColumns(const Triangle& A,
                                        int first,
                                        const double* v,
                                        const double* w,
                                        const double* u,
                                        double* p) {
  double* a[kPack];
  Pack v_j[kPack];
  Pack w_j[kPack];
  Pack u_j[kPack];
  Pack sum[kPack];
  for (int k = 0; k < kPack; ++k) {
    a[k] = A.Column(first + k);
    v_j[k] = Pack{} + v[first + k];
    w_j[k] = Pack{} + w[first + k];
    u_j[k] = Pack{} + u[first + k];
    sum[k] = Pack{};
  }
  for (int i = first + kPack; i < A.size; i += kPack) {
    const Pack v_i = At(v + i).v;
    const Pack w_i = At(w + i).v;
    const Pack u_i = At(u + i).v;
    Pack p_i = At(p + i).v;
    for (int k = 0; k < kPack; ++k) {
      const Pack a_ij = At(a[k] + i).v - v_i * w_j[k] - w_i * v_j[k];
      At(a[k] + i).v = a_ij;
      p_i += a_ij * u_j[k];
      sum[k] += a_ij * u_i;
    }
    At(p + i).v = p_i;
  }
  for (int k = 0; k < kPack; ++k) p[first + k] += simd::Sum(sum[k]);
}

// A -= v w^T + w v^T and p = A u, where v, w and u are zero before row
// `begin`. Leaves p before it undefined.
INVGRAD_INLINE inline void Sweep(const Triangle& A,
                                 int begin,
                                 const double* v,
                                 const double* w,
                                 const double* u,
                                 double* p) {
  const int first = begin / kPack * kPack;
  std::fill(p + first, p + A.size, 0.0);
  for (int j = first; j < A.size; j += kPack) {
    SweepDiagonalSquare(A, j, v, w, u, p);
    SweepColumns(A, j, v, w, u, p);
  }
}

// work: 4 vectors of A.size.
INVGRAD_INLINE inline void Reduce(int m,
                                  const Triangle& A,
                                  double* diagonal,
                                  double* off_diagonal,
                                  double* tau,
                                  double* work) {
  const int size = A.size;
  std::fill(work, work + 4 * size, 0.0);
  double* v = work;  // the change that A still waits for
  double* w = work + size;
  double* u = work + 2 * size;
  double* p = work + 3 * size;
  for (int j = 0; j < m; ++j) {
    double* a = A.Column(j);
    const double v_j = v[j];
    const double w_j = w[j];
    for (int i = j; i < m; ++i) a[i] -= v[i] * w_j + w[i] * v_j;
    diagonal[j] = a[j];
    const int begin = j + 1;
    if (begin == m) break;

    off_diagonal[j] = MakeReflector(m - begin, a + begin, tau + j);
    std::copy(a + begin, a + m, u + begin);
    u[j] = v[j] = w[j] = 0.0;
    Sweep(A, begin, v, w, u, p);

    const double t = tau[j];
    const double c = 0.5 * t * t * simd::Dot(m - begin, p + begin, u + begin);
    for (int i = begin; i < m; ++i) w[i] = t * p[i] - c * u[i];
    std::swap(u, v);
  }
}

// The size from which two stages are used. Times of one and two stages on one
// core of a shared Zen 4 with 1 MB of L2: 46 and 73 ms at m = 1024, 186 and 220
// ms at 1536, 499 and 474 ms at 2048, 6.9 and 3.2 s at 4096.
constexpr int kCrossover = 1800;

Method Choose(Method method, double m) {
  if (method != Method::kAuto) return method;
  return m < kCrossover ? Method::kOneStage : Method::kTwoStage;
}

}  // namespace

void Tridiagonalization::Compute(MatrixXd* K, Method method) {
  CHECK_EQ(K->rows(), K->cols());
  K_ = K;
  strips_ = ColumnStrips(K->rows(), nullptr);
  method_ = Choose(method, static_cast<double>(K->rows()));
  if (method_ == Method::kOneStage) {
    ReduceInOneStage();
  } else {
    ReduceInTwoStages(strips_);
  }
}

void Tridiagonalization::ComputeStrips(const ColumnStrips& strips,
                                       MatrixXd* K) {
  CHECK(strips.communicator() != nullptr);
  K_ = K;
  strips_ = strips;
  method_ = Method::kTwoStage;
  ReduceInTwoStages(strips);
}

void Tridiagonalization::ReduceInTwoStages(const ColumnStrips& strips) {
  band_reduction_.Compute(strips, K_, &tau_);
  bulge_chase_.Compute(strips, *K_, &diagonal_, &off_diagonal_);
}

void Tridiagonalization::ReduceInOneStage() {
  MatrixXd& K = *K_;
  const int m = static_cast<int>(K.rows());
  diagonal_.resize(m);
  off_diagonal_.resize(std::max(0, m - 1));
  tau_.resize(std::max(0, m - 1));
  const int size = PaddedSize(m);
  double* work = triangle_.Reserve((4 + Stride(m)) * size);
  const Triangle A{size, work + 4 * size, Stride(m)};
  for (int j = 0; j < size; ++j) {
    const int first = j / kPack * kPack;
    double* a = A.Column(j);
    std::fill(a + first, a + size, 0.0);
    if (j >= m) continue;
    for (int i = first; i < j; ++i) a[i] = K(j, i);
    std::copy(&K(j, j), K.data() + (j + 1) * K.rows(), a + j);
  }
  simd::Run([&]() INVGRAD_INLINE {
    Reduce(m, A, diagonal_.data(), off_diagonal_.data(), tau_.data(), work);
  });
  for (int j = 0; j + 1 < m; ++j) {
    std::copy(A.Column(j) + j + 1, A.Column(j) + m, &K(j + 1, j));
  }
}

void Tridiagonalization::ApplyReflectors(bool transpose, VectorXd* x) const {
  const auto m = static_cast<int>(K_->rows());
  CHECK_EQ(x->size(), m);
  const int offset = method_ == Method::kOneStage ? 1 : kBandwidth;
  const auto count = static_cast<int>(tau_.size());
  const auto apply = [&](Index begin, Index end) {
    simd::Run([&]() INVGRAD_INLINE {
      for (Index k = begin; k < end; ++k) {
        const Index j = transpose ? k : end - 1 - (k - begin);
        const Index first = j + offset;
        ApplyReflector(static_cast<int>(m - first),
                       K_->data() + strips_.Local(j) * m + first,
                       tau_[j],
                       x->data() + first);
      }
    });
  };
  const Communicator* const communicator = strips_.communicator();
  if (communicator == nullptr) {
    apply(0, count);
    return;
  }
  // Strip by strip, by its owner.
  constexpr Index kWidth = ColumnStrips::kWidth;
  const Index num_strips = (count + kWidth - 1) / kWidth;
  for (Index i = 0; i < num_strips; ++i) {
    const Index begin = kWidth * (transpose ? i : num_strips - 1 - i);
    if (strips_.Owns(begin)) {
      apply(begin, std::min<Index>(count, begin + kWidth));
    }
    communicator->Broadcast(strips_.Owner(begin), x->data(), m);
  }
}

void Tridiagonalization::ApplyQTranspose(VectorXd* x) const {
  ApplyReflectors(true, x);
  if (method_ == Method::kTwoStage) bulge_chase_.ApplyQ(true, x);
}

void Tridiagonalization::ApplyQ(VectorXd* x) const {
  if (method_ == Method::kTwoStage) bulge_chase_.ApplyQ(false, x);
  ApplyReflectors(false, x);
}

double Tridiagonalization::Bytes(double m, Method method) {
  // A padded copy of K; or the reflectors of the chase, [V W], [W V] and [V X]
  // of the band reduction, and the band with its bulge.
  constexpr double b = kBandwidth;
  return sizeof(double) * (Choose(method, m) == Method::kOneStage
                               ? m * m + 20.0 * m
                               : 0.5 * m * m * (1.0 + 1.0 / b) + 9.0 * b * m);
}

}  // namespace invgrad
