// A linear simulator.
//
//   y = A x + b,   J = A
//
// Shapes:  A: |y| x |x|, sparse;  b: |y|.
// Cost:    one pass over the stored entries of A; J takes |y| |x| more.
// Fails:   returns false if y is not finite. Sizes that do not fit are CHECKed.
#ifndef INVGRAD_CHAIN_LINEAR_SIMULATOR_H_
#define INVGRAD_CHAIN_LINEAR_SIMULATOR_H_

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/chain/simulator.h"

namespace invgrad {

class LinearSimulator final : public Simulator {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;

  LinearSimulator(const Matrix& A, Eigen::VectorXd b);

  int num_inputs() const override { return static_cast<int>(A_.cols()); }
  int num_outputs() const override { return static_cast<int>(A_.rows()); }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override;
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;

 private:
  Matrix A_;
  Eigen::VectorXd b_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_LINEAR_SIMULATOR_H_
