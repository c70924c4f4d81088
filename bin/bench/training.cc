// training/METHOD[/WAY]: a run of --steps steps (1,000) of each of --rules on
// --problem, from the same weights, with batches and linearizations, but no evaluations of
// the loss.
//
//   METHOD                 one thread, beside the first method
//   METHOD/one_at_a_time   one sample at a time in place of four in lanes
//   METHOD/threads         on --threads threads over the samples, if not 1

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "bin/support/learning_run.h"
#include "bin/support/program.h"
#include "bin/support/training_flags.h"
#include "gflags/gflags.h"
#include "invgrad/method.h"

DEFINE_string(problem,
              "sine:xi=32:phi=45",
              "a problem with a network, of training and ranks");
DEFINE_string(rules,
              "adam,sip,sip:proxy=l1,newton/newton/adam:proxy=l1,"
              "newton/numerical/adam",
              "methods of training and ranks; the first is the reference");

namespace invgrad {
namespace {

// A simulator without the functions for batches.
class OneAtATime final : public Simulator {
 public:
  explicit OneAtATime(std::shared_ptr<const Simulator> inner)
      : inner_(std::move(inner)) {}

  int num_inputs() const override { return inner_->num_inputs(); }
  int num_outputs() const override { return inner_->num_outputs(); }
  int num_context() const override { return inner_->num_context(); }
  bool forms_jacobian() const override { return inner_->forms_jacobian(); }
  bool Evaluate(const double* x,
                const double* context,
                double* y,
                double* jacobian) const override {
    return inner_->Evaluate(x, context, y, jacobian);
  }
  std::unique_ptr<const JacobianOperator> Linearize(const double* x,
                                                    const double* context,
                                                    double* y) const override {
    return inner_->Linearize(x, context, y);
  }
  bool Adjoint(const double* x,
               const double* context,
               const Covector& covector,
               double* y,
               double* x_bar) const override {
    return inner_->Adjoint(x, context, covector, y, x_bar);
  }
  bool has_weighted_hessian() const override {
    return inner_->has_weighted_hessian();
  }
  bool WeightedHessian(const double* x,
                       const double* context,
                       const double* w,
                       double* hessian) const override {
    return inner_->WeightedHessian(x, context, w, hessian);
  }
  bool is_linear() const override { return inner_->is_linear(); }
  void InversePower(double kappa,
                    double tau,
                    const double* d_y,
                    double* d_x) const override {
    inner_->InversePower(kappa, tau, d_y, d_x);
  }

 private:
  std::shared_ptr<const Simulator> inner_;
};

Model OneAtATimeModel(const LearningProblem& problem) {
  const Model& model = *problem.model;
  return Model(model.shared_network(),
               std::make_shared<OneAtATime>(model.shared_simulator()),
               model.shared_loss(),
               model.reduction(),
               std::shared_ptr<const Feedback>(problem.model, model.feedback()),
               model.derivatives());
}

void TrainSteps(const Method& method,
                bool is_one_at_a_time,
                int num_threads,
                benchmark::State* state) {
  std::string error;
  const LearningProblem* problem = FlagsProblem(&error);
  if (problem == nullptr) {
    state->SkipWithError(error.c_str());
    return;
  }
  const Model model =
      is_one_at_a_time ? OneAtATimeModel(*problem) : *problem->model;
  TrainOptions options = FlagsOptions(*problem);
  options.num_threads = num_threads;
  for (auto _ : *state) {
    const TrainResult result = Train(model, problem->train, method, options);
    const TrainSummary& summary = result.summary;
    if (!result.error.empty() || summary.num_steps < options.max_num_steps) {
      state->SkipWithError((result.error + summary.message).c_str());
      return;
    }
    state->SetIterationTime(summary.train_time_in_seconds);
  }
  state->SetLabel(model.simulator().WhyNoLanes());
}

}  // namespace

TrainingFlags& BenchTraining() {
  static auto& flags = *new TrainingFlags;
  return flags;
}

bool CheckBenchTraining(std::string* error) {
  return CheckNotGiven(
             {"seconds", "epochs", "shuffle", "cpu_time", "checkpoint_seconds"},
             "is not for bench: give --steps",
             error) &&
         BenchTraining().Check(error);
}

const LearningProblem* FlagsProblem(std::string* error) {
  static auto& problem = *new std::unique_ptr<LearningProblem>;
  if (problem != nullptr) return problem.get();
  auto made = std::make_unique<LearningProblem>();
  if (!ParseFlag("problem", CreateLearningProblem, made.get(), error) ||
      !SetNetwork(BenchTraining().network, made.get(), error)) {
    return nullptr;
  }
  problem = std::move(made);
  return problem.get();
}

TrainOptions FlagsOptions(const LearningProblem& problem) {
  constexpr int kDefaultSteps = 1000;
  TrainOptions options;
  options.batch_size = BatchSize(problem, BenchTraining().batch_size);
  const std::int64_t steps = BenchTraining().steps;
  options.max_num_steps = steps > 0 ? steps : kDefaultSteps;
  options.initial_weights = InitialWeights(problem, 1);
  options.inverse = problem.inverse;
  return options;
}

bool AddTrainingBenchmarks(std::string* error) {
  std::vector<Method> methods;
  if (!CheckBenchTraining(error) ||
      !ParseFlag("rules", ParseMethods, &methods, error)) {
    return false;
  }
  const std::string first = "training/" + methods[0].label;
  for (const Method& method : methods) {
    const std::string name = "training/" + method.label;
    const auto add = [&](const std::string& way,
                         const std::string& reference,
                         bool is_one_at_a_time,
                         int num_threads) {
      AddBenchmark(name + way, reference, [=](auto& state) {
        TrainSteps(method, is_one_at_a_time, num_threads, &state);
      })->UseManualTime();
    };
    add("", name == first ? "" : first, false, 1);
    add("/one_at_a_time", name, true, 1);
    const int num_threads = BenchTraining().threads;
    if (num_threads > 1) add("/threads", name, false, num_threads);
  }
  return true;
}

}  // namespace invgrad
