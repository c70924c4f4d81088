// The messages for a sample of a batch that has no finite value.
#ifndef INVGRAD_CHAIN_SAMPLE_ERROR_H_
#define INVGRAD_CHAIN_SAMPLE_ERROR_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/data.h"
#include "invgrad/simulator.h"

namespace invgrad {

inline constexpr char kLossFailed[] = "the loss has no finite value";
inline constexpr char kNoSecondDerivative[] =
    "the simulator has no finite second derivative";

// *error = "sample 3: what", where the number is that in the whole batch, or
// "what" for a point problem, which has no sample. Returns false.
bool SampleError(const DataSet& batch,
                 int sample,
                 const std::string& what,
                 std::string* error);

// The same for a simulator that failed at the sample's x (x: |x| x B).
bool SimulatorError(const Simulator& simulator,
                    const Eigen::Map<const Eigen::MatrixXd>& x,
                    const DataSet& batch,
                    int sample,
                    std::string* error);

// True if the cost of a batch is finite.
bool CheckCost(double cost, std::string* error);

// True if both are finite: a backward pass may overflow although the forward
// pass did not.
bool CheckDerivatives(const Eigen::VectorXd& gradient,
                      const Eigen::MatrixXd& hessian,
                      std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_SAMPLE_ERROR_H_
