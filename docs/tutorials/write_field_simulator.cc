// Writes a simulator of a flow with its tangent and its adjoint, checks both,
// and finds an initial state with them.
//
// Sample run, which writes flow_states.txt and flow_losses.txt:
//
//   build/release/bin/write_field_simulator
//
// docs/tutorials/write_field_simulator.md explains each part.

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gflags/gflags.h"
#include "glog/logging.h"
#include "invgrad/blas_threads.h"
#include "invgrad/field_simulator.h"
#include "invgrad/loss.h"
#include "invgrad/method.h"
#include "invgrad/minimize.h"

DEFINE_double(seconds, 1.0, "time of each rule");
DEFINE_string(rules,
              "gradient_descent:step_size=1,adam:step_size=3e-3,"
              "krylov:iterations=20:rho=1,hessian_free",
              "rules, separated by commas");
DEFINE_string(folder, ".", "where the text files are written");

namespace {

using Eigen::ArrayXd;
using Eigen::VectorXd;

constexpr int kNumCells = 128;
constexpr int kNumSteps = 50;

// [step]
// The water in each cell of a ring: depth h, and m = h u, u the velocity.
struct Water {
  ArrayXd h, m;
};

constexpr double kRatio = 0.5;       // dt / dx
constexpr double kDiffusion = 0.25;  // stable: (kRatio speed)^2 / 2 to 1/2

// f_{i+1} - f_{i-1}: the transpose is minus the difference.
ArrayXd Difference(const ArrayXd& f) {
  return ArrayXd::NullaryExpr(kNumCells, [&](Eigen::Index i) {
    return f[(i + 1) % kNumCells] - f[(i + kNumCells - 1) % kNumCells];
  });
}

// f_i + a (f_{i-1} - 2 f_i + f_{i+1}): symmetric.
ArrayXd Diffused(const ArrayXd& f) {
  return ArrayXd::NullaryExpr(kNumCells, [&](Eigen::Index i) {
    return f[i] + kDiffusion * (f[(i + 1) % kNumCells] - 2.0 * f[i] +
                                f[(i + kNumCells - 1) % kNumCells]);
  });
}

// dh/dt + d(h u)/dx = 0,   d(h u)/dt + d(h u^2 + h^2 / 2)/dx = 0
Water Step(const Water& w) {
  return {
      Diffused(w.h) - 0.5 * kRatio * Difference(w.m),
      Diffused(w.m) -
          0.5 * kRatio * Difference(w.m.square() / w.h + 0.5 * w.h.square())};
}
// [/step]

// [tangent]
// The change of Step(w) for a change d of w: the flux of m changes by
// (h - u^2) dh + 2 u dm.
Water StepTangent(const Water& w, const Water& d) {
  const ArrayXd u = w.m / w.h;
  return {
      Diffused(d.h) - 0.5 * kRatio * Difference(d.m),
      Diffused(d.m) -
          0.5 * kRatio * Difference((w.h - u.square()) * d.h + 2.0 * u * d.m)};
}
// [/tangent]

// [adjoint]
// The transpose: every term of StepTangent read from the right to the left.
Water StepAdjoint(const Water& w, const Water& bar) {
  const ArrayXd u = w.m / w.h;
  const ArrayXd flux_bar = 0.5 * kRatio * Difference(bar.m);
  return {
      Diffused(bar.h) + (w.h - u.square()) * flux_bar,
      Diffused(bar.m) + 2.0 * u * flux_bar + 0.5 * kRatio * Difference(bar.h)};
}
// [/adjoint]

// [simulator]
// y: the depths after kNumSteps steps from water at rest of depths x.
class Channel final : public invgrad::FieldSimulator {
 public:
  int num_inputs() const override { return kNumCells; }
  int num_outputs() const override { return kNumCells; }

  bool Value(const double* x,
             const double* /*context*/,
             double* y) const override {
    Water w = AtRest(x);
    for (int t = 0; t < kNumSteps; ++t) w = Step(w);
    Eigen::Map<ArrayXd>(y, kNumCells) = w.h;
    return invgrad::AllFinite(y, kNumCells);
  }

  std::unique_ptr<const invgrad::JacobianOperator> Linearize(
      const double* x, const double* /*context*/, double* y) const override {
    // The state before each step: both products need it.
    auto states = std::make_shared<std::vector<Water>>();
    Water w = AtRest(x);
    for (int t = 0; t < kNumSteps; ++t) {
      states->push_back(w);
      w = Step(w);
    }
    Eigen::Map<ArrayXd>(y, kNumCells) = w.h;
    if (!invgrad::AllFinite(y, kNumCells)) return nullptr;
    return std::make_unique<invgrad::FunctionJacobian>(
        kNumCells,
        kNumCells,
        [states](const VectorXd& v, VectorXd* Jv) {
          Water d = AtRest(v.data());
          for (const Water& w : *states) d = StepTangent(w, d);
          *Jv = d.h;
        },
        [states](const VectorXd& y_bar, VectorXd* x_bar) {
          Water bar = AtRest(y_bar.data());
          for (auto w = states->rbegin(); w != states->rend(); ++w) {
            bar = StepAdjoint(*w, bar);
          }
          *x_bar = bar.h;
        });
  }

 private:
  static Water AtRest(const double* h) {
    return {Eigen::Map<const ArrayXd>(h, kNumCells), ArrayXd::Zero(kNumCells)};
  }
};
// [/simulator]

// [check]
// Prints the errors of both products at x, for random v and w.
void Check(const Channel& channel, const VectorXd& x) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  const auto random = [&] { return normal(generator); };
  const VectorXd v = VectorXd::NullaryExpr(kNumCells, random);
  const VectorXd w = VectorXd::NullaryExpr(kNumCells, random);
  VectorXd y(kNumCells), Jv, Jtw;
  const auto J = channel.Linearize(x.data(), nullptr, y.data());
  CHECK(J != nullptr);
  J->Times(v, &Jv);
  J->TransposeTimes(w, &Jtw);
  std::printf("adjoint identity: %.0e\n",
              std::abs(w.dot(Jv) - v.dot(Jtw)) / (w.norm() * Jv.norm()));
  for (const double h : {1e-2, 1e-3, 1e-4}) {
    VectorXd plus(kNumCells), minus(kNumCells);
    const VectorXd right = x + h * v, left = x - h * v;
    CHECK(channel.Value(right.data(), nullptr, plus.data()));
    CHECK(channel.Value(left.data(), nullptr, minus.data()));
    std::printf("tangent, h = %.0e: %.0e\n",
                h,
                ((plus - minus) / (2.0 * h) - Jv).norm() / Jv.norm());
  }
}
// [/check]

// Depth 1, with two hills.
VectorXd Truth() {
  return VectorXd::NullaryExpr(kNumCells, [](Eigen::Index i) {
    const auto hill = [i](double centre, double width) {
      return std::exp(-std::pow((i - centre) / width, 2));
    };
    return 1.0 + 0.3 * hill(44.0, 8.0) + 0.2 * hill(84.0, 5.0);
  });
}

}  // namespace

int main(int argc, char** argv) {
  invgrad::SetBlasThreads(1);
  gflags::SetUsageMessage("finds what the water in a channel was like before");
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  google::InitGoogleLogging(argv[0]);
  std::string error;
  std::vector<invgrad::Method> methods;
  if (!invgrad::ParseMethods(FLAGS_rules, &methods, &error)) {
    std::cerr << "--rules: " << error << "\n";
    return 1;
  }

  const auto channel = std::make_shared<Channel>();
  const VectorXd truth = Truth();
  Check(*channel, truth);

  // [find]
  VectorXd measured(kNumCells);
  CHECK(channel->Value(truth.data(), nullptr, measured.data()));
  std::vector<VectorXd> states = {truth, measured};
  std::ofstream losses(FLAGS_folder + "/flow_losses.txt");
  for (const invgrad::Method& method : methods) {
    invgrad::PointObjective objective(
        channel,
        std::make_shared<invgrad::SquaredNormLoss>(kNumCells, 0.5),
        measured,
        /*start=*/VectorXd::Ones(kNumCells));
    invgrad::MinimizerOptions options;
    options.max_num_iterations = 1000000;
    options.max_time_in_seconds = FLAGS_seconds;
    options.function_tolerance = 0.0;
    options.parameter_tolerance = 0.0;
    std::vector<VectorXd> path;
    invgrad::MinimizerSummary summary;
    if (!invgrad::MinimizeByMethod(
            method, options, nullptr, &objective, &path, &summary, &error)) {
      std::cerr << method.label << ": " << error << "\n";
      return 1;
    }
    std::printf("%-32s %5d steps, loss %.1e, mean |x - x*| %.4f\n",
                method.label.c_str(),
                summary.num_steps(),
                summary.final_cost,
                (path.back() - truth).cwiseAbs().mean());
    // [/find]
    if (summary.termination_type == ceres::FAILURE) {
      std::printf("  %s\n", summary.message.c_str());
    }
    states.push_back(path.back());
    losses << '"' << method.label << "\"\n";
    for (const ceres::IterationSummary& step : summary.iterations) {
      losses << step.cumulative_time_in_seconds << " " << step.cost << "\n";
    }
    losses << "\n\n";
  }

  std::ofstream fields(FLAGS_folder + "/flow_states.txt");
  fields << "cell truth measured";
  for (const invgrad::Method& method : methods) {
    fields << " \"" << method.label << '"';
  }
  for (int i = 0; i < kNumCells; ++i) {
    fields << "\n" << i;
    for (const VectorXd& state : states) fields << " " << state[i];
  }
  fields << "\n";
  if (!losses.flush() || !fields.flush()) {
    std::cerr << "cannot write to the folder " << FLAGS_folder << "\n";
    return 1;
  }
  return 0;
}
