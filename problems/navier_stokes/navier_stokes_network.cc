#include "problems/navier_stokes/navier_stokes_network.h"

#include <cmath>
#include <cstdint>
#include <memory>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/random.h"
#include "problems/navier_stokes/navier_stokes.h"
#include "problems/navier_stokes/time_reversal.h"

namespace invgrad {

using Eigen::MatrixXd;

bool NavierStokesNetwork::Create(LearningProblem* problem,
                                 std::string* error) const {
  NavierStokesSettings settings;
  settings.cells = resolution;
  const int size = resolution * resolution;
  UNetOptions u_net;
  u_net.rows = u_net.cols = resolution;
  u_net.in_channels = u_net.out_channels = 2;
  const std::shared_ptr<const Network> network = field.Make(
      u_net,
      DenseNetwork({2 * size, 128, 128, 2 * size}, Activation::kRelu),
      error);
  if (network == nullptr) return false;
  const auto generate = [settings](int num_fields, std::uint32_t seed) {
    NumpyRandom random(seed);
    return RandomNavierStokesFields(settings, num_fields, &random);
  };
  const auto generate_all = [&](int num_rows) -> MatrixXd {
    return generate(num_rows, data_seed).transpose();
  };
  const SampleSize sample_size = {num_samples,
                                  3 * size,
                                  6.0 * size,
                                  fmt::format(":resolution={}", resolution)};
  if (!MakeData(sample_size, generate_all, problem, error)) return false;
  const MatrixXd fields = problem->data.transpose();
  const double deformation = GreatestDeformation(settings, fields);
  if (deformation > 1.0) {
    LOG(WARNING) << fmt::format(
        "navier_stokes: dt |du/dx| is {:.3g} in the data, and a flow needs "
        "less "
        "than 1: look-ups of neighbouring cells cross. The velocities are too "
        "steep for time steps of {}; the fastest moves {:.3g} cells a step.",
        deformation,
        settings.kTime / settings.kNumSteps,
        settings.courant() * fields.bottomRows(2 * size).cwiseAbs().maxCoeff());
  }
  SplitSamples(NavierStokesSamples(settings, fields), 64, problem);
  const auto make_samples = [settings, generate](int num, std::uint32_t seed) {
    return NavierStokesSamples(settings, generate(num, seed));
  };
  problem->source = field.MakeSource(make_samples, "random flows", data_seed);
  problem->metric =
      Metric{"velocity_error",
             [](const MatrixXd& x, const DataSet& samples) {
               return MeanVelocityError(x, samples.solutions);
             },
             NavierStokesSettings::kFluctuation * std::sqrt(0.5 * M_PI)};
  const auto simulator = std::make_shared<NavierStokesSimulator>(settings);
  problem->inverse = std::make_shared<TimeReversal>(
      simulator,
      reversal == "straight" ? TimeReversal::Way::kStraight
                             : TimeReversal::Way::kReleased);
  problem->input_shape = {2, resolution, resolution};
  problem->num_epochs = 25;
  problem->model =
      std::make_shared<Model>(network,
                              simulator,
                              std::make_shared<CoarseShapeLoss>(resolution),
                              Reduction::kMean);
  return true;
}

}  // namespace invgrad
