// A linear simulator that a fast transform F makes diagonal.
//
//   y = P(x) = F^-1(e F(x)),   e real,   J = J^T
//
// A derived class gives e and the filter x -> F^-1(factors F(x)), which is
// symmetric for all real factors. The singular values of J are |e|, so an
// inverse power of J is a filter with the factors sign(e) |e|^-kappa.
//
// Shapes:  x, y: N cells;  e: one number a mode, in the order of the transform.
// Cost:    y, J^T w, J v, InversePower: one filter. J is formed once, for
//          small grids only (forms_jacobian), and copied for each sample.
// Fails:   returns false if y is not finite.
#ifndef PROBLEMS_FIELDS_DIAGONAL_SIMULATOR_H_
#define PROBLEMS_FIELDS_DIAGONAL_SIMULATOR_H_

#include <memory>
#include <mutex>

#include "Eigen/Core"
#include "invgrad/simulator.h"

namespace invgrad {

class DiagonalSimulator : public Simulator {
 public:
  int num_inputs() const final { return num_cells_; }
  int num_outputs() const final { return num_cells_; }
  // e.
  const Eigen::ArrayXd& eigenvalues() const { return eigenvalues_; }

  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const final;
  bool forms_jacobian() const final { return num_cells_ <= 1024; }
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const final;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const final;
  bool has_weighted_hessian() const final { return true; }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const final;
  bool is_linear() const final { return true; }
  void InversePower(double kappa,
                    double tau,
                    const double* d_y,
                    double* d_x) const final;

 protected:
  DiagonalSimulator(int num_cells, Eigen::ArrayXd eigenvalues);

 private:
  // y = F^-1(factors F(x)).
  virtual void Filter(const Eigen::ArrayXd& factors,
                      const double* x,
                      double* y) const = 0;
  // J: N x N. By default N filters of unit vectors.
  virtual void FormJacobian(double* jacobian) const;

  int num_cells_;
  Eigen::ArrayXd eigenvalues_;
  mutable std::once_flag once_;
  mutable Eigen::MatrixXd jacobian_;  // if forms_jacobian(), when needed
};

}  // namespace invgrad

#endif  // PROBLEMS_FIELDS_DIAGONAL_SIMULATOR_H_
