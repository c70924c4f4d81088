#include "invgrad/inverse/pull_back_counts.h"

#include <algorithm>
#include <cctype>

#include "fmt/core.h"

namespace invgrad {
namespace {

constexpr const char* kNames[kNumPullBackSources] = {"derivative",
                                                     "inverse",
                                                     "numerical inverse",
                                                     "inverse gradient",
                                                     "gradient",
                                                     "not moved"};

}  // namespace

void PullBackCounts::Add(const SimulatorPullBack::Result& result, int sample) {
  ++counts_[static_cast<int>(result.source)];
  if (result.why.empty() || !first_failure_.empty()) return;
  first_failure_ =
      fmt::format("step {}, sample {}: {}", num_steps_, sample, result.why);
  // Reduces a message of the user's inverse to one line.
  std::replace_if(
      first_failure_.begin(),
      first_failure_.end(),
      [](unsigned char c) { return std::iscntrl(c) != 0; },
      ' ');
}

std::string PullBackCounts::Report() const {
  if (of(PullBackSource::kDerivative) > 0) return "";
  std::string text;
  for (int i = 0; i < kNumPullBackSources; ++i) {
    if (counts_[i] == 0) continue;
    text +=
        fmt::format("{}{} {}", text.empty() ? "" : ", ", counts_[i], kNames[i]);
  }
  if (!first_failure_.empty()) {
    text += fmt::format(" (first at {})", first_failure_);
  }
  return text;
}

Eigen::VectorXd PullBackCounts::State() const {
  Eigen::VectorXd state(kNumPullBackSources + 1);
  for (int i = 0; i < kNumPullBackSources; ++i) {
    state[i] = static_cast<double>(counts_[i]);
  }
  state[kNumPullBackSources] = static_cast<double>(num_steps_);
  return state;
}

bool PullBackCounts::SetState(const Eigen::VectorXd& state) {
  if (state.size() != kNumPullBackSources + 1) return false;
  for (int i = 0; i < kNumPullBackSources; ++i) {
    counts_[i] = static_cast<long>(state[i]);
  }
  num_steps_ = static_cast<long>(state[kNumPullBackSources]);
  return true;
}

}  // namespace invgrad
