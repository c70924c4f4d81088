#include "invgrad/inverse/pull_back_counts.h"

#include <algorithm>
#include <cctype>

#include "fmt/core.h"

namespace invgrad {

void PullBackCounts::Add(const SimulatorPullBack::Result& result, int sample) {
  ++state_[static_cast<int>(result.source)];
  if (result.why.empty() || !first_failure_.empty()) return;
  first_failure_ = fmt::format("step {:.0f}, sample {}: {}",
                               state_[kNumPullBackSources],
                               sample,
                               result.why);
  // Reduces a message of the user's inverse to one line.
  std::replace_if(
      first_failure_.begin(),
      first_failure_.end(),
      [](unsigned char c) { return std::iscntrl(c) != 0; },
      ' ');
}

std::string PullBackCounts::Report() const {
  constexpr const char* kNames[kNumPullBackSources] = {"derivative",
                                                       "inverse",
                                                       "numerical inverse",
                                                       "inverse gradient",
                                                       "gradient",
                                                       "not moved"};
  if (of(PullBackSource::kDerivative) > 0) return "";
  std::string text;
  for (int i = 0; i < kNumPullBackSources; ++i) {
    if (state_[i] == 0.0) continue;
    text += fmt::format(
        "{}{:.0f} {}", text.empty() ? "" : ", ", state_[i], kNames[i]);
  }
  if (!first_failure_.empty()) {
    text += fmt::format(" (first at {})", first_failure_);
  }
  return text;
}

Eigen::VectorXd PullBackCounts::State() const {
  Eigen::VectorXd state(state_.size() +
                        static_cast<Eigen::Index>(first_failure_.size()));
  std::copy(state_.begin(), state_.end(), state.begin());
  std::transform(first_failure_.begin(),
                 first_failure_.end(),
                 state.begin() + state_.size(),
                 [](unsigned char byte) { return byte; });
  return state;
}

bool PullBackCounts::SetState(const Eigen::VectorXd& state) {
  const Eigen::Index num_bytes = state.size() - state_.size();
  if (num_bytes < 0) return false;
  const auto bytes = state.tail(num_bytes).array();
  if (!(bytes >= 0.0 && bytes < 256.0).all()) return false;
  state_ = state.head(state_.size());
  first_failure_.clear();
  for (const double byte : state.tail(num_bytes)) {
    first_failure_ += static_cast<char>(static_cast<unsigned char>(byte));
  }
  return true;
}

}  // namespace invgrad
