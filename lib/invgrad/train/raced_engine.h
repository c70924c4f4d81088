// The engine of an update rule whose batch size is raced (batch_race.h).
//
// Between races it is the rule's engine. In a race each slice begins with the
// weights and the state of the rule before the race; all slices take their
// samples from one sequence, so that each is trained on new ones. A slice whose
// step fails has lost.
//
// The run reports the weights with the lowest train loss of all its evaluations.
// An evaluation is that of the last weights or of one of their running means
// (weight_means.h), whichever has the lowest loss on up to 2,048 samples, evenly
// spaced in the training data: four losses more. Steps go on from the last
// weights, and races compare these. During a race the run evaluates the first
// slice, which is the run as it goes on without a race.
#ifndef INVGRAD_TRAIN_RACED_ENGINE_H_
#define INVGRAD_TRAIN_RACED_ENGINE_H_

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/linearization.h"
#include "invgrad/model.h"
#include "invgrad/train/batch_race.h"
#include "invgrad/train/engine.h"
#include "invgrad/train/rule_engine.h"
#include "invgrad/train/weight_means.h"

namespace invgrad {

class RacedEngine final : public Engine {
 public:
  // Judges slices by the model's loss, on num_judging new samples, which the
  // ranks of the options share. Model and data must outlive the engine.
  RacedEngine(std::unique_ptr<RuleEngine> engine,
              BatchRace race,
              int num_judging,
              const TrainOptions& options,
              const Model* model,
              const TrainingData* data);

  StepResult Step(double progress, Eigen::VectorXd* weights) override;
  bool Undo(UndoReason reason,
            const Eigen::VectorXd& best,
            Eigen::VectorXd* weights) override;
  Eigen::VectorXd Finished(const Eigen::VectorXd& weights) override;
  Counts counts() const override;
  void VisitState(StateArchive* archive) override;
  std::string Finish() override {
    return "; " + race_.Report() + engine_->Finish();
  }

 private:
  struct Lane {
    RuleEngine::Lane of_rule;
    WeightMeans means;

    void VisitState(const std::string& name,
                    Eigen::Index num_weights,
                    StateArchive* archive);
  };
  Lane Save(const Eigen::VectorXd& weights);
  void Load(const Lane& lane, Eigen::VectorXd* weights);

  // The loss; infinite if it is not finite.
  double Judge(const Eigen::VectorXd& weights, const DataSet& samples);
  // Of a run at the begin or the end of a race: keeps the weights and the state
  // if their loss on the samples is the lowest; goes back to those of the lowest
  // if it is far above it.
  // Returns the loss after that.
  double KeepOrGoBack(double loss,
                      const DataSet& samples,
                      Eigen::VectorXd* weights);
  void EndSlice(bool has_failed, Eigen::VectorXd* weights);

  const std::unique_ptr<RuleEngine> engine_;
  BatchRace race_;
  const int num_judging_;
  const std::shared_ptr<const Communicator> communicator_;
  const Model& model_;
  const TrainingData& data_;

  double num_samples_ = 0.0;  // of all steps
  WeightMeans means_;
  Lane lowest_;  // where a race began or ended with the lowest loss
  // Of a race: its start, and the slices that are over; one that has failed has
  // no weights.
  Lane start_;
  std::vector<Lane> lanes_;
};

// Makes it, with the costs of steps by a rule that needs `needs`. `fits`: as of
// BatchRace.
std::unique_ptr<Engine> MakeRacedEngine(
    std::unique_ptr<RuleEngine> engine,
    const LinearizationParts& needs,
    bool is_proxy,
    std::function<bool(int batch_size, std::string* why)> fits,
    const TrainOptions& options,
    const Model& model,
    const TrainingData& data);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_RACED_ENGINE_H_
