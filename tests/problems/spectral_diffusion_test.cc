#include "problems/spectral_diffusion.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "tests/problems/heat_fields.h"
#include "tests/support/simulator_identities.h"

namespace invgrad {
namespace spectral_diffusion_test {

using Eigen::VectorXd;
using RowMajorMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

TEST(FourierGrid, IsTheSumOfItsHeaderAndItsInverse) {
  for (const Shape& shape : kShapes) {
    const FourierGrid grid(shape.rows, shape.cols);
    const VectorXd x = RandomField(grid.num_cells(), 1);
    std::vector<std::complex<double>> modes(grid.num_modes());
    grid.Forward(x.data(), modes.data());
    for (int m_0 = 0; m_0 < shape.rows; ++m_0) {
      for (int m_1 = 0; m_1 <= shape.cols / 2; ++m_1) {
        const int mode = m_0 * (shape.cols / 2 + 1) + m_1;
        const std::complex<double> sum(
            Wave(shape, m_0, m_1, 0.0).dot(x),
            Wave(shape, m_0, m_1, 0.5 * M_PI).dot(x));
        EXPECT_LT(std::abs(modes[mode] - sum), 1e-13) << m_0 << ", " << m_1;
        const int centred = 2 * m_0 < shape.rows ? m_0 : m_0 - shape.rows;
        EXPECT_NEAR(grid.SquaredWaveNumbers()[mode],
                    SquaredWaveNumber(shape, centred, m_1),
                    1e-13);
      }
    }
    VectorXd again(grid.num_cells());
    grid.Backward(modes.data(), again.data());
    EXPECT_LT((again - x).norm(), 1e-14);
  }
}

TEST(SpectralDiffusion, WavesDecayByTheClosedForm) {
  const double diffusion = 0.3;
  for (const Shape& shape : kShapes) {
    const auto simulator = MakeDiffusion(shape, diffusion);
    for (int m_0 = 0; 2 * m_0 < shape.rows; ++m_0) {
      for (int m_1 = 0; 2 * m_1 < shape.cols; ++m_1) {
        const VectorXd x = Wave(shape, m_0, m_1, 0.7);
        const double decay =
            std::exp(-diffusion * SquaredWaveNumber(shape, m_0, m_1));
        EXPECT_LT((Outputs(*simulator, x) - decay * x).norm(), 1e-14)
            << m_0 << ", " << m_1;
      }
    }
  }
}

TEST(SpectralDiffusion, ConservesTheMeanAndShrinksTheNorm) {
  for (const Shape& shape : kShapes) {
    const auto simulator = MakeDiffusion(shape, 2.0);
    const VectorXd x = RandomField(simulator->num_inputs(), 2);
    const VectorXd y = Outputs(*simulator, x);
    EXPECT_NEAR(y.mean(), x.mean(), 1e-15);
    EXPECT_LT(y.norm(), x.norm());
  }
}

// P_a P_b = P_(a + b), P_0 = 1.
TEST(SpectralDiffusion, TimesAdd) {
  for (const Shape& shape : kShapes) {
    const VectorXd x = RandomField(shape.rows * shape.cols, 3);
    const VectorXd twice = Outputs(*MakeDiffusion(shape, 0.5),
                                   Outputs(*MakeDiffusion(shape, 0.2), x));
    EXPECT_LT((twice - Outputs(*MakeDiffusion(shape, 0.7), x)).norm(), 1e-14);
    EXPECT_LT((x - Outputs(*MakeDiffusion(shape, 0.0), x)).norm(), 1e-14);
  }
}

// P is linear, so that J x = P x exactly and P's own differences say no more.
TEST(SpectralDiffusion, JacobianIsTheMap) {
  for (const Shape& shape : kShapes) {
    const auto simulator = MakeDiffusion(shape, 0.4);
    const int size = simulator->num_inputs();
    const VectorXd x = RandomField(size, 7);
    VectorXd y(size);
    RowMajorMatrix J(size, size);
    ASSERT_TRUE(simulator->Evaluate(x.data(), nullptr, y.data(), J.data()));
    EXPECT_EQ(y, Outputs(*simulator, x));
    EXPECT_LT((J * x - y).norm(), 1e-14);
    for (int i = 0; i < size; ++i) {
      const VectorXd unit = VectorXd::Unit(size, i);
      EXPECT_LT((J.col(i) - Outputs(*simulator, unit)).norm(), 1e-14);
    }
    EXPECT_LT((J - J.transpose()).norm(), 1e-14);
  }
}

// The continuous heat kernel is positive: no new extremes. On a grid that holds
// for states whose spectrum it resolves, and once diffusion has cut it off:
// exp(-2 pi^2) = 3e-9 is left of the highest mode here.
TEST(SpectralDiffusion, MakesNoNewExtremes) {
  const Shape shape = {32, 32};
  const auto simulator = MakeDiffusion(shape, 2.0);
  const VectorXd x = RandomField(simulator->num_inputs(), 8);
  const VectorXd y = Outputs(*simulator, x);
  EXPECT_LT(y.maxCoeff(), x.maxCoeff());
  EXPECT_GT(y.minCoeff(), x.minCoeff());
  const VectorXd impulse = VectorXd::Unit(simulator->num_inputs(), 100);
  EXPECT_GT(Outputs(*simulator, impulse).minCoeff(), -1e-8);
}

TEST(SpectralDiffusion, IsAppliedWhereTheJacobianIsTooLarge) {
  EXPECT_TRUE(MakeDiffusion({32, 32}, 0.4)->forms_jacobian());
  for (const Shape& shape : {Shape{6, 5}, Shape{33, 32}}) {
    const auto simulator = MakeDiffusion(shape, 0.4);
    EXPECT_EQ(simulator->forms_jacobian(), shape.rows < 33);
    const VectorXd x = RandomField(simulator->num_inputs(), 10);
    ExpectAdjointIdentity(*simulator, x, nullptr);
  }
}

TEST(SpectralDiffusion, FailsWhereAValueIsNotFinite) {
  const auto simulator = MakeDiffusion({4, 4}, 1.0);
  VectorXd x = VectorXd::Zero(16);
  x[3] = NAN;
  VectorXd y(16), x_bar(16);
  EXPECT_FALSE(simulator->Evaluate(x.data(), nullptr, y.data(), nullptr));
  const auto ones = [](const double*, double* w) {
    std::fill_n(w, 16, 1.0);
    return true;
  };
  EXPECT_FALSE(
      simulator->Adjoint(x.data(), nullptr, ones, y.data(), x_bar.data()));
  x[3] = 0.0;
  EXPECT_TRUE(
      simulator->Adjoint(x.data(), nullptr, ones, y.data(), x_bar.data()));
  EXPECT_FALSE(simulator->Adjoint(
      x.data(),
      nullptr,
      [](const double*, double*) { return false; },
      y.data(),
      x_bar.data()));
}

TEST(SpectralDiffusion, GivesTheSameBitsInEveryThreadAndAtEveryAddress) {
  const auto simulator = MakeDiffusion({16, 16}, 0.5);
  const VectorXd x = RandomField(256, 9);
  const VectorXd y = Outputs(*simulator, x);
  std::vector<VectorXd> results(4);
  std::vector<std::thread> threads;
  for (size_t offset = 0; offset < results.size(); ++offset) {
    threads.emplace_back([&, offset]() {
      for (int repeat = 0; repeat < 100; ++repeat) {
        VectorXd memory(256 + offset), outputs(256 + offset);
        memory.tail(256) = x;
        if (!simulator->Evaluate(memory.data() + offset,
                                 nullptr,
                                 outputs.data() + offset,
                                 nullptr)) {
          return;
        }
        results[offset] = outputs.tail(256);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (const VectorXd& result : results) EXPECT_EQ(result, y);
}

}  // namespace spectral_diffusion_test
}  // namespace invgrad
