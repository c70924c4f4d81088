#include "invgrad/covariance/sparse_cholesky.h"

#include <algorithm>
#include <utility>

#include "cholmod.h"
#include "fmt/core.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct SparseCholesky::Factor {
  Factor() {
    cholmod_start(&common);
    common.print = 0;  // failures are in *error
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_AMD;
    common.final_ll = 1;
    common.quick_return_if_not_posdef = 1;
  }
  ~Factor() {
    Free();
    cholmod_finish(&common);
  }
  Factor(const Factor&) = delete;
  Factor& operator=(const Factor&) = delete;
  void Free() {
    if (L != nullptr) cholmod_free_factor(&L, &common);
  }

  // cholmod_solve changes no more than the statistics.
  mutable cholmod_common common;
  cholmod_factor* L = nullptr;
};

namespace {

// The view refers to A.
cholmod_sparse View(Eigen::SparseMatrix<double>* A) {
  cholmod_sparse view = {};
  view.nrow = static_cast<std::size_t>(A->rows());
  view.ncol = static_cast<std::size_t>(A->cols());
  view.nzmax = static_cast<std::size_t>(A->nonZeros());
  view.p = A->outerIndexPtr();
  view.i = A->innerIndexPtr();
  view.x = A->valuePtr();
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

// Z in the pattern of a factor L with sorted, packed columns.
class TakahashiRecurrence {
 public:
  explicit TakahashiRecurrence(const cholmod_factor& L)
      : n_(static_cast<int>(L.n)),
        p_(static_cast<const int*>(L.p)),
        i_(static_cast<const int*>(L.i)),
        L_(static_cast<const double*>(L.x)),
        Z_(static_cast<std::size_t>(p_[n_]), 0.0),
        sums_(VectorXd::Zero(n_)),
        column_(VectorXd::Zero(n_)) {}

  void RunDownTo(int first) {
    for (int j = n_ - 1; j >= first; --j) ComputeColumn(j);
  }

  // i >= j.
  std::optional<double> Entry(int i, int j) const {
    const int* const end = i_ + p_[j + 1];
    const int* const at = std::lower_bound(i_ + p_[j], end, i);
    if (at == end || *at != i) return std::nullopt;
    return Z_[at - i_];
  }

 private:
  void ComputeColumn(int j) {
    const int begin = p_[j];
    const int end = p_[j + 1];
    for (int e = begin + 1; e < end; ++e) {
      sums_[i_[e]] = 0.0;
      column_[i_[e]] = L_[e];
    }
    // sums_i = sum_k Z_ik L_kj, by the lower triangle of Z; sums of other i are
    // not used.
    for (int e = begin + 1; e < end; ++e) {
      const int k = i_[e];
      double sum = Z_[p_[k]] * L_[e];
      for (int f = p_[k] + 1; f < p_[k + 1]; ++f) {
        sums_[i_[f]] += Z_[f] * L_[e];
        sum += Z_[f] * column_[i_[f]];
      }
      sums_[k] += sum;
    }
    const double L_jj = L_[begin];
    double diagonal = 1.0 / L_jj;
    for (int e = begin + 1; e < end; ++e) {
      Z_[e] = -sums_[i_[e]] / L_jj;
      diagonal -= Z_[e] * L_[e];
      column_[i_[e]] = 0.0;
    }
    Z_[begin] = diagonal / L_jj;
  }

  const int n_;
  const int* const p_;
  const int* const i_;
  const double* const L_;
  std::vector<double> Z_;
  VectorXd sums_;
  VectorXd column_;  // of L, without the diagonal; zero between columns
};

}  // namespace

SparseCholesky::SparseCholesky() : factor_(std::make_unique<Factor>()) {}
SparseCholesky::~SparseCholesky() = default;

bool SparseCholesky::Factorize(const Eigen::SparseMatrix<double>& A,
                               std::string* error) {
  CHECK(error != nullptr);
  factor_->Free();
  cholmod_common& common = factor_->common;
  Eigen::SparseMatrix<double> transpose = A.transpose();
  cholmod_sparse view = View(&transpose);
  factor_->L = cholmod_analyze(&view, &common);
  if (factor_->L == nullptr) {
    *error = "J^T J could not be analyzed: it is too large";
    return false;
  }
  // A second copy is made by Entries, beside its Z.
  if (!FitsInMemory(
          fmt::format("the Cholesky factor of a J with {} columns", A.cols()),
          {{"its entries", 3.0 * sizeof(double) * common.lnz}},
          /*limit=*/0.0,
          error)) {
    return false;
  }
  cholmod_factorize(&view, factor_->L, &common);
  if (common.status == CHOLMOD_OK && factor_->L->minor == factor_->L->n) {
    return true;
  }
  *error = common.status == CHOLMOD_OUT_OF_MEMORY
               ? "there is no memory for the Cholesky factor of J^T J"
               : "J^T J is not positive definite to rounding";
  return false;
}

MatrixXd SparseCholesky::Solve(const MatrixXd& B) const {
  CHECK(factor_->L != nullptr) << "Factorize comes first.";
  cholmod_dense b = {};
  b.nrow = static_cast<std::size_t>(B.rows());
  b.ncol = static_cast<std::size_t>(B.cols());
  b.nzmax = static_cast<std::size_t>(B.size());
  b.d = b.nrow;
  b.x = const_cast<double*>(B.data());  // which CHOLMOD only reads
  b.xtype = CHOLMOD_REAL;
  b.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, factor_->L, &b, &factor_->common);
  CHECK(x != nullptr) << "no memory for a solution";
  MatrixXd result = Eigen::Map<const MatrixXd>(
      static_cast<const double*>(x->x), B.rows(), B.cols());
  cholmod_free_dense(&x, &factor_->common);
  return result;
}

std::vector<std::optional<double>> SparseCholesky::Entries(
    const std::vector<std::pair<int, int>>& entries) {
  CHECK(factor_->L != nullptr) << "Factorize comes first.";
  if (entries.empty()) return {};
  cholmod_factor* L = factor_->L;
  CHECK(cholmod_change_factor(CHOLMOD_REAL,
                              /*to_ll=*/1,
                              /*to_super=*/0,
                              /*to_packed=*/1,
                              /*to_monotonic=*/1,
                              L,
                              &factor_->common))
      << "no memory for the entries of the inverse";
  std::vector<int> place(L->n);  // in L
  for (std::size_t k = 0; k < L->n; ++k) {
    place[static_cast<const int*>(L->Perm)[k]] = static_cast<int>(k);
  }
  int first = static_cast<int>(L->n);
  for (const auto& [i, j] : entries) {
    first = std::min({first, place[i], place[j]});
  }
  TakahashiRecurrence Z(*L);
  Z.RunDownTo(first);
  std::vector<std::optional<double>> result;
  result.reserve(entries.size());
  for (const auto& [i, j] : entries) {
    result.push_back(
        Z.Entry(std::max(place[i], place[j]), std::min(place[i], place[j])));
  }
  return result;
}

}  // namespace invgrad
