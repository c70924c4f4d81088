#include "invgrad/train/engine.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "fmt/core.h"
#include "invgrad/core/step_cost.h"
#include "invgrad/cost.h"
#include "invgrad/distributed/distributed_objective.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/method.h"
#include "invgrad/methods/batch_proposal.h"
#include "invgrad/methods/ceres_methods.h"
#include "invgrad/methods/phase_objective.h"
#include "invgrad/methods/pull_back_method.h"
#include "invgrad/minimize/method_minimization.h"
#include "invgrad/output_layer/share.h"
#include "invgrad/train/raced_engine.h"
#include "invgrad/train/rule_engine.h"
#include "invgrad/train/scheduled_output_layer.h"
#include "invgrad/train/training_memory.h"

namespace invgrad {
namespace {

// Returns false if ranks cannot share the batches.
bool CheckRanks(const Phase& phase,
                const Model& model,
                const TrainingData& data,
                const TrainOptions& options,
                std::string* error) {
  if (options.communicator == nullptr) return true;
  const int num_ranks = options.communicator->size();
  const int batch_size =
      phase.BatchSize(options.batch_size, data.train.num_samples());
  if (phase.ceres != nullptr) {
    *error = fmt::format(
        "a minimizer of Ceres works in one process, and this run has {} ranks: "
        "start it without them, or choose an update rule",
        num_ranks);
  } else if (batch_size < num_ranks) {
    *error = fmt::format(
        "batch_size={} is less than the {} ranks, of which each has at least "
        "one sample: choose a larger batch or fewer ranks",
        batch_size,
        num_ranks);
  } else if (model.network().couples_samples()) {
    *error =
        "the outputs of the network may depend on all samples of a batch "
        "(batch normalization), which ranks would share: start the run in one "
        "process";
  } else {
    return true;
  }
  return false;
}

// Returns false if the model's output layer has no least-squares problem.
bool CanSolveOutputLayer(const Phase& phase,
                         const Model& model,
                         const TrainOptions& options,
                         std::string* error) {
  const bool in_x = phase.pull_back != nullptr && !phase.pull_back->is_joint();
  const Network& network = model.network();
  const auto layer_size = OutputLayerOf(network).size();
  // A step in y turns the loss into one without a squared norm.
  const std::shared_ptr<const Loss> loss =
      phase.pull_back != nullptr && !in_x
          ? phase.pull_back->MakeLoss(model.shared_loss())
          : model.shared_loss();
  if (layer_size == 0) {
    *error = fmt::format(
        "output_layer: the network {} does not end in a layer that is "
        "affine in its weights: let it end in a linear layer or a 1 x 1 "
        "convolution without an activation, or leave the option off",
        network.Name());
  } else if (layer_size == network.num_weights()) {
    *error = fmt::format(
        "output_layer: the network {} has no other layer to train: one "
        "least-squares solution is all, so add a hidden layer",
        network.Name());
  } else if (in_x && !phase.pull_back->has_least_squares_proxy()) {
    *error = "output_layer: proxy=l1 is no sum of squares: choose proxy=l2";
  } else if (!in_x && !loss->SquaredNormFactor().has_value()) {
    *error =
        "output_layer: the loss is no sum of squares: train towards "
        "targets in x, for example newton/inverse_gradient/adam, or leave the "
        "option off";
  } else if (!in_x && !IsSolvedInX(model) && !model.has_factors()) {
    *error =
        "output_layer: the simulator is not linear, and the Gauss-Newton "
        "step of the layer needs a DenseNetwork and a simulator that forms its "
        "Jacobian: train towards targets in x, for example by sip or "
        "supervised";
  } else if (options.communicator != nullptr) {
    *error =
        "output_layer: a solved one works in one process: start the run "
        "without ranks";
  } else {
    return true;
  }
  return false;
}

struct OutputLayerPlan {
  OutputLayerSchedule schedule;
  MemoryPart memory;
};

OutputLayerPlan PlanOutputLayer(const Phase& phase,
                                UpdateRule* rule,
                                const Model& model,
                                const TrainingData& data,
                                bool is_proxy,
                                int batch_size) {
  OutputLayerPlan plan;
  if (!phase.solves_output_layer()) return plan;
  OutputLayerSchedule& schedule = plan.schedule;
  schedule.batch_size = batch_size;
  schedule.watches_fall = phase.output_layer == Phase::OutputLayer::kAuto;
  const int num_samples = data.train.num_samples();
  const LinearizationParts needs = rule->Needs();
  // A rule of gradients alone has no say in how far the layer moves.
  schedule.after_each_step = batch_size == num_samples &&
                             model.dense_network() != nullptr &&
                             (needs.jacobian || needs.hessian || needs.after ||
                              rule->judge() != nullptr);
  if (schedule.after_each_step) {
    const double num_outputs =
        is_proxy ? model.simulator().num_inputs() : model.loss().size();
    plan.memory = {"projection without the output layer",
                   ProjectionBytes(model, num_outputs, batch_size)};
    return plan;
  }
  const bool is_fresh =
      data.source != nullptr && !data.source->needs_whole_batches();
  const int num_solved =
      is_fresh ? std::max(SamplesOfShare(model, is_proxy), batch_size)
               : num_samples;
  schedule.period =
      phase.output_layer_period > 0
          ? phase.output_layer_period
          : OutputLayerPeriod(model, is_proxy, batch_size, num_solved);
  plan.memory = {"output layer",
                 DataBytes(data.train) / num_samples * num_solved +
                     OutputLayerBytes(model, is_proxy)};
  return plan;
}

// Whether the parts and the data, which *memory lists, fit.
bool Fits(const std::string& who,
          std::vector<MemoryPart> parts,
          const TrainingData& data,
          const TrainOptions& options,
          std::string* memory,
          std::string* error) {
  parts.push_back({"data", DataBytes(data.train) + DataBytes(data.test)});
  *memory = MemoryText(who, parts);
  return FitsInMemory(who, std::move(parts), options.memory_limit, error);
}

std::vector<MemoryPart> StepParts(const Model& model,
                                  const TrainingData& data,
                                  const LinearizationParts& needs,
                                  bool is_proxy,
                                  int batch_size,
                                  int num_ranks,
                                  const std::vector<MemoryPart>& copies) {
  std::vector<MemoryPart> parts =
      TrainingMemory(model, needs, is_proxy, batch_size, num_ranks);
  parts.push_back(
      {"batch", DataBytes(data.train) * batch_size / data.train.num_samples()});
  parts.insert(parts.end(), copies.begin(), copies.end());
  return parts;
}

// What the run says of samples that fill no batch; empty: all are in steps.
std::string LeftOut(const TrainingData& data,
                    int batch_size,
                    const TrainOptions& options) {
  const int num_samples = data.train.num_samples();
  const int num_left_out = num_samples % batch_size;
  if (options.shuffle || data.source != nullptr || num_left_out == 0) return "";
  return fmt::format(
      "the last {} of {} samples are in no step", num_left_out, num_samples);
}

// Why there is no other batch size to race; empty: there is.
std::string WhyNoRace(const TrainingData& data, int batch_size) {
  return batch_size == data.train.num_samples() ? "all samples are in each step"
         : data.source != nullptr && data.source->steps_per_set() > 1
             ? "the samples serve several steps"
             : "";
}

// The batch size of a race's first steps, at least one sample a rank.
int FirstBatchSize(const Model& model,
                   const LinearizationParts& needs,
                   bool is_proxy,
                   int batch_size,
                   int num_ranks) {
  // A step with so many rows takes a few tenths of a second.
  constexpr int kMostRows = 2048;
  if (!needs.factorization || model.num_weights() <= kMostRows) {
    return batch_size;
  }
  const int rows_of_sample =
      is_proxy ? model.simulator().num_inputs() : model.loss().size();
  return std::min(batch_size, std::max(num_ranks, kMostRows / rows_of_sample));
}

// What the rule lowers; null, with a message, if the rule cannot.
std::unique_ptr<BatchObjective> MakeRuleObjective(const Phase& phase,
                                                  UpdateRule* rule,
                                                  const Model& model,
                                                  const TrainingData& data,
                                                  const TrainOptions& options,
                                                  std::string* error) {
  std::unique_ptr<BatchObjective> objective =
      MakePhaseObjective(phase,
                         rule,
                         model,
                         data.train,
                         options.inverse,
                         options.communicator.get(),
                         error);
  if (objective == nullptr) return nullptr;
  if (!objective->is_proxy() && !model.CanLinearize(rule->Needs(), error)) {
    return nullptr;
  }
  if (phase.solves_output_layer() &&
      !CanSolveOutputLayer(phase, model, options, error)) {
    return nullptr;
  }
  return objective;
}

bool CheckBatchSize(const TrainingData& data,
                    int batch_size,
                    std::string* error) {
  const int num_samples = data.train.num_samples();
  if (data.source != nullptr && data.source->needs_whole_batches() &&
      batch_size != num_samples) {
    *error = fmt::format(
        "batch_size={} is not allowed with {}: take 0, all {} samples",
        batch_size,
        data.source->Name(),
        num_samples);
    return false;
  }
  if (batch_size > num_samples) {
    *error = fmt::format(
        "batch_size={} is out of range; allowed: 1 to the {} training samples, "
        "or 0 for all",
        batch_size,
        num_samples);
    return false;
  }
  return true;
}

// The engine of a minimizer of Ceres.
bool CheckCeres(const Phase& phase,
                const UpdateRule* rule,
                const Model& model,
                const TrainingData& data,
                const TrainOptions& options,
                std::string* memory,
                std::string* error) {
  if (phase.ceres->is_trust_region &&
      !model.loss().SquaredNormFactor().has_value()) {
    *error = kNeedsLeastSquares;
    return false;
  }
  const int num_samples = data.train.num_samples();
  if (!Fits(fmt::format("all {} samples at once", num_samples),
            CeresMemory(phase, model, num_samples),
            data,
            options,
            memory,
            error)) {
    return false;
  }
  if (rule == nullptr) return true;
  Eigen::VectorXd any_weights = Eigen::VectorXd::Zero(model.num_weights());
  ceres::Problem problem;
  AddModelToProblem(model, data.train, any_weights.data(), &problem);
  if (!TakesProposals(phase, problem, error)) return false;
  if (phase.pull_back == nullptr) {
    return model.CanLinearize(rule->Needs(), error);
  }
  return MakeBatchProposal(phase,
                           model,
                           data.train,
                           any_weights.data(),
                           options.inverse,
                           error) != nullptr;
}

}  // namespace

std::unique_ptr<Engine> MakeEngine(const Phase& phase,
                                   std::shared_ptr<UpdateRule> rule,
                                   const Model& model,
                                   const TrainingData& data,
                                   const TrainOptions& options,
                                   std::string* memory,
                                   std::string* error) {
  if (!CheckRanks(phase, model, data, options, error)) return nullptr;
  if (phase.ceres != nullptr) {
    if (!CheckCeres(phase, rule.get(), model, data, options, memory, error)) {
      return nullptr;
    }
    return MakeCeresEngine(phase, &model, &data.train, options.inverse);
  }
  std::unique_ptr<BatchObjective> objective =
      MakeRuleObjective(phase, rule.get(), model, data, options, error);
  if (objective == nullptr) return nullptr;
  int batch_size =
      phase.BatchSize(options.batch_size, data.train.num_samples());
  if (!CheckBatchSize(data, batch_size, error)) return nullptr;
  const int num_ranks =
      options.communicator == nullptr ? 1 : options.communicator->size();
  const bool is_proxy = objective->is_proxy();
  const LinearizationParts needs = rule->Needs();
  const std::string why_no_race = WhyNoRace(data, batch_size);
  const bool is_raced = phase.races_batch_size && why_no_race.empty();
  if (is_raced) {
    batch_size = FirstBatchSize(model, needs, is_proxy, batch_size, num_ranks);
  }
  const std::vector<MemoryPart> copies = CopiesOfState(
      needs, model.num_weights(), is_raced, !options.checkpoint_path.empty());
  std::vector<MemoryPart> parts =
      StepParts(model, data, needs, is_proxy, batch_size, num_ranks, copies);
  const OutputLayerPlan output_layer =
      PlanOutputLayer(phase, rule.get(), model, data, is_proxy, batch_size);
  if (phase.solves_output_layer()) parts.push_back(output_layer.memory);
  if (!Fits(fmt::format("batch_size={}", batch_size),
            std::move(parts),
            data,
            options,
            memory,
            error)) {
    return nullptr;
  }
  if (options.communicator != nullptr) {
    objective = std::make_unique<DistributedObjective>(std::move(objective),
                                                       options.communicator);
  }
  if (phase.solves_output_layer()) {
    objective = std::make_unique<ScheduledOutputLayer>(
        std::move(objective), output_layer.schedule, &model, &data);
  }
  auto engine = std::make_unique<RuleEngine>(batch_size,
                                             options,
                                             std::move(objective),
                                             std::move(rule),
                                             &model,
                                             &data);
  if (!is_raced) {
    engine->set_remark(phase.races_batch_size
                           ? fmt::format("batch size {}, not raced: {}",
                                         batch_size,
                                         why_no_race)
                           : LeftOut(data, batch_size, options));
    return engine;
  }
  const auto fits =
      [&model, &data, &options, needs, is_proxy, num_ranks, copies](
          int size, std::string* why) {
        std::string ignored;
        const bool fits = Fits(
            fmt::format("batch_size={}", size),
            StepParts(model, data, needs, is_proxy, size, num_ranks, copies),
            data,
            options,
            &ignored,
            why);
        // The machines of ranks may differ.
        return options.communicator == nullptr
                   ? fits
                   : options.communicator->Agree(fits, why);
      };
  return MakeRacedEngine(
      std::move(engine), needs, is_proxy, fits, options, model, data);
}

}  // namespace invgrad
