// The linear algebra of damped Gauss-Newton steps, for several lambda and w:
//
//   (c J^T J + lambda D) x = J^T w
//
//   dense     D = c |J|^2 I,  |J|: Frobenius norm. By the Gram matrix of the
//             smaller side k = min(m, n).
//   sparse    D = c diag(J^T J), where it is not 0. Independent blocks of
//             columns, as points of a bundle adjustment, are eliminated first,
//             the rest by CHOLMOD with the ordering AMD of the blocks, which is
//             kept while the pattern of J is the same.
//
// The bend a (geodesic_rule.cc) is too long if |a| >= 0.75 |v| (dense). In each
// block of a sparse J it is shortened to |a| <= 0.375 |v|, in the norm of D:
// else a few points of a bundle adjustment leave for infinity.
//
// Cost:    dense: k^2 max(m, n) for a J, k^3 / 3 for a lambda, and 2 k^2 for a
//          solution. Sparse: the squared lengths of J's rows, a numeric
//          Cholesky decomposition, and 4 |L|.
// Source:  the limit 2 |a| <= 0.75 |v| is that of Transtrum, Sethna. arXiv
//          1201.5885.
#ifndef INVGRAD_RULES_DAMPED_NORMAL_EQUATIONS_H_
#define INVGRAD_RULES_DAMPED_NORMAL_EQUATIONS_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

class DampedNormalEquations {
 public:
  virtual ~DampedNormalEquations() = default;

  // Keeps a pointer to J until the next call. Returns false, with *error, if J
  // is not finite or memory does not suffice.
  virtual bool SetJacobian(const JacobianOperator& J,
                           double c,
                           std::string* error) = 0;
  // |J|
  virtual double Norm() const = 0;

  // Makes the bend a short enough against v. Returns false if it is too long to
  // be used at all.
  virtual bool LimitBend(const Eigen::VectorXd& v,
                         Eigen::VectorXd* a) const = 0;

  // Returns false if the matrix is not positive definite to working precision.
  virtual bool Factorize(double lambda) = 0;

  // x of w (m), for the last lambda.
  virtual Eigen::VectorXd Solve(const Eigen::VectorXd& w) const = 0;
};

std::unique_ptr<DampedNormalEquations> MakeDenseNormalEquations();
std::unique_ptr<DampedNormalEquations> MakeSparseNormalEquations();

}  // namespace invgrad

#endif  // INVGRAD_RULES_DAMPED_NORMAL_EQUATIONS_H_
