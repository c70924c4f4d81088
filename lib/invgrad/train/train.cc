#include "invgrad/train.h"

#include <utility>

#include "invgrad/distributed/distributed_objective.h"
#include "invgrad/internal/logging.h"
#include "invgrad/method.h"
#include "invgrad/train/training_run.h"

namespace invgrad {

TrainingData::TrainingData(Eigen::MatrixXd inputs, Eigen::MatrixXd targets) {
  CHECK_EQ(inputs.cols(), targets.cols()) << "one column a sample";
  train.contexts.resize(0, inputs.cols());
  train.solutions.resize(0, inputs.cols());
  train.inputs = std::move(inputs);
  train.targets = std::move(targets);
}

TrainingData::TrainingData(DataSet train,
                           DataSet test,
                           std::shared_ptr<const DataSource> source)
    : train(std::move(train)),
      test(std::move(test)),
      source(std::move(source)) {}

double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data,
                const Communicator* communicator) {
  double cost = 0.0;
  std::string ignored;
  if (!DistributedCost(model, weights, data, communicator, &cost, &ignored)) {
    return HistoryRow::kNone;
  }
  const int num_samples = data.num_samples();
  return cost / (model.BatchScale(num_samples) * num_samples);
}

bool IsEvaluationEpoch(long epoch) {
  // Spacing 1 up to 40, 2 up to 80, 4 up to 160, ...
  long spacing = 1;
  while (epoch > 40 * spacing) spacing *= 2;
  return epoch % spacing == 0;
}

TrainingRun::TrainingRun(const Model& model,
                         TrainingData data,
                         const std::string& method,
                         TrainOptions options)
    : impl_(
          std::make_unique<Impl>(model, std::move(data), std::move(options))) {
  impl_->Add(method);
}

TrainingRun::TrainingRun(const Model& model,
                         TrainingData data,
                         const Method& method,
                         TrainOptions options)
    : impl_(
          std::make_unique<Impl>(model, std::move(data), std::move(options))) {
  impl_->Add(method);
}

TrainingRun::TrainingRun(const Model& model,
                         TrainingData data,
                         std::shared_ptr<UpdateRule> rule,
                         TrainOptions options)
    : impl_(
          std::make_unique<Impl>(model, std::move(data), std::move(options))) {
  impl_->Add(std::move(rule));
}

TrainingRun::~TrainingRun() = default;

bool TrainingRun::Step() { return impl_->Step(); }
void TrainingRun::Stop() { impl_->Stop(); }

const std::string& TrainingRun::error() const { return impl_->error(); }
const Eigen::VectorXd& TrainingRun::weights() const { return impl_->weights(); }
const History& TrainingRun::history() const { return impl_->history(); }
double TrainingRun::loss() const { return impl_->loss(); }
long TrainingRun::step() const { return impl_->step(); }
double TrainingRun::epoch() const { return impl_->epoch(); }
double TrainingRun::progress() const { return impl_->progress(); }
const RunIdentity& TrainingRun::identity() const { return impl_->identity(); }
const TrainSummary& TrainingRun::summary() const { return impl_->summary(); }

TrainResult TrainingRun::result() const {
  return {error(), weights(), history(), summary()};
}

}  // namespace invgrad
