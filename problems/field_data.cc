#include "problems/field_data.h"

#include <limits>
#include <utility>

#include "fmt/core.h"

namespace invgrad {
namespace {

class FieldSource final : public DataSource {
 public:
  FieldSource(std::shared_ptr<const Simulator> simulator,
              FieldNetwork::Generate generate,
              std::string name,
              std::uint32_t seed)
      : simulator_(std::move(simulator)),
        generate_(std::move(generate)),
        name_(std::move(name)),
        seed_(seed) {}

  DataSet Batch(long step, int batch_size) const override {
    const std::uint32_t seed =
        seed_ + 0x9e3779b9U * (static_cast<std::uint32_t>(step) + 1);
    return SamplesOfFields(*simulator_,
                           generate_(batch_size, seed).transpose());
  }
  std::string Name() const override {
    return fmt::format("{}, seed {}", name_, seed_);
  }

 private:
  const std::shared_ptr<const Simulator> simulator_;
  const FieldNetwork::Generate generate_;
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

std::shared_ptr<const Network> FieldNetwork::Make(int rows,
                                                  int cols,
                                                  bool keeps_mean,
                                                  DenseNetwork dense,
                                                  std::string* error) const {
  if (!u_net.is_chosen()) {
    return std::make_shared<DenseNetwork>(std::move(dense));
  }
  UNetOptions options;
  options.rows = rows;
  options.cols = cols;
  options.keeps_mean = keeps_mean;
  return u_net.Make(options, error);
}

std::shared_ptr<const DataSource> FieldNetwork::MakeSource(
    std::shared_ptr<const Simulator> simulator,
    const Generate& generate,
    const std::string& name,
    std::uint32_t seed) const {
  if (!fresh_data) return nullptr;
  return std::make_shared<FieldSource>(
      std::move(simulator), generate, name, seed);
}

}  // namespace invgrad
