// The Jacobian J = dy/dx as a linear operator, usually without storing J.
//
//   J v,   J^T w,   J J^T,   J^T J,   and J itself only on request
//
// An implementation defines sizes and the two products. What few rules need is an
// interface that it may also implement: groups of columns (layered_jacobian.h),
// rows that several processes share (shared_jacobian.h).
//
// Shapes:  J: m x n (m = rows, n = cols);  v: n;  w: m.
// Cost:    stated by each implementation; a dense J costs 2 m n for a product
//          and m^2 n for the Gram matrix.
// Fails:   never; entries that are not finite give results that are not finite.
//          Sizes are CHECKed.
#ifndef INVGRAD_JACOBIAN_OPERATOR_H_
#define INVGRAD_JACOBIAN_OPERATOR_H_

#include <functional>
#include <string>

#include "Eigen/Core"

namespace invgrad {

class JacobianOperator {
 public:
  virtual ~JacobianOperator() = default;

  virtual int rows() const = 0;
  virtual int cols() const = 0;

  // J v: m.
  virtual void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const = 0;

  // J^T w: n.
  virtual void TransposeTimes(const Eigen::VectorXd& w,
                              Eigen::VectorXd* Jtw) const = 0;

  // The lower triangle of J J^T: m x m. Entries above the diagonal are
  // unspecified. By default from the dense J.
  virtual void Gram(Eigen::MatrixXd* JJt) const;

  // The lower triangle of J^T J: n x n. By default from the dense J.
  virtual void ParameterGram(Eigen::MatrixXd* JtJ) const;

  // J: m x n. By default min(m, n) products with unit vectors.
  virtual void ToDense(Eigen::MatrixXd* J) const;

  // The name of a row in messages: "row 12", and its sample or residual block
  // if known.
  virtual std::string RowName(int row) const;
};

// J given by its two products.
class FunctionJacobian final : public JacobianOperator {
 public:
  // *out = J v, or J^T w; the functions set the size of *out.
  using Product =
      std::function<void(const Eigen::VectorXd& in, Eigen::VectorXd* out)>;

  FunctionJacobian(int rows, int cols, Product times, Product transpose_times);

  int rows() const override { return rows_; }
  int cols() const override { return cols_; }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;

 private:
  int rows_;
  int cols_;
  Product times_;
  Product transpose_times_;
};

}  // namespace invgrad

#endif  // INVGRAD_JACOBIAN_OPERATOR_H_
