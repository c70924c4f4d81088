// The Schroedinger equation of a particle in a box under a dipole field.
//
//   i d psi/dt = H psi,   H = -d_xx + u(t) x,   psi(0) = psi(length) = 0
//
// discretized by central differences on the points x_k = k dx inside the box
// and by the scheme of Crank and Nicolson, u constant in a step [1]:
//
//   A_t phi_t = psi_t,   psi_{t+1} = 2 phi_t - psi_t,   A_t = 1 + i dt/2 H(u_t)
//
// which is (1 + i dt/2 H) psi_{t+1} = (1 - i dt/2 H) psi_t with the midpoint
// phi_t = (psi_t + psi_{t+1}) / 2. A step is unitary, of order 2 in dt, and a
// step with -dt reverses it.
//
// With X = diag(x_k), dpsi_{t+1}/du_t = -i dt A_t^-1 X phi_t. A_t is symmetric
// (not Hermitian), so the solves and updates of the forward pass also chain
// rows c^T of dpsi_N/dpsi_t backwards:
//
//   Jacobian, pull-back   q = A_t^-1 c,   dy_c/du_t = -i dt q^T X phi_t,
//                         c = 2 q - c
//   Hessian, s < t        -i dt q^T X A_t^-1 dpsi_t/du_s;
//            s = t        -i dt q^T X dpsi_{t+1}/du_t
//
// Shapes:  psi, context (the start), y (the end): 28, for each of 14 points
//          real part, imaginary part;  x = u_0 .. u_{N-1}: N = num_steps.
// Units:   hbar = 2 m = 1; |psi|^2 sums to 1 without the weight dx.
// Cost:    a step factors A_t once. J: 14 solves a step, side by side;
//          pull-back: one solve; Hessian: N / 2 solves a step.
// Fails:   returns false if a value is not finite. The elimination cannot fail,
//          because the pivots of A_t have real parts of at least one for any u.
//          CHECKs that num_steps > 0 and dt is finite and not zero.
// Facts:   the norm is conserved: y^T J = 0, so J is never of full rank.
//
// [1] Schnell, Holl, Thuerey. Half-Inverse Gradients for Physical Deep
//     Learning. ICLR 2022, section 3.4, arXiv 2203.10131; code
//     Quantum_dipole/solver.py.
#ifndef PROBLEMS_SCHROEDINGER_H_
#define PROBLEMS_SCHROEDINGER_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/simulator.h"

namespace invgrad {

class SchroedingerSimulator final : public Simulator {
 public:
  static constexpr int kNumPoints = 14;  // inside the box
  static constexpr int kStateSize = 2 * kNumPoints;
  static constexpr double kLength = 2.0;
  static constexpr double kSpacing = kLength / (kNumPoints + 1);  // dx

  // A negative dt goes back in time.
  SchroedingerSimulator(int num_steps, double dt);

  // sin(n pi x / length), n = 1 .. 14, normalized and real: the eigenstates of
  // the discretized H at u = 0.
  static Eigen::VectorXd Eigenstate(int n);

  int num_inputs() const override { return num_steps_; }
  int num_outputs() const override { return kStateSize; }
  int num_context() const override { return kStateSize; }

  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override;
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override;
  // J's rows are computed side by side; values and pull-backs in lanes.
  int EvaluateBatch(int count,
                    const double* x,
                    const double* contexts,
                    double* y,
                    double* jacobians) const override;
  int AdjointBatch(int count,
                   const double* x,
                   const double* contexts,
                   const BatchCovector& covector,
                   double* x_bar) const override;
  std::string WhyNoLanes() const override { return ""; }
  bool has_weighted_hessian() const override { return true; }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override;
  std::string DescribeFailure(const double* x,
                              const double* context) const override;

 private:
  template <int kWidth>
  using Values = Eigen::Array<double, kWidth, 1>;
  // kWidth complex functions on the points, side by side: column k is point k.
  template <int kWidth>
  struct GridFunctions {
    Eigen::Array<double, kWidth, kNumPoints> re;
    Eigen::Array<double, kWidth, kNumPoints> im;
  };
  using GridFunction = GridFunctions<1>;
  // Results of a step for the backward pass, of kWidth samples.
  template <int kWidth>
  struct Steps {
    GridFunctions<kWidth> inverse_pivots;  // of A_t, scaled: see Factor
    GridFunctions<kWidth> source;          // -i dt X phi_t
  };
  using Step = Steps<1>;
  static constexpr int kLanes = 4;
  using LaneStep = Steps<kLanes>;

  // Fills the inverse pivots of all steps.
  void Factor(const double* x, Step* steps) const;
  // The same for four samples; x: one column a sample.
  void FactorLanes(const double* x, LaneStep* steps) const;
  // RollOut and Adjoint for four samples from sample `first` on; x, contexts, y
  // and x_bar: theirs, one column a sample.
  bool RollOutLanes(const double* x,
                    const double* contexts,
                    LaneStep* steps,
                    double* y) const;
  bool AdjointLanes(int first,
                    const double* x,
                    const double* contexts,
                    const BatchCovector& covector,
                    double* x_bar) const;
  // Computes A^-1 c: one A for all functions (kNumPivots = 1), or one for each.
  template <int kNumPivots, int kWidth>
  void Solve(const GridFunctions<kNumPivots>& inverse_pivots,
             const GridFunctions<kWidth>& c,
             GridFunctions<kWidth>* solution) const;
  // Sums f g over the points, without conjugation: kWidth complex numbers.
  template <int kWidth, int kNumFactors>
  static void Dot(const GridFunctions<kWidth>& f,
                  const GridFunctions<kNumFactors>& g,
                  Values<kWidth>* re,
                  Values<kWidth>* im);
  // -i dt X f.
  GridFunction Source(const GridFunction& f) const;
  static GridFunction FromState(const double* state);
  static bool IsFinite(const GridFunction& f) {
    return f.re.allFinite() && f.im.allFinite();
  }
  // Computes y, and fills the steps.
  bool RollOut(const double* x,
               const double* context,
               Step* steps,
               double* y) const;
  // Starts from c with Re c^T y = w . y and calls visit(t, q), q = A_t^-1 c,
  // from the last step to the first.
  template <typename Visit>
  void ChainBack(const double* w, const Step* steps, const Visit& visit) const;

  int num_steps_;
  double dt_;
  double scale_;  // 2 dx^2 / dt
};

}  // namespace invgrad

#endif  // PROBLEMS_SCHROEDINGER_H_
