#include "problems/field_data.h"

#include <limits>
#include <utility>

#include "fmt/core.h"

namespace invgrad {
namespace {

class FieldSource final : public DataSource {
 public:
  FieldSource(FieldNetwork::MakeSamples make_samples,
              std::string name,
              std::uint32_t seed)
      : make_samples_(std::move(make_samples)),
        name_(std::move(name)),
        seed_(seed) {}

  DataSet Batch(long step,
                int batch_size,
                const Model& /*model*/,
                const Eigen::VectorXd& /*weights*/) const override {
    const std::uint32_t seed =
        seed_ + 0x9e3779b9U * (static_cast<std::uint32_t>(step) + 1);
    return make_samples_(batch_size, seed);
  }
  std::string Name() const override {
    return fmt::format("{}, seed {}", name_, seed_);
  }

 private:
  const FieldNetwork::MakeSamples make_samples_;
  const std::string name_;
  const std::uint32_t seed_;
};

}  // namespace

DataSet SamplesOfFields(const Simulator& simulator, Eigen::MatrixXd fields) {
  DataSet samples;
  samples.solutions = std::move(fields);
  const Eigen::Index num_samples = samples.solutions.cols();
  samples.targets.resize(simulator.num_outputs(), num_samples);
  for (Eigen::Index s = 0; s < num_samples; ++s) {
    auto target = samples.targets.col(s);
    if (!simulator.Evaluate(
            samples.solutions.col(s).data(), nullptr, target.data(), nullptr)) {
      target.setConstant(std::numeric_limits<double>::quiet_NaN());
    }
  }
  samples.inputs = samples.targets;
  samples.contexts.resize(0, num_samples);
  return samples;
}

void FieldNetwork::Describe(OptionSet* set) {
  u_net.Describe(set);
  set->Add("fresh_data",
           &fresh_data,
           "new samples at every step; the others are for evaluation");
}

std::shared_ptr<const Network> FieldNetwork::Make(const UNetOptions& options,
                                                  DenseNetwork dense,
                                                  std::string* error) const {
  if (!u_net.is_chosen()) {
    return std::make_shared<DenseNetwork>(std::move(dense));
  }
  return u_net.Make(options, error);
}

std::shared_ptr<const DataSource> FieldNetwork::MakeSource(
    const MakeSamples& make_samples,
    const std::string& name,
    std::uint32_t seed) const {
  if (!fresh_data) return nullptr;
  return std::make_shared<FieldSource>(make_samples, name, seed);
}

}  // namespace invgrad
