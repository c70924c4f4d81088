#include "invgrad/rank/sparse_cholesky.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cholmod.h"
#include "glog/logging.h"
#include "invgrad/core/memory_limit.h"

namespace invgrad {

// CHOLMOD's objects, and J as A = J^T: the compressed rows of J are the
// compressed columns of J^T, and CHOLMOD factorizes A A^T for an unsymmetric A.
class SparseCholesky::Factors {
 public:
  Factors() {
    cholmod_start(&common_);
    common_.print = 0;  // the caller reports failures
    common_.final_ll = 1;
  }
  ~Factors() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Factors(const Factors&) = delete;
  Factors& operator=(const Factors&) = delete;

  bool Analyze(const SparseJacobian& J,
               double memory_limit,
               std::string* error) {
    const SparseJacobian::Matrix& matrix = J.matrix();
    CHECK(matrix.isCompressed());
    const int* starts = matrix.outerIndexPtr();
    const int* columns = matrix.innerIndexPtr();
    // CHOLMOD takes non-const pointers also to data that it only reads.
    transpose_.nrow = matrix.cols();
    transpose_.ncol = matrix.rows();
    transpose_.nzmax = matrix.nonZeros();
    transpose_.p = const_cast<int*>(starts);
    transpose_.i = const_cast<int*>(columns);
    transpose_.x = const_cast<double*>(matrix.valuePtr());
    transpose_.stype = 0;
    transpose_.itype = CHOLMOD_INT;
    transpose_.xtype = CHOLMOD_REAL;
    transpose_.dtype = CHOLMOD_DOUBLE;
    transpose_.sorted = 1;
    transpose_.packed = 1;
    const auto is_same = [](const std::vector<int>& known,
                            const int* begin,
                            std::ptrdiff_t size) {
      return std::equal(known.begin(), known.end(), begin, begin + size);
    };
    if (factor_ != nullptr && factor_->n == transpose_.nrow &&
        is_same(starts_, starts, matrix.rows() + 1) &&
        is_same(columns_, columns, matrix.nonZeros())) {
      return true;
    }
    cholmod_free_factor(&factor_, &common_);
    factor_ = cholmod_analyze(&transpose_, &common_);
    const double bytes = sizeof(double) * common_.lnz;
    if (factor_ != nullptr && !FitsInMemory(bytes, memory_limit)) {
      cholmod_free_factor(&factor_, &common_);
      return FitsInMemory("the Cholesky factor of a J with " +
                              std::to_string(matrix.cols()) + " columns",
                          {{"its entries", bytes}},
                          memory_limit,
                          error);
    }
    if (factor_ == nullptr) {
      *error = "J^T J could not be analyzed: it is too large";
      return false;
    }
    starts_.assign(starts, starts + matrix.rows() + 1);
    columns_.assign(columns, columns + matrix.nonZeros());
    num_entries_ = common_.lnz;
    return true;
  }

  bool Factorize(double shift, std::string* error) {
    CHECK(factor_ != nullptr) << "Analyze comes first.";
    CHECK_GE(shift, 0.0);
    double beta[] = {shift, 0.0};
    cholmod_factorize_p(&transpose_, beta, nullptr, 0, factor_, &common_);
    if (common_.status == CHOLMOD_OK && factor_->minor == factor_->n) {
      return true;
    }
    *error = common_.status == CHOLMOD_OUT_OF_MEMORY
                 ? "there is no memory for the Cholesky factor of J^T J"
                 : "J^T J is not positive definite to rounding; more damping "
                   "makes it so";
    return false;
  }

  void Solve(Eigen::Ref<Eigen::MatrixXd>* x) {
    CHECK(factor_ != nullptr);
    CHECK_EQ(x->rows(), static_cast<Eigen::Index>(factor_->n));
    cholmod_dense right = {};
    right.nrow = x->rows();
    right.ncol = x->cols();
    right.nzmax = x->outerStride() * x->cols();
    right.d = x->outerStride();
    right.x = x->data();
    right.xtype = CHOLMOD_REAL;
    right.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* solution =
        cholmod_solve(CHOLMOD_A, factor_, &right, &common_);
    CHECK(solution != nullptr) << "There is no memory for the solution.";
    CHECK_EQ(solution->d, solution->nrow);
    *x = Eigen::Map<const Eigen::MatrixXd>(
        static_cast<const double*>(solution->x), x->rows(), x->cols());
    cholmod_free_dense(&solution, &common_);
  }

  double num_entries() const { return num_entries_; }

 private:
  mutable cholmod_common common_;
  cholmod_sparse transpose_ = {};
  cholmod_factor* factor_ = nullptr;
  // The pattern of factor_.
  std::vector<int> starts_;
  std::vector<int> columns_;
  double num_entries_ = 0.0;
};

SparseCholesky::SparseCholesky() = default;
SparseCholesky::~SparseCholesky() = default;
SparseCholesky::SparseCholesky(SparseCholesky&&) noexcept = default;
SparseCholesky& SparseCholesky::operator=(SparseCholesky&&) noexcept = default;

bool SparseCholesky::Analyze(const SparseJacobian& J,
                             double memory_limit,
                             std::string* error) {
  if (factors_ == nullptr) factors_ = std::make_unique<Factors>();
  return factors_->Analyze(J, memory_limit, error);
}

bool SparseCholesky::Factorize(double shift, std::string* error) {
  CHECK(factors_ != nullptr) << "Analyze comes first.";
  return factors_->Factorize(shift, error);
}

void SparseCholesky::Solve(Eigen::Ref<Eigen::MatrixXd> x) const {
  CHECK(factors_ != nullptr) << "Analyze comes first.";
  factors_->Solve(&x);
}

double SparseCholesky::num_entries() const {
  return factors_ == nullptr ? 0.0 : factors_->num_entries();
}

}  // namespace invgrad
