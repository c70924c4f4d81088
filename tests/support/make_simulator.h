// Simulators for tests.
#ifndef TESTS_MAKE_SIMULATOR_H_
#define TESTS_MAKE_SIMULATOR_H_

#include <memory>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/linear_simulator.h"

namespace invgrad {

template <int kIn, int kOut, typename Functor>
std::shared_ptr<const Simulator> MakeSimulator(Functor functor = Functor()) {
  return std::make_shared<AutoDiffSimulator<Functor, kIn, kOut>>(functor);
}

// y = A x
inline std::shared_ptr<const Simulator> MakeLinear(const Eigen::MatrixXd& A) {
  return std::make_shared<LinearSimulator>(
      LinearSimulator::Matrix(A.sparseView()), Eigen::VectorXd::Zero(A.rows()));
}

}  // namespace invgrad

#endif  // TESTS_MAKE_SIMULATOR_H_
