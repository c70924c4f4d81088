// The common part of learning problems whose network looks for a field x with
// P(x) = y*: samples, fresh samples, and a U-net in place of a dense network.
#ifndef PROBLEMS_FIELD_DATA_H_
#define PROBLEMS_FIELD_DATA_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "Eigen/Core"
#include "invgrad/compare/problem.h"
#include "problems/torch/u_net_settings.h"

namespace invgrad {

// y* = P(x_gt) for fields x_gt, one a column; the network gets y*. NaN where P
// has no value, which DataSet::IsFinite reports.
DataSet SamplesOfFields(const Simulator& simulator, Eigen::MatrixXd fields);

struct FieldNetwork {
  UNetSettings u_net;
  bool fresh_data = false;
  void Describe(OptionSet* set);

  // The U-net of `options`, with the settings, or `dense`. Null, with *error
  // set, if the U-net cannot be made.
  std::shared_ptr<const Network> Make(const UNetOptions& options,
                                      DenseNetwork dense,
                                      std::string* error) const;

  using MakeSamples =
      std::function<DataSet(int num_samples, std::uint32_t seed)>;

  // With fresh_data, samples for each step; else null. Step k has the seed
  // `seed` + 0x9e3779b9 (k + 1) mod 2^32.
  std::shared_ptr<const DataSource> MakeSource(const MakeSamples& make_samples,
                                               const std::string& name,
                                               std::uint32_t seed) const;
};

}  // namespace invgrad

#endif  // PROBLEMS_FIELD_DATA_H_
