// The ways of the pull-backs through loss and simulator, and their names in a
// method:
//
//   LOSS/SIMULATOR/RULE        newton/inverse/adam
#ifndef INVGRAD_INVERSE_WAYS_H_
#define INVGRAD_INVERSE_WAYS_H_

namespace invgrad {

// loss_pull_back.h
enum class LossWay { kGradient, kNewton, kSaddleFreeNewton };

// simulator_pull_back.h
enum class SimulatorWay {
  kJoint,  // no pull-back: the rule linearizes network and simulator as one
  kAdjoint,
  kInverseGradient,
  kHalfInverse,
  kInverse,    // the problem's inverse simulator; kNumerical if it has none
  kNumerical,  // numerical_inverse.h
  kNewton,     // newton_inverse.h
  kData,       // no pull-back: x~ is the data's solution x*
};

template <typename Way>
struct WayName {
  Way way;
  const char* name;
};
inline constexpr WayName<LossWay> kLossWays[] = {
    {LossWay::kGradient, "gradient"},
    {LossWay::kNewton, "newton"},
    {LossWay::kSaddleFreeNewton, "saddle_free_newton"}};
inline constexpr WayName<SimulatorWay> kSimulatorWays[] = {
    {SimulatorWay::kJoint, "joint"},
    {SimulatorWay::kAdjoint, "adjoint"},
    {SimulatorWay::kInverseGradient, "inverse_gradient"},
    {SimulatorWay::kHalfInverse, "half_inverse"},
    {SimulatorWay::kInverse, "inverse"},
    {SimulatorWay::kNumerical, "numerical"},
    {SimulatorWay::kNewton, "newton"},
    {SimulatorWay::kData, "data"}};

}  // namespace invgrad

#endif  // INVGRAD_INVERSE_WAYS_H_
