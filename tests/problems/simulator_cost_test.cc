// The physics of our problems as cost functions of Ceres, against Ceres' own
// automatic differentiation of the same functors.

#include <cmath>
#include <memory>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "gtest/gtest.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/cost.h"
#include "invgrad/random.h"
#include "problems/equations/allen_cahn.h"
#include "problems/equations/burgers.h"
#include "problems/equations/heat.h"
#include "problems/equations/helmholtz.h"
#include "problems/equations/korteweg_de_vries.h"
#include "problems/equations/poisson_box.h"
#include "problems/exponential.h"
#include "problems/multimodal.h"
#include "problems/poisson_pinn.h"
#include "problems/sine.h"
#include "problems/squared_component.h"

namespace invgrad {
namespace simulator_cost_test {

using Eigen::VectorXd;

// P(x; c) - y* as a functor of Ceres.
template <typename Physics, int kContext>
struct Residual {
  template <typename T>
  bool operator()(const T* x, T* r) const {
    if constexpr (kContext > 0) {
      if (!physics(x, context.data(), r)) return false;
    } else {
      if (!physics(x, r)) return false;
    }
    for (int i = 0; i < target.size(); ++i) r[i] -= target[i];
    return true;
  }
  Physics physics;
  VectorXd context, target;
};

template <int kIn, int kOut, int kContext = 0, typename Physics>
void ExpectCeresAutoDiff(const Physics& physics) {
  NumpyRandom random(5);
  const auto uniform = [&random](int size) {
    VectorXd values(size);
    for (double& value : values) value = random.Uniform(-1.0, 1.0);
    return values;
  };
  const VectorXd context = uniform(kContext), target = uniform(kOut);
  const SimulatorCost cost(
      std::make_shared<AutoDiffSimulator<Physics, kIn, kOut, kContext>>(
          physics),
      target,
      context);
  using Functor = Residual<Physics, kContext>;
  const ceres::AutoDiffCostFunction<Functor, kOut, kIn> expected(
      new Functor{physics, context, target});
  for (int trial = 0; trial < 10; ++trial) {
    const VectorXd x = uniform(kIn);
    const double* const block = x.data();
    Eigen::Matrix<double, kOut, 1> r, expected_r;
    Eigen::Matrix<double, kOut * kIn, 1> J, expected_J;
    double* jacobian = J.data();
    double* expected_jacobian = expected_J.data();
    ASSERT_TRUE(cost.Evaluate(&block, r.data(), &jacobian));
    ASSERT_TRUE(
        expected.Evaluate(&block, expected_r.data(), &expected_jacobian));
    constexpr double kRounding = 1e-12;
    EXPECT_LE((r - expected_r).norm(), kRounding * (1.0 + r.norm()));
    EXPECT_LE((J - expected_J).norm(), kRounding * (1.0 + J.norm()));
  }
}

TEST(SimulatorCost, OfOurPhysicsIsCeresAutoDiffOfTheFunctor) {
  ExpectCeresAutoDiff<2, 2>(SquaredComponent::Physics());
  ExpectCeresAutoDiff<1, 1>(Exponential::Physics());
  ExpectCeresAutoDiff<1, 1>(Multimodal::Physics());
  ExpectCeresAutoDiff<2, 2>(SinePhysics{32.0, 45.0});
  ExpectCeresAutoDiff<4, 1, 3>(PoissonResidual());
  ExpectCeresAutoDiff<4, 1>(BurgersResidual{0.01});
  ExpectCeresAutoDiff<4, 1>(KortewegDeVriesResidual{4.84e-4});
  ExpectCeresAutoDiff<3, 1>(AllenCahnResidual{1e-4});
  ExpectCeresAutoDiff<3, 1>(HeatResidual());
  ExpectCeresAutoDiff<2, 1, 1>(LaplaceResidual());
  ExpectCeresAutoDiff<2, 1, 1>(HelmholtzResidual{2.0});
}

}  // namespace simulator_cost_test
}  // namespace invgrad
