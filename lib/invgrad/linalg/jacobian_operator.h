// The Jacobian J = dy/dx as an operator, which is seldom a matrix in memory.
//
//   J v,   J^T w,   J J^T,   J^T J,   and J itself only on request
//
// Shapes:  J: m x n (m = rows, n = cols);  v: n;  w: m.
// Cost:    stated by each implementation; a dense J costs 2 m n for a product
//          and m^2 n for the Gram matrix.
// Fails:   never by itself: entries that are not finite travel through. Sizes
//          that do not fit are CHECKed.
#ifndef INVGRAD_LINALG_JACOBIAN_OPERATOR_H_
#define INVGRAD_LINALG_JACOBIAN_OPERATOR_H_

#include <string>
#include <utility>

#include "Eigen/Core"
#include "Eigen/SparseCore"

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

  // The lower triangle of J J^T: m x m. What is above the diagonal is not
  // specified.
  virtual void Gram(Eigen::MatrixXd* JJt) const = 0;

  // J: m x n. The default of every other form of J.
  virtual void ToDense(Eigen::MatrixXd* J) const = 0;

  // The same of J^T J: n x n. By default from the dense J.
  virtual void ParameterGram(Eigen::MatrixXd* JtJ) const;

  // What a message calls a row: "row 12", and what it belongs to if known.
  virtual std::string RowName(int row) const;
};

// J stored as a column-major matrix.
class DenseJacobian final : public JacobianOperator {
 public:
  explicit DenseJacobian(Eigen::MatrixXd J) : J_(std::move(J)) {}

  int rows() const override { return static_cast<int>(J_.rows()); }
  int cols() const override { return static_cast<int>(J_.cols()); }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  void Gram(Eigen::MatrixXd* JJt) const override;
  void ToDense(Eigen::MatrixXd* J) const override { *J = J_; }
  void ParameterGram(Eigen::MatrixXd* JtJ) const override;

 private:
  Eigen::MatrixXd J_;
};

// J in compressed rows, as a ceres::Problem has it.
class SparseJacobian final : public JacobianOperator {
 public:
  using Matrix = Eigen::SparseMatrix<double, Eigen::RowMajor>;
  // Swapped in, because Eigen's sparse matrices do not move.
  explicit SparseJacobian(Matrix J) { J_.swap(J); }

  int rows() const override { return static_cast<int>(J_.rows()); }
  int cols() const override { return static_cast<int>(J_.cols()); }
  void Times(const Eigen::VectorXd& v, Eigen::VectorXd* Jv) const override;
  void TransposeTimes(const Eigen::VectorXd& w,
                      Eigen::VectorXd* Jtw) const override;
  void Gram(Eigen::MatrixXd* JJt) const override;
  void ToDense(Eigen::MatrixXd* J) const override { *J = J_; }
  void ParameterGram(Eigen::MatrixXd* JtJ) const override;

  const Matrix& matrix() const { return J_; }

 private:
  Matrix J_;
};

}  // namespace invgrad

#endif  // INVGRAD_LINALG_JACOBIAN_OPERATOR_H_
