// Where must a shuttlecock be sent so that it is at a given place one second
// later? All of `compare` for this problem: compare_methods.md.
//
// Sample runs:
//
//   compare_methods --list
//   compare_methods --seconds=2 --overwrite
//   compare_methods --rules=half_inverse:step_size=auto,ceres_lbfgs --overwrite

#include <cstdint>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/compare.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"
#include "shuttlecock_flight.h"

// [problem]
struct Shuttlecock {
  int num_samples = 512;
  int data_seed = 0;
  void Describe(invgrad::OptionSet* set) {
    invgrad::DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
  }

  bool Create(invgrad::LearningProblem* problem, std::string* error) const {
    const auto draw_targets = [this](int num_rows) {
      invgrad::NumpyRandom random(static_cast<std::uint32_t>(data_seed));
      Eigen::MatrixXd targets(num_rows, 2);
      for (auto target : targets.rowwise()) {
        target[0] = random.Uniform(1.0, 12.0);  // distance [m]
        target[1] = random.Uniform(-1.0, 2.0);  // height [m]
      }
      return targets;
    };
    // 2 columns; 4 numbers a sample: its input and its target.
    if (!invgrad::MakeData(
            {num_samples, 2, 4.0}, draw_targets, problem, error)) {
      return false;
    }
    invgrad::DataSet all;
    all.targets = problem->data.transpose();
    all.inputs = all.targets;  // the network sees the target
    invgrad::SplitSamples(all, /*batch_size=*/32, problem);
    problem->model = std::make_shared<invgrad::Model>(
        invgrad::DenseNetwork({2, 16, 16, 2}, invgrad::Activation::kTanh),
        std::make_shared<invgrad::AutoDiffSimulator<Flight, 2, 2>>(),
        std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
        invgrad::Reduction::kMean);
    return true;
  }
};
// [/problem]

// [main]
int main(int argc, char** argv) {
  invgrad::RegisterProblem<Shuttlecock>(
      "shuttlecock",
      "q'' = -|q'| q' / l - (0, g), x = q'(0), L = 1/2 |q(1 s) - y*|^2",
      "Cohen et al., New J. Phys. 17 (2015)");
  return invgrad::CompareMain(argc, argv);
}
// [/main]
