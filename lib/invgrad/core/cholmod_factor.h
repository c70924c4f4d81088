// A sparse Cholesky decomposition P A P^T = L L^T by CHOLMOD, with its
// workspace.
//
// Cost:    Analyze: about linear in the entries of A and L. Factorize: the sum
//          of the squares of L's column counts. Solve: 4 |L| a column.
// Fails:   with a message, if memory does not suffice, or if A is not positive
//          definite to rounding.
#ifndef INVGRAD_CORE_CHOLMOD_FACTOR_H_
#define INVGRAD_CORE_CHOLMOD_FACTOR_H_

#include <string>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "cholmod.h"

namespace invgrad {

// Of CHOLMOD's type; refers to A. `stype`: 0: all of A is stored, -1: the lower
// triangle of a symmetric A.
cholmod_sparse CholmodView(Eigen::SparseMatrix<double>* A, int stype);

class CholmodFactor {
 public:
  CholmodFactor();
  ~CholmodFactor();
  CholmodFactor(const CholmodFactor&) = delete;
  CholmodFactor& operator=(const CholmodFactor&) = delete;

  // The pattern of L, for a symmetric A or, of any other, for A A^T. `order`: P,
  // the column at each place; empty: AMD's.
  bool Analyze(cholmod_sparse* A, std::vector<int> order, std::string* error);

  // A has the analyzed pattern.
  bool Factorize(cholmod_sparse* A, std::string* error);

  // A^-1 B
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& B) const;

  cholmod_factor* L() const { return L_; }
  cholmod_common* common() const { return &common_; }

 private:
  void Free();

  // cholmod_solve changes no more than the statistics.
  mutable cholmod_common common_;
  cholmod_factor* L_ = nullptr;
};

}  // namespace invgrad

#endif  // INVGRAD_CORE_CHOLMOD_FACTOR_H_
