#include "invgrad/train/run_identity.h"

#include <algorithm>
#include <sstream>

#include "fmt/ranges.h"
#include "invgrad/blas_threads.h"
#include "invgrad/core/blas_kernels.h"
#include "invgrad/core/specification.h"
#include "invgrad/io/digest.h"
#include "invgrad/method.h"
#include "invgrad/train.h"
#include "invgrad/version.h"

namespace invgrad {
namespace {

std::string DigestOf(const DataSet& data) {
  return Digest()
      .Add(data.inputs)
      .Add(data.contexts)
      .Add(data.targets)
      .Add(data.solutions)
      .Hex();
}

// Of y and L at the initial weights, on the first samples.
std::string DigestOfSimulator(const Model& model,
                              const DataSet& train,
                              const Eigen::VectorXd& weights) {
  constexpr int kMaxNumSamples = 4;
  const DataSet batch =
      train.Range(0, std::min(kMaxNumSamples, train.num_samples()));
  Eigen::MatrixXd y;
  Eigen::VectorXd cost(1);
  std::string error;
  if (!model.Predict(weights, batch, &y, &error) ||
      !model.Cost(weights, batch, cost.data(), &error)) {
    return error;
  }
  return Digest().Add(y).Add(cost).Hex();
}

}  // namespace

RunIdentity::RunIdentity() {
  Add("version", INVGRAD_VERSION);
  Add("BLAS kernels", BlasKernels());
  Add("BLAS threads", std::to_string(BlasThreads()));
}

void RunIdentity::Add(const std::string& name, const std::string& value) {
  constexpr size_t kMaxLength = 1000;
  std::string line = name + ": ";
  line += value.size() > kMaxLength ? Digest().Add(value).Hex() : value;
  std::replace(line.begin(), line.end(), '\n', ' ');
  text_ += line + '\n';
}

void RunIdentity::AddData(const DataSet& train,
                          const DataSet& test,
                          const DataSource* source) {
  Add("training data", DigestOf(train));
  Add("test data", DigestOf(test));
  if (source != nullptr) Add("data source", source->Name());
}

void RunIdentity::AddBudget(const TrainOptions& options) {
  const TrainOptions none;
  std::string text;
  const auto add = [&text](auto limit, auto no_limit, const char* unit) {
    if (limit == no_limit) return;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", limit, unit);
  };
  add(options.max_num_epochs, none.max_num_epochs, "epochs");
  add(options.max_num_steps, none.max_num_steps, "steps");
  add(options.max_time_in_seconds, none.max_time_in_seconds, "seconds");
  Add("budget of the schedule", text);
}

std::string RunIdentity::Difference(const std::string& text) const {
  std::istringstream before(text), now(text_);
  std::string line_before, line_now;
  bool has_before = true, has_now = true;
  while (has_before || has_now) {
    has_before = static_cast<bool>(std::getline(before, line_before));
    has_now = static_cast<bool>(std::getline(now, line_now));
    if (!has_before) line_before = "none";
    if (!has_now) line_now = "none";
    if (line_before != line_now) {
      return fmt::format(
          "{}, now {}", Printable(line_before), Printable(line_now));
    }
  }
  return "";
}

RunIdentity IdentityOfRun(const Model& model,
                          const DataSet& train,
                          const DataSet& test,
                          const DataSource* source,
                          const Method& method,
                          const TrainOptions& options) {
  RunIdentity identity;
  identity.Add("network", model.network().Name());
  identity.AddData(train, test, source);
  identity.Add("initial weights", Digest().Add(options.initial_weights).Hex());
  identity.Add("method", method.label);
  if (method.ReadsProgress()) identity.AddBudget(options);
  std::vector<int> sizes;
  bool races_any = false;
  for (const Phase& phase : method.phases) {
    races_any |= phase.races_batch_size;
    sizes.push_back(phase.BatchSize(options.batch_size, train.num_samples()));
  }
  identity.Add(
      "batch size",
      fmt::format("{}{}", fmt::join(sizes, "+"), races_any ? ", raced" : ""));
  identity.Add(
      "order of the samples",
      options.shuffle ? fmt::format("of seed {}", options.seed) : "as given");
  identity.Add("inverse simulator",
               options.inverse == nullptr ? "numerical" : "given");
  identity.Add("simulator and loss",
               DigestOfSimulator(model, train, options.initial_weights));
  if (options.cpu_time) identity.Add("seconds", "of the processor");
  return identity;
}

}  // namespace invgrad
