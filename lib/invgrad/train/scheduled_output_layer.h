// The objective of a phase whose output layer is solved: when, and on which
// samples.
//
//   after_each_step   the layer is the best one of the step's samples after every
//                     step; it is solved before the first step, and before the
//                     first one of new samples
//   otherwise         every `period` steps, on the next share of the training
//                     samples, or on as many fresh ones of the data source
//
// See output_layer/reduced_objective.h for the solution itself.
#ifndef INVGRAD_TRAIN_SCHEDULED_OUTPUT_LAYER_H_
#define INVGRAD_TRAIN_SCHEDULED_OUTPUT_LAYER_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/output_layer/reduced_objective.h"
#include "invgrad/output_layer/steady_fall.h"
#include "invgrad/train.h"

namespace invgrad {

struct OutputLayerSchedule {
  bool after_each_step = false;
  int period = 1;
  int batch_size = 1;
  // Whether HasStalled is wanted (steady_fall.h). It needs a second solution each
  // time, without the ridge of the drift, in the first tenth of the phase.
  bool watches_fall = false;
};

class ScheduledOutputLayer final : public ReducedObjective {
 public:
  // Model and data must outlive the objective.
  ScheduledOutputLayer(std::unique_ptr<BatchObjective> whole,
                       const OutputLayerSchedule& schedule,
                       const Model* model,
                       const TrainingData* data);

  bool Prepare(long k,
               double spent,
               const DataSet& batch,
               Eigen::VectorXd* weights,
               std::string* error) override;
  // With the layer of all training samples, unless there are fresh ones.
  Eigen::VectorXd Finished(const Eigen::VectorXd& weights) override;
  bool HasStalled() const override {
    return schedule_.watches_fall && fall_.HasStalled(spent_);
  }
  std::vector<Eigen::VectorXd*> MutableState() override;

 private:
  bool PrepareBatch(long k,
                    const DataSet& batch,
                    Eigen::VectorXd* weights,
                    std::string* error);
  bool PrepareShare(long k,
                    const DataSet& batch,
                    Eigen::VectorXd* weights,
                    std::string* error);
  // Samples of the source for a solution before step k on the batch.
  DataSet FreshSamples(long k,
                       const DataSet& batch,
                       const Eigen::VectorXd& weights) const;
  // The loss with the best output layer of the share, whatever steps follow; NaN
  // if there is none.
  double LossOnShare(const Blocks& share, const Eigen::VectorXd& weights);
  bool ReadsLoss() const {
    return schedule_.watches_fall && SteadyFall::Reads(spent_);
  }

  const OutputLayerSchedule schedule_;
  const Model& model_;
  const TrainingData& data_;
  double spent_ = 0.0;  // before the last step
  SteadyFall fall_;
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_SCHEDULED_OUTPUT_LAYER_H_
