// The triangular factor of a Jacobian that arrives row by row: what a step, a
// covariance and a rank need of it, in the memory of N x N numbers.
//
//   J = Q R,   R^T R = J^T J,   R^T c = J^T r,   c = the first N of Q^T r
//
//   StreamingGram<3> gram;
//   for (int i = 0; i < m; ++i) gram.AddRow(&J[3 * i], r[i]);
//   const GramRoot<3>& root = gram.Finish();
//   Eigen::Matrix3d JtJ = root.R.transpose() * root.R;
//   Eigen::Vector3d gradient = root.R.transpose() * root.c;
//   double cost = 0.5 * root.squared_norm();  // 1/2 |r|^2
//
// Rows wait in a block. A full block goes below R, and N Householder
// reflections make the stack triangular again [1]. Packs of four rows make this
// as fast as sums of the products J_i^T J_i, which lose twice as many digits: R
// has the condition number of J, not its square. Of columns that agree but for
// 1e-6, R gives a step with eight correct digits, J^T J one with none
// (docs/results/fits.md).
//
// Shapes:  R: N x N, upper triangle, of any signs;  c: N.
// Cost:    2 m N^2 + 2 m N. Memory: (block + N) (N + 1) numbers.
// Fails:   R is not finite if J or r is not.
// Limits:  squares of entries must not overflow or underflow: |entries| in
//          1e-150 ... 1e150, or zero.
//
// [1] Golub, Van Loan. Matrix Computations, 4th ed., section 5.2; Demmel,
//     Grigori, Hoemmen, Langou. Communication-optimal Parallel and Sequential
//     QR. SIAM J. Sci. Comput. 34, 2012.
#ifndef INVGRAD_INTERNAL_STREAMING_GRAM_H_
#define INVGRAD_INTERNAL_STREAMING_GRAM_H_

#include <cmath>
#include <cstdint>

#include "Eigen/Core"
#include "invgrad/internal/pack.h"

namespace invgrad {

template <int N>
struct GramRoot {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;

  Matrix R = Matrix::Zero();
  Vector c = Vector::Zero();
  double rest = 0.0;     // |r|^2 - |c|^2 = min |r + J step|^2
  int64_t num_rows = 0;  // m

  double squared_norm() const { return c.squaredNorm() + rest; }  // |r|^2
  bool IsFinite() const {
    return std::isfinite(rest) && R.allFinite() && c.allFinite();
  }
};

// Four rows of [J r]: columns[j] has column j of all four.
template <int N>
struct alignas(32) RowPack {
  Pack::Vector columns[N + 1];
};

// Column j and those right of it, of AppendRows. products[l] sums up to the
// product of the columns j and j + l.
template <int N, int j>
void ReflectColumns(int num_packs,
                    const Pack::Vector* products,
                    RowPack<N>* block,
                    GramRoot<N>* root) {
  constexpr int kRight = N - j;  // columns right of it
  const auto sum = [&](int l) {
    return (products[l][0] + products[l][1]) +
           (products[l][2] + products[l][3]);
  };
  const double squared = sum(0);
  Pack::Vector w[kRight + 1] = {};
  if (squared != 0.0) {
    const double alpha = root->R(j, j);
    const double length = std::sqrt(alpha * alpha + squared);
    const double beta = alpha > 0.0 ? -length : length;
    root->R(j, j) = beta;
    const double u_0 = alpha - beta;
    const double inverse_h = -1.0 / (beta * u_0);
    for (int l = 1; l <= kRight; ++l) {
      double* top = l < kRight ? &root->R(j, j + l) : &root->c[j];
      const double w_l = (u_0 * *top + sum(l)) * inverse_h;
      *top -= w_l * u_0;
      w[l] = Pack(w_l).v;
    }
  }
  // The reflected rows, and their products.
  Pack::Vector next[kRight] = {};
  for (int p = 0; p < num_packs; ++p) {
    Pack::Vector* row = &block[p].columns[j];
    const Pack::Vector first = row[1] - row[0] * w[1];
    row[1] = first;
    next[0] += first * first;
    for (int l = 2; l <= kRight; ++l) {
      const Pack::Vector reflected = row[l] - row[0] * w[l];
      row[l] = reflected;
      next[l - 1] += first * reflected;
    }
  }
  if constexpr (j + 1 < N) {
    ReflectColumns<N, j + 1>(num_packs, next, block, root);
  } else {
    root->rest += (next[0][0] + next[0][1]) + (next[0][2] + next[0][3]);
  }
}

// R, c and rest of the stack [R c; B b], where [B b] is the block, which is
// destroyed. The reflection of column j changes row j of R and all of B: it is
// I - u u^T / h, u = (R_jj - beta; B_j), h = 1/2 |u|^2, and R_jj becomes beta.
template <int N>
void AppendRows(int num_packs, RowPack<N>* block, GramRoot<N>* root) {
  CallInlinedFor<Pack>([&] {
    Pack::Vector products[N + 1] = {};
    for (int p = 0; p < num_packs; ++p) {
      const Pack::Vector first = block[p].columns[0];
      for (int l = 0; l <= N; ++l) products[l] += first * block[p].columns[l];
    }
    ReflectColumns<N, 0>(num_packs, products, block, root);
  });
}

template <int N>
class StreamingGram {
 public:
  // A block is in the first-level cache.
  static constexpr int kBlockRows = N <= 4 ? 32 : 128;

  void Reset() {
    root_ = GramRoot<N>();
    num_waiting_ = 0;
  }

  // Row i of J, N numbers, and r_i.
  void AddRow(const double* jacobian_row, double residual) {
    ++root_.num_rows;
    Append([&](int j) { return jacobian_row[j]; }, residual);
  }

  // The rows of another part of J.
  void Merge(const GramRoot<N>& other) {
    root_.rest += other.rest;
    root_.num_rows += other.num_rows;
    for (int i = 0; i < N; ++i) {
      Append([&](int j) { return other.R(i, j); }, other.c[i]);
    }
  }

  // Of all rows so far; more may follow.
  const GramRoot<N>& Finish() {
    if (num_waiting_ > 0) Flush();
    return root_;
  }

 private:
  static constexpr int kLanes = Pack::kLanes;

  template <typename Row>
  void Append(const Row& row, double residual) {
    const unsigned i = num_waiting_;
    Pack::Vector* columns = block_[i / kLanes].columns;
    for (int j = 0; j < N; ++j) columns[j][i % kLanes] = row(j);
    columns[N][i % kLanes] = residual;
    if (++num_waiting_ == kBlockRows) Flush();
  }

  void Flush() {
    const int num_packs = (num_waiting_ + kLanes - 1) / kLanes;
    for (int i = num_waiting_; i < num_packs * kLanes; ++i) {
      for (Pack::Vector& column : block_[num_packs - 1].columns) {
        column[i % kLanes] = 0.0;
      }
    }
    AppendRows<N>(num_packs, block_, &root_);
    num_waiting_ = 0;
  }

  GramRoot<N> root_;
  RowPack<N> block_[kBlockRows / kLanes];
  int num_waiting_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_STREAMING_GRAM_H_
