#include "invgrad/inverse/pull_back_counts.h"

#include <algorithm>
#include <cctype>

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
  first_failure_ = "step " + std::to_string(num_steps_) + ", sample " +
                   std::to_string(sample) + ": " + result.why;
  // A user's words, in a message of one line.
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
    text += (text.empty() ? "" : ", ") + std::to_string(counts_[i]) + " " +
            kNames[i];
  }
  if (!first_failure_.empty()) text += " (first at " + first_failure_ + ")";
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
