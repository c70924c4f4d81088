#include "invgrad/spectral/routes/left_out_changes.h"

#include <algorithm>

#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using simd::kPack;
using simd::Pack;

// A row of L and D for four shifts.
struct ResolventRow {
  Pack left;
  Pack inverse;
};

// The columns of W and h are swept this many rows at a time, to keep the sums
// in registers.
constexpr int kChunk = 16;

INVGRAD_INLINE inline void FactorShifts(int size,
                                        const double* diagonal,
                                        const double* off_diagonal,
                                        const Pack& z,
                                        ResolventRow* rows) {
  Pack inverse = Pack{};
  Pack left = Pack{};
  for (int j = 0; j < size; ++j) {
    const double e = j == 0 ? 0.0 : off_diagonal[j - 1];
    left = e * inverse;
    inverse = 1.0 / (diagonal[j] + z - e * left);
    rows[j].left = left;
    rows[j].inverse = inverse;
  }
}

// The lower triangle of a symmetric matrix, row by row.
INVGRAD_INLINE inline int Lower(int row, int col) {
  return row * (row + 1) / 2 + col;
}

// products: the lower triangle of [W h]^T (T + z)^-1 [W h] without the entry
// of h alone. W: column by column; y: (q + 1) kChunk; s: kChunk; last: q + 1.
INVGRAD_INLINE inline void Multiply(int size,
                                    int q,
                                    const double* W,
                                    const double* h,
                                    const ResolventRow* rows,
                                    Pack* last,
                                    Pack* y,
                                    Pack* s,
                                    Pack* products) {
  std::fill(last, last + q + 1, Pack{});
  std::fill(products, products + Lower(q, q), Pack{});
  for (int first = 0; first < size; first += kChunk) {
    const int count = std::min(kChunk, size - first);
    const ResolventRow* row = rows + first;
    for (int a = 0; a <= q; ++a) {
      const double* w = (a < q ? W + static_cast<Index>(a) * size : h) + first;
      Pack* y_a = y + a * kChunk;
      Pack x = last[a];
      for (int j = 0; j < count; ++j) {
        x = w[j] - row[j].left * x;
        y_a[j] = x;
        s[j] = x * row[j].inverse;
      }
      last[a] = x;
      for (int b = 0; b <= std::min(a, q - 1); ++b) {
        const Pack* y_b = y + b * kChunk;
        Pack even = Pack{};
        Pack odd = Pack{};
        int j = 0;
        for (; j + 2 <= count; j += 2) {
          even += s[j] * y_b[j];
          odd += s[j + 1] * y_b[j + 1];
        }
        if (j < count) even += s[j] * y_b[j];
        products[Lower(a, b)] += even + odd;
      }
    }
  }
}

// x = M^-1 x for the positive definite M, whose lower triangle it overwrites by
// L D L^T.
INVGRAD_INLINE inline void SolveBlock(int q, Pack* M, Pack* x) {
  for (int a = 0; a < q; ++a) {
    for (int b = 0; b < a; ++b) {
      // M_ab = L_ab D_b until the row is complete.
      for (int c = 0; c < b; ++c)
        M[Lower(a, b)] -= M[Lower(a, c)] * M[Lower(b, c)];
    }
    for (int b = 0; b < a; ++b) {
      const Pack unscaled = M[Lower(a, b)];
      M[Lower(a, b)] = unscaled / M[Lower(b, b)];
      M[Lower(a, a)] -= unscaled * M[Lower(a, b)];
      x[a] -= M[Lower(a, b)] * x[b];
    }
  }
  for (int a = q - 1; a >= 0; --a) {
    x[a] /= M[Lower(a, a)];
    for (int b = a + 1; b < q; ++b) x[a] -= M[Lower(b, a)] * x[b];
  }
}

}  // namespace

LeftOutChanges::LeftOutChanges(const VectorXd& diagonal,
                               const VectorXd& off_diagonal,
                               const std::vector<double>& shifts,
                               bool is_parameter_side)
    : size_(static_cast<int>(diagonal.size())),
      num_shifts_(static_cast<Index>(shifts.size())),
      shifts_(shifts),
      is_parameter_side_(is_parameter_side) {
  CHECK_GT(size_, 0);
  CHECK_EQ(off_diagonal.size(), size_ - 1);
  CHECK(!shifts.empty());
  T_.Set(diagonal, off_diagonal);
  // Whole groups: the last shift is repeated.
  while (shifts_.size() % kPack != 0) shifts_.push_back(shifts_.back());
  auto* rows = reinterpret_cast<ResolventRow*>(
      factors_.Reserve(2 * shifts_.size() * size_));
  for (size_t k = 0; k < shifts_.size() / kPack; ++k) {
    simd::Run([&]() INVGRAD_INLINE {
      FactorShifts(size_,
                   diagonal.data(),
                   off_diagonal.data(),
                   simd::At(shifts_.data() + kPack * k).v,
                   rows + k * size_);
    });
  }
}

void LeftOutChanges::Compute(const Eigen::Ref<const MatrixXd>& W,
                             const VectorXd& b,
                             const Eigen::Ref<const VectorXd>& r_i,
                             MatrixXd* left_out,
                             MatrixXd* fitted) {
  const int q = static_cast<int>(W.cols());
  CHECK_EQ(W.rows(), size_);
  CHECK_EQ(b.size(), size_);
  CHECK_EQ(r_i.size(), q);
  h_ = W * r_i - b;
  if (!is_parameter_side_) T_.Times(h_, &Th_);
  left_out->resize(q, num_shifts_);
  fitted->resize(q, num_shifts_);
  auto* work = reinterpret_cast<Pack*>(
      work_.Reserve(kPack * ((q + 1) * (kChunk + 2) + kChunk + Lower(q, q))));
  Pack* y = work;
  Pack* last = y + (q + 1) * kChunk;
  Pack* s = last + q + 1;
  Pack* M = s + kChunk;
  Pack* v = M + Lower(q, 0);  // the last row of the products
  const auto* rows = reinterpret_cast<const ResolventRow*>(factors_.data());
  for (Index k = 0; k * kPack < num_shifts_; ++k) {
    const Index count = std::min<Index>(kPack, num_shifts_ - kPack * k);
    const bool is_large =
        !is_parameter_side_ && shifts_[kPack * k] >= T_.upper_bound();
    const VectorXd& h = is_large ? Th_ : h_;
    simd::Run([&]() INVGRAD_INLINE {
      const Pack z = simd::At(shifts_.data() + kPack * k).v;
      Multiply(size_, q, W.data(), h.data(), rows + k * size_, last, y, s, M);
      if (is_large) {
        for (int a = 0; a < q; ++a) v[a] /= -z;
      }
      for (int a = 0; a < q; ++a) {
        Pack full = -v[a];  // (A r_i - v)_a
        for (int c = 0; c < q; ++c) {
          full += M[Lower(std::max(a, c), std::min(a, c))] * r_i[c];
        }
        if (!is_parameter_side_) full = r_i[a] - z * full;
        for (int i = 0; i < count; ++i) (*fitted)(a, kPack * k + i) = full[i];
      }
      if (is_parameter_side_) {
        for (int a = 0; a < q; ++a) {
          for (int c = 0; c <= a; ++c) M[Lower(a, c)] = -M[Lower(a, c)];
          M[Lower(a, a)] += 1.0;
          v[a] = -v[a];
        }
      }
      SolveBlock(q, M, v);
      for (int a = 0; a < q; ++a) {
        for (int i = 0; i < count; ++i) (*left_out)(a, kPack * k + i) = v[a][i];
      }
    });
  }
}

}  // namespace invgrad
