// `estimate` for least-squares problems of this project.
//
//   own_estimate --seeds=1..5 --methods=ceres_lm,ceres_lm+half_inverse

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>

#include "ceres/autodiff_cost_function.h"
#include "invgrad/compare/compare.h"
#include "invgrad/random.h"

namespace {

// y = amplitude exp(-rate t), at a time with a measured value.
struct Measurement {
  double t, y;
  template <typename T>
  bool operator()(const T* b, T* residual) const {
    using std::exp;
    residual[0] = b[0] * exp(-b[1] * t) - y;
    return true;
  }
};

struct Decay {
  double rate = 1.0;
  void Describe(invgrad::OptionSet* set) {
    set->Add("rate", &rate, {1e-3, 10.0}, "of the measured decay");
  }
  bool Create(invgrad::LeastSquaresProblem* problem,
              std::string* /*error*/) const {
    problem->minimum = 0.0;
    problem->fill = [rate = rate](int seed, ceres::Problem* to_fill) {
      invgrad::NumpyRandom random(static_cast<std::uint32_t>(seed));
      auto b = std::make_shared<std::array<double, 2>>();
      *b = {random.Uniform(0.5, 2.0), random.Uniform(0.1, 3.0)};
      for (int i = 0; i < 8; ++i) {
        const double t = 0.25 * i;
        to_fill->AddResidualBlock(
            new ceres::AutoDiffCostFunction<Measurement, 1, 2>(
                new Measurement{t, 3.0 * std::exp(-rate * t)}),
            nullptr,
            b->data());
      }
      return b;
    };
    return true;
  }
};

}  // namespace

int main(int argc, char** argv) {
  invgrad::RegisterProblem<Decay>("decay", "3 exp(-rate t)", "here");
  return invgrad::EstimateMain(argc, argv);
}
