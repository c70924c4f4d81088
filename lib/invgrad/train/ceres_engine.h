// An engine that runs a minimizer of Ceres on all samples, with or without
// proposals of a rule.
//
// Every iteration, also a rejected one, is a step and an epoch. Ceres iterates
// inside ceres::Solve, so the solve runs in a separate thread, which waits
// after each iteration for the next call of Step: only one of the two threads
// runs at a time.
//
// Fails:   kEnded, with Ceres' termination type and message, when the solve
//          ends by itself. The engine has no state for a checkpoint.
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
  // minimizer of Ceres that supports the model (make_engine.h).
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
  // Guards the following members; the solver's thread runs while is_solving_.
  std::mutex mutex_;
  std::condition_variable changed_;
  bool is_solving_ = false;
  bool has_ended_ = false;  // the solve
  bool is_stopped_ = false;
  ceres::IterationSummary iteration_;
  double lowest_cost_ = std::numeric_limits<double>::infinity();
  MinimizerSummary summary_;
  std::string proposals_;  // a text about the proposals
};

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_CERES_ENGINE_H_
