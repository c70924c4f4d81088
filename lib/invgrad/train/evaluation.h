// When a run looks at its losses, and how.
#ifndef INVGRAD_TRAIN_EVALUATION_H_
#define INVGRAD_TRAIN_EVALUATION_H_

#include "Eigen/Core"
#include "invgrad/chain/model.h"

namespace invgrad {

// The mean loss over the samples, whatever the model's reduction is, so that
// runs of different batch sizes compare; NaN if it cannot be computed.
double MeanLoss(const Model& model,
                const Eigen::VectorXd& weights,
                const DataSet& data);

// True after each of the first 40 epochs, and then each time that the number
// of epochs has grown by 1/40 to 1/20: enough for a logarithmic axis, and
// independent of the machine's speed.
bool IsEvaluationEpoch(long epoch);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_EVALUATION_H_
