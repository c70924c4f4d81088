#include "invgrad/covariance/schur_complement.h"

#include <algorithm>
#include <numeric>

#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using SparseMatrix = Eigen::SparseMatrix<double>;
using RowMajorSparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;

namespace {

constexpr int kMaxSize = 2000;  // of S
constexpr double kMaxShare = 0.2;

auto Lower(const MatrixXd& L) { return L.triangularView<Eigen::Lower>(); }

// Blocks without a common row of A; blocks with few entries first.
std::vector<int> IndependentBlocks(const SparseMatrix& A,
                                   const std::vector<int>& offsets) {
  const auto num_entries = [&](int b) {
    return A.outerIndexPtr()[offsets[b + 1]] - A.outerIndexPtr()[offsets[b]];
  };
  std::vector<int> order(offsets.size() - 1);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return num_entries(a) < num_entries(b);
  });
  std::vector<bool> is_used(static_cast<std::size_t>(A.rows()), false);
  std::vector<int> independent;
  for (const int b : order) {
    const int* const begin = A.innerIndexPtr() + A.outerIndexPtr()[offsets[b]];
    const int* const end = begin + num_entries(b);
    if (begin == end ||
        std::any_of(begin, end, [&](int i) { return is_used[i]; })) {
      continue;
    }
    std::for_each(begin, end, [&](int i) { is_used[i] = true; });
    independent.push_back(b);
  }
  return independent;
}

}  // namespace

SchurComplement::SchurComplement(const SparseMatrix& A,
                                 const std::vector<int>& offsets)
    : block_of_(static_cast<std::size_t>(A.cols()), -1),
      place_(static_cast<std::size_t>(A.cols()), -1) {
  CHECK_EQ(offsets.back(), A.cols());
  for (const int b : IndependentBlocks(A, offsets)) {
    Block block;
    block.begin = offsets[b];
    block.size = offsets[b + 1] - offsets[b];
    std::fill_n(block_of_.begin() + block.begin,
                block.size,
                static_cast<int>(blocks_.size()));
    blocks_.push_back(std::move(block));
  }
  for (int j = 0; j < A.cols(); ++j) {
    if (block_of_[j] >= 0) continue;
    place_[j] = static_cast<int>(rest_.size());
    rest_.push_back(j);
  }
}

bool SchurComplement::IsSmall() const {
  return !rest_.empty() && rest_.size() <= kMaxSize &&
         static_cast<double>(rest_.size()) <=
             kMaxShare * static_cast<double>(place_.size());
}

bool SchurComplement::Factorize(const SparseMatrix& A, std::string* error) {
  CHECK(error != nullptr);
  std::vector<Eigen::Triplet<double>> triplets;
  for (std::size_t j = 0; j < rest_.size(); ++j) {
    for (SparseMatrix::InnerIterator it(A, rest_[j]); it; ++it) {
      triplets.emplace_back(it.row(), static_cast<int>(j), it.value());
    }
  }
  RowMajorSparse F(A.rows(), static_cast<Index>(rest_.size()));
  F.setFromTriplets(triplets.begin(), triplets.end());
  MatrixXd S = MatrixXd::Zero(F.cols(), F.cols());  // the lower triangle
  for (Index i = 0; i < F.rows(); ++i) {
    for (RowMajorSparse::InnerIterator a(F, i); a; ++a) {
      for (RowMajorSparse::InnerIterator b(F, i); b && b.col() <= a.col();
           ++b) {
        S(a.col(), b.col()) += a.value() * b.value();
      }
    }
  }
  row_place_.assign(static_cast<std::size_t>(A.rows()), -1);
  column_place_.assign(rest_.size(), -1);
  bool is_definite = true;
  for (Block& block : blocks_) is_definite &= AddBlock(A, F, &block, &S);
  S_inverse_.resize(0, 0);
  S_.compute(S);
  if (is_definite && S_.info() == Eigen::Success) return true;
  *error = "J^T J is not positive definite to rounding";
  return false;
}

bool SchurComplement::AddBlock(const SparseMatrix& A,
                               const RowMajorSparse& F,
                               Block* block,
                               MatrixXd* S) {
  std::vector<int> rows;
  block->coupled.clear();
  for (int j = block->begin; j < block->begin + block->size; ++j) {
    for (SparseMatrix::InnerIterator it(A, j); it; ++it) {
      if (row_place_[it.row()] >= 0) continue;
      row_place_[it.row()] = static_cast<int>(rows.size());
      rows.push_back(static_cast<int>(it.row()));
      for (RowMajorSparse::InnerIterator at(F, it.row()); at; ++at) {
        int& place = column_place_[at.col()];
        if (place >= 0) continue;
        place = static_cast<int>(block->coupled.size());
        block->coupled.push_back(static_cast<int>(at.col()));
      }
    }
  }
  const auto num_rows = static_cast<Index>(rows.size());
  MatrixXd E_rows = MatrixXd::Zero(num_rows, block->size);
  MatrixXd F_rows =
      MatrixXd::Zero(num_rows, static_cast<Index>(block->coupled.size()));
  for (int j = 0; j < block->size; ++j) {
    for (SparseMatrix::InnerIterator it(A, block->begin + j); it; ++it) {
      E_rows(row_place_[it.row()], j) = it.value();
    }
  }
  for (Index i = 0; i < num_rows; ++i) {
    for (RowMajorSparse::InnerIterator at(F, rows[i]); at; ++at) {
      F_rows(i, column_place_[at.col()]) = at.value();
    }
  }
  for (const int i : rows) row_place_[i] = -1;
  for (const int j : block->coupled) column_place_[j] = -1;

  const Eigen::LLT<MatrixXd> cholesky(E_rows.transpose() * E_rows);
  if (cholesky.info() != Eigen::Success) return false;
  block->L = cholesky.matrixLLT();
  block->W.resize(block->size, F_rows.cols());
  if (block->coupled.empty()) return true;
  block->W = Lower(block->L).solve(E_rows.transpose() * F_rows);
  const MatrixXd WtW = block->W.transpose() * block->W;
  for (std::size_t b = 0; b < block->coupled.size(); ++b) {
    for (std::size_t a = 0; a < block->coupled.size(); ++a) {
      const int i = block->coupled[a];
      const int j = block->coupled[b];
      if (i >= j) (*S)(i, j) -= WtW(static_cast<Index>(a), b);
    }
  }
  return true;
}

MatrixXd SchurComplement::Solve(const MatrixXd& B) const {
  CHECK_EQ(B.rows(), static_cast<Index>(place_.size()));
  MatrixXd X = B;
  MatrixXd of_rest = B(rest_, Eigen::all);
  // Loops, because the blocks are too small for calls of BLAS or of Eigen.
  for (const Block& block : blocks_) {
    for (Index c = 0; c < B.cols(); ++c) {
      double* const y = &X(block.begin, c);
      double* const f = of_rest.col(c).data();
      for (int j = 0; j < block.size; ++j) {  // y = L^-1 y
        y[j] /= block.L(j, j);
        for (int i = j + 1; i < block.size; ++i) y[i] -= block.L(i, j) * y[j];
      }
      const double* w = block.W.data();
      for (const int k : block.coupled) {  // f -= W^T y
        double sum = 0.0;
        for (int i = 0; i < block.size; ++i) sum += *w++ * y[i];
        f[k] -= sum;
      }
    }
  }
  S_.solveInPlace(of_rest);
  X(rest_, Eigen::all) = of_rest;
  for (const Block& block : blocks_) {
    for (Index c = 0; c < B.cols(); ++c) {
      double* const y = &X(block.begin, c);
      const double* const f = of_rest.col(c).data();
      const double* w = block.W.data();
      for (const int k : block.coupled) {  // y -= W f
        for (int i = 0; i < block.size; ++i) y[i] -= *w++ * f[k];
      }
      for (int j = block.size - 1; j >= 0; --j) {  // y = L^-T y
        for (int i = j + 1; i < block.size; ++i) y[j] -= block.L(i, j) * y[i];
        y[j] /= block.L(j, j);
      }
    }
  }
  return X;
}

SchurComplement::Row SchurComplement::RowOfV(int column) const {
  if (place_[column] >= 0) return {{place_[column]}, VectorXd::Ones(1)};
  const Block& block = blocks_[block_of_[column]];
  VectorXd unit = VectorXd::Unit(block.size, column - block.begin);
  Lower(block.L).solveInPlace(unit);
  return {block.coupled, -block.W.transpose() * unit};
}

std::vector<std::optional<double>> SchurComplement::Entries(
    const std::vector<std::pair<int, int>>& entries) {
  if (S_inverse_.size() == 0) {
    S_inverse_ = S_.solve(MatrixXd::Identity(S_.rows(), S_.cols()));
  }
  std::vector<std::optional<double>> result;
  result.reserve(entries.size());
  for (const auto& [i, j] : entries) {
    const Row v = RowOfV(i);
    const Row w = RowOfV(j);
    double z = 0.0;
    if (!v.columns.empty() && !w.columns.empty()) {
      z = v.values.dot(S_inverse_(v.columns, w.columns) * w.values);
    }
    if (block_of_[i] >= 0 && block_of_[i] == block_of_[j]) {
      const Block& block = blocks_[block_of_[i]];
      const VectorXd x =
          Lower(block.L).solve(VectorXd::Unit(block.size, i - block.begin));
      const VectorXd y =
          Lower(block.L).solve(VectorXd::Unit(block.size, j - block.begin));
      z += x.dot(y);
    }
    result.emplace_back(z);
  }
  return result;
}

}  // namespace invgrad
