// The epochs at which a run evaluates its losses, and the mean loss.
#ifndef INVGRAD_TRAIN_EVALUATION_H_
#define INVGRAD_TRAIN_EVALUATION_H_

#include "Eigen/Core"
#include "invgrad/chain/model.h"

namespace invgrad {

// The mean loss over the samples for any reduction of the model, so that runs
// with different batch sizes compare; NaN if the loss cannot be computed.
double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data);

// True after each of the first 40 epochs, and then whenever the number of
// epochs has grown by 1/40 to 1/20. This suffices for a logarithmic axis, and
// does not depend on the machine's speed.
bool IsEvaluationEpoch(long epoch);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_EVALUATION_H_
