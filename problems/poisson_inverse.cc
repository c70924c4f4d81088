#include "problems/poisson_inverse.h"

#include <algorithm>
#include <complex>
#include <cstdint>
#include <memory>
#include <vector>

#include "fmt/core.h"
#include "invgrad/internal/scratch.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"
#include "problems/fields/fourier_grid.h"

namespace invgrad {

using Eigen::MatrixXd;

InverseLaplacian::InverseLaplacian(const SineGrid& grid)
    : DiagonalSimulator(grid.num_cells(),
                        grid.LaplacianEigenvalues().inverse()),
      grid_(grid) {}

void InverseLaplacian::Filter(const Eigen::ArrayXd& factors,
                              const double* x,
                              double* y) const {
  Scratch<double> modes(num_inputs());
  grid_.Transform(x, modes.data());
  Eigen::Map<Eigen::ArrayXd>(modes.data(), num_inputs()) *= factors;
  grid_.Transform(modes.data(), y);
}

MatrixXd PoissonInverse::RandomSources(int num_fields,
                                       int n,
                                       std::uint32_t seed) {
  constexpr double kWavesPerBox = 10.0;
  constexpr double kCoarsest = 0.1;
  const int size = n * n;
  const auto frequency = [n](int m) { return std::min(m, n - m); };
  // 1 / |m|^2; zero for modes that are cut off.
  Eigen::ArrayXd weights(size);
  for (int m_0 = 0; m_0 < n; ++m_0) {
    for (int m_1 = 0; m_1 < n; ++m_1) {
      const double square =
          frequency(m_0) * frequency(m_0) + frequency(m_1) * frequency(m_1);
      const double k = kWavesPerBox / n;
      weights[n * m_0 + m_1] = k * k * square <= kCoarsest ? 0.0 : 1.0 / square;
    }
  }
  const FourierGrid grid(n, n);
  std::vector<std::complex<double>> modes(grid.num_modes());
  NumpyRandom random(seed);
  MatrixXd fields(num_fields, size);
  Eigen::RowVectorXd field(size);
  for (int s = 0; s < num_fields; ++s) {
    const Eigen::VectorXd z = random.Normal(2 * size);
    const auto coefficient = [&](int m_0, int m_1) {
      const int m = n * m_0 + m_1;
      return weights[m] * std::complex<double>(z[2 * m], z[2 * m + 1]);
    };
    // The real part of the transform has the coefficients (z_m + z*_-m) / 2.
    int mode = 0;
    for (int m_0 = 0; m_0 < n; ++m_0) {
      for (int m_1 = 0; m_1 <= n / 2; ++m_1) {
        modes[mode++] = coefficient(m_0, m_1) +
                        std::conj(coefficient((n - m_0) % n, (n - m_1) % n));
      }
    }
    grid.Backward(modes.data(), field.data());
    fields.row(s) = field * (n / field.norm());
  }
  return fields;
}

bool PoissonInverse::Create(LearningProblem* problem,
                            std::string* error) const {
  const int size = resolution * resolution;
  UNetOptions u_net;
  u_net.rows = u_net.cols = resolution;
  const std::shared_ptr<const Network> network = field.Make(
      u_net, DenseNetwork({size, 128, 128, size}, Activation::kRelu), error);
  if (network == nullptr) return false;
  const auto generate = [n = resolution](int num_fields, std::uint32_t seed) {
    return RandomSources(num_fields, n, seed);
  };
  const auto generate_all = [&](int num_rows) {
    return generate(num_rows, data_seed);
  };
  const SampleSize sample_size = {
      num_samples, size, 3.0 * size, fmt::format(":resolution={}", resolution)};
  if (!MakeData(sample_size, generate_all, problem, error)) return false;
  const auto simulator =
      std::make_shared<InverseLaplacian>(SineGrid(resolution, resolution));
  SplitSamples(
      SamplesOfFields(*simulator, problem->data.transpose()), 128, problem);
  const auto make_samples = [simulator, generate](int num, std::uint32_t seed) {
    return SamplesOfFields(*simulator, generate(num, seed).transpose());
  };
  problem->source = field.MakeSource(make_samples, "random sources", data_seed);
  problem->input_shape = {1, resolution, resolution};
  problem->metric = SolutionDistance("x_l1");
  problem->num_epochs = 25;
  problem->model =
      std::make_shared<Model>(network,
                              simulator,
                              std::make_shared<SquaredNormLoss>(size, 0.5),
                              Reduction::kSum);
  return true;
}

}  // namespace invgrad
