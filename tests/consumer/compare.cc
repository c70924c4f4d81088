// `compare` for problems of this project, one of each kind.
//
//   own_compare --list
//   own_compare --problem=chain --rules=adam,half_inverse --steps=20

#include "invgrad/compare/compare.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/autodiff_cost_function.h"
#include "ceres/loss_function.h"
#include "invgrad/autodiff_simulator.h"
#include "invgrad/compare/sample_data.h"
#include "invgrad/loss.h"
#include "invgrad/random.h"
#include "invgrad/rules.h"
#include "invgrad/update_rule.h"

namespace {

using invgrad::OptionSet;

// y = (x_0, x_1^3 / 3 + x_1)
struct Physics {
  template <typename T>
  bool operator()(const T* x, T* y) const {
    y[0] = x[0];
    y[1] = x[1] * (1.0 + x[1] * x[1] / 3.0);
    return true;
  }
};
using PhysicsSimulator = invgrad::AutoDiffSimulator<Physics, 2, 2>;

// A network in front of it.
struct Chain {
  int num_samples = 32;
  int data_seed = 0;
  void Describe(OptionSet* set) {
    invgrad::DescribeSamples(1, 1e6, &num_samples, &data_seed, set);
  }
  bool Create(invgrad::LearningProblem* problem, std::string* error) const {
    if (!invgrad::MakeUniformData(
            {num_samples, 2, 4.0}, -1.0, 1.0, data_seed, problem, error)) {
      return false;
    }
    invgrad::DataSet all;
    all.targets = problem->data.transpose();
    all.inputs = all.targets;
    invgrad::SplitSamples(all, /*batch_size=*/8, problem);
    problem->model = std::make_shared<invgrad::Model>(
        invgrad::DenseNetwork({2, 6, 2}, invgrad::Activation::kTanh),
        std::make_shared<PhysicsSimulator>(),
        std::make_shared<invgrad::SquaredNormLoss>(2, 0.5),
        invgrad::Reduction::kMean);
    problem->num_epochs = 5;
    return true;
  }
};

// Its input alone.
struct Input {
  double start = 2.0;
  void Describe(OptionSet* set) {
    set->Add("start", &start, {-10.0, 10.0}, "both numbers of x");
  }
  bool Create(invgrad::PointProblem* problem, std::string* /*error*/) const {
    problem->simulator = std::make_shared<PhysicsSimulator>();
    problem->loss = std::make_shared<invgrad::SquaredNormLoss>(2, 0.5);
    problem->target = Eigen::Vector2d(1.0, 0.0);
    problem->start = Eigen::Vector2d::Constant(start);
    problem->minimizer = Eigen::Vector2d(1.0, 0.0);
    problem->minimum = 0.0;
    return true;
  }
};

// u' + rate u = 0, u(0) = 1, on [0, 1].
struct Residual {
  double rate;
  template <typename T>
  bool operator()(const T* u, T* y) const {
    y[0] = u[1] + rate * u[0];
    return true;
  }
};

struct Decay {
  double rate = 1.0;
  void Describe(OptionSet* set) {
    set->Add("rate", &rate, {0.0, 100.0}, "of the decay");
  }
  bool Create(invgrad::EquationProblem* problem, std::string* /*error*/) const {
    using Jet = invgrad::InputJet;
    constexpr int kNumPoints = 16;
    problem->box = {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Ones(1)};
    invgrad::TrialFunction& trial = problem->equation.trial;
    trial.derivatives = std::make_shared<invgrad::DerivativeSet>(
        "t", std::vector<std::string>{"t"});
    trial.features = invgrad::ScaledFeatures(problem->box);
    trial.boundary_values = [](const Jet* /*t*/, Jet* u) { u[0] = Jet(1.0); };
    trial.distance = [](const Jet* t, Jet* d) { d[0] = t[0]; };
    problem->equation.terms = {
        {"equation",
         std::make_shared<invgrad::AutoDiffSimulator<Residual, 2, 1>>(
             Residual{rate}),
         invgrad::GaussPoints(problem->box, {kNumPoints})}};
    problem->equation.hidden = {6};
    problem->test_counts = {21};
    problem->solution = [rate = rate](const Eigen::VectorXd& t) {
      return std::exp(-rate * t[0]);
    };
    return true;
  }
};

// Any ceres::Problem: two blocks, a robust loss, a start from the seed.
struct Valley {
  template <typename T>
  bool operator()(const T* x, const T* y, T* residual) const {
    residual[0] = 10.0 * (y[0] - x[0] * x[0]);
    residual[1] = 1.0 - x[0];
    return true;
  }
};

// [least_squares]
struct Rosenbrock {
  double robust = 100.0;
  void Describe(OptionSet* set) {
    set->Add("robust", &robust, {1e-3, 1e6}, "scale of Huber's loss");
  }
  bool Create(invgrad::LeastSquaresProblem* problem,
              std::string* /*error*/) const {
    problem->minimum = 0.0;
    problem->fill = [robust = robust](int seed, ceres::Problem* to_fill) {
      invgrad::NumpyRandom random(static_cast<std::uint32_t>(seed));
      auto x = std::make_shared<std::array<double, 2>>();
      *x = {random.Uniform(-2.0, -1.0), random.Uniform(0.5, 1.5)};
      to_fill->AddResidualBlock(
          new ceres::AutoDiffCostFunction<Valley, 2, 1, 1>(new Valley),
          new ceres::HuberLoss(robust),
          &(*x)[0],
          &(*x)[1]);
      return x;
    };
    return true;
  }
};
// [/least_squares]

// A rule of this project.
class SignStep final : public invgrad::UpdateRule {
 public:
  invgrad::LinearizationParts Needs() const override {
    invgrad::LinearizationParts parts;
    parts.gradient = true;
    return parts;
  }
  bool ComputeStep(const invgrad::Linearization& at,
                   Eigen::VectorXd* step,
                   std::string* /*error*/) override {
    *step = -1e-2 * at.gradient.cwiseSign();
    return true;
  }
};

}  // namespace

int main(int argc, char** argv) {
  invgrad::RegisterRule<SignStep>("sign", "step = -0.01 sign(gradient)");
  invgrad::RegisterProblem<Chain>(
      "chain", "y = (x_0, x_1 + x_1^3 / 3), L = 1/2 |y - y*|^2", "here");
  invgrad::RegisterProblem<Input>("input", "the same without network", "here");
  invgrad::RegisterProblem<Decay>("decay", "u' + rate u = 0, u(0) = 1", "here");
  invgrad::RegisterProblem<Rosenbrock>(
      "rosenbrock", "L = 1/2 rho(100 (y - x^2)^2 + (1 - x)^2)", "here");
  return invgrad::CompareMain(argc, argv);
}
