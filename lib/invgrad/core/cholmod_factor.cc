#include "invgrad/core/cholmod_factor.h"

#include <cstddef>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::MatrixXd;

cholmod_sparse CholmodView(Eigen::SparseMatrix<double>* A, int stype) {
  cholmod_sparse view = {};
  view.nrow = static_cast<std::size_t>(A->rows());
  view.ncol = static_cast<std::size_t>(A->cols());
  view.nzmax = static_cast<std::size_t>(A->nonZeros());
  view.p = A->outerIndexPtr();
  view.i = A->innerIndexPtr();
  view.x = A->valuePtr();
  view.stype = stype;
  view.itype = CHOLMOD_INT;
  view.xtype = CHOLMOD_REAL;
  view.dtype = CHOLMOD_DOUBLE;
  view.sorted = 1;
  view.packed = 1;
  return view;
}

CholmodFactor::CholmodFactor() {
  cholmod_start(&common_);
  common_.print = 0;  // failures are in *error
  common_.nmethods = 1;
  common_.final_ll = 1;
  common_.quick_return_if_not_posdef = 1;
}

CholmodFactor::~CholmodFactor() {
  Free();
  cholmod_finish(&common_);
}

void CholmodFactor::Free() {
  if (L_ != nullptr) cholmod_free_factor(&L_, &common_);
}

bool CholmodFactor::Analyze(cholmod_sparse* A,
                            std::vector<int> order,
                            std::string* error) {
  Free();
  common_.method[0].ordering = order.empty() ? CHOLMOD_AMD : CHOLMOD_GIVEN;
  L_ = cholmod_analyze_p(
      A, order.empty() ? nullptr : order.data(), nullptr, 0, &common_);
  if (L_ == nullptr) {
    *error = "J^T J could not be analyzed: it is too large";
    return false;
  }
  // As many for a copy, which users make of L.
  return FitsInMemory(
      fmt::format("the Cholesky factor of a J with {} columns", L_->n),
      {{"its entries", 3.0 * sizeof(double) * common_.lnz}},
      /*limit=*/0.0,
      error);
}

bool CholmodFactor::Factorize(cholmod_sparse* A, std::string* error) {
  CHECK(L_ != nullptr) << "Analyze comes first.";
  cholmod_factorize(A, L_, &common_);
  if (common_.status == CHOLMOD_OK && L_->minor == L_->n) return true;
  *error = common_.status == CHOLMOD_OUT_OF_MEMORY
               ? "there is no memory for the Cholesky factor of J^T J"
               : "J^T J is not positive definite to rounding";
  return false;
}

MatrixXd CholmodFactor::Solve(const MatrixXd& B) const {
  CHECK(L_ != nullptr) << "Factorize comes first.";
  cholmod_dense b = {};
  b.nrow = static_cast<std::size_t>(B.rows());
  b.ncol = static_cast<std::size_t>(B.cols());
  b.nzmax = static_cast<std::size_t>(B.size());
  b.d = b.nrow;
  b.x = const_cast<double*>(B.data());  // which CHOLMOD only reads
  b.xtype = CHOLMOD_REAL;
  b.dtype = CHOLMOD_DOUBLE;
  cholmod_dense* x = cholmod_solve(CHOLMOD_A, L_, &b, &common_);
  CHECK(x != nullptr) << "no memory for a solution";
  MatrixXd result = Eigen::Map<const MatrixXd>(
      static_cast<const double*>(x->x), B.rows(), B.cols());
  cholmod_free_dense(&x, &common_);
  return result;
}

}  // namespace invgrad
