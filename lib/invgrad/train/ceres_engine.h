// The iterations of one of Ceres' minimizers on all samples, with a rule's
// proposals or without.
//
// An iteration is a step and an epoch, a rejected one too. Ceres iterates
// inside ceres::Solve, so the solve runs in a thread of its own, which waits
// after each iteration until the next step is wanted: at any time one of the
// two threads runs.
//
// Fails:   kEnded, with Ceres' termination type and message, when the solve
//          ends by itself. There is no state to go on from.
#ifndef INVGRAD_TRAIN_CERES_ENGINE_H_
#define INVGRAD_TRAIN_CERES_ENGINE_H_

#include <condition_variable>
#include <limits>
#include <mutex>
#include <string>
#include <thread>

#include "ceres/iteration_callback.h"
#include "invgrad/chain/model.h"
#include "invgrad/methods/method.h"
#include "invgrad/minimize/minimizer.h"
#include "invgrad/train/engine.h"

namespace invgrad {

class CeresEngine final : public Engine {
 public:
  // `model` and `train` must outlive the engine. The phase must have a
  // minimizer of Ceres that takes the model (make_engine.h).
  CeresEngine(Phase phase, const Model* model, const DataSet* train);
  ~CeresEngine() override;

  long steps_per_epoch() const override { return 1; }
  StepResult Step(double progress, Eigen::VectorXd* weights) override;
  bool has_state() const override { return false; }
  std::string Finish() override;

 private:
  // Waits in Ceres' thread.
  class Handover final : public ceres::IterationCallback {
   public:
    explicit Handover(CeresEngine* engine) : engine_(*engine) {}
    ceres::CallbackReturnType operator()(
        const ceres::IterationSummary& iteration) override;

   private:
    CeresEngine& engine_;
  };

  void Solve(Eigen::VectorXd* weights);

  const Phase phase_;
  const Model& model_;
  const DataSet& train_;

  std::thread solver_;
  // Guards what follows; the solver's thread runs while is_solving_.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_solving_ = false;
  bool has_ended_ = false;  // the solve
  bool is_stopped_ = false;
  ceres::IterationSummary iteration_;
  double lowest_cost_ = std::numeric_limits<double>::infinity();
  MinimizerSummary summary_;
  std::string proposals_;  // what there is to say of them
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_CERES_ENGINE_H_
