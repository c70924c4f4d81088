#include "invgrad/train/batch_race.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "Eigen/Core"
#include "fmt/ranges.h"

namespace invgrad {
namespace {

constexpr int kNumFirstSteps = 8;
constexpr int kFactor = 4;
constexpr int kSmallFactor = 2;
// Of the work so far: between races, of a slice, and of a slice of a larger
// batch at most.
constexpr double kBetweenRaces = 0.25;
constexpr double kSlice = 0.03;
constexpr double kAffordable = 0.1;
constexpr int kLeastStepsOfSlice = 4;
constexpr double kWorkPerRace = 4.0;  // between races, over that of a race
// Until one is tried again where there is only one size.
constexpr double kRetry = 1.3;
constexpr double kNextSmaller = 4.0;
// A loss is far above the lowest one if the difference is so many times the
// size of this one.
constexpr double kFarAbove = 9.0;

}  // namespace

BatchRace::BatchRace(int first_batch_size, int num_samples, Costs costs)
    : first_batch_size_(first_batch_size),
      num_samples_(num_samples),
      costs_(std::move(costs)),
      path_({first_batch_size}),
      next_race_((1.0 + 0.5) * kNumFirstSteps *
                 costs_.of_step(first_batch_size)) {}

int BatchRace::Times(int factor) const {
  return static_cast<int>(
      std::min(1.0 * factor * path_.back(), 1.0 * num_samples_));
}

int BatchRace::Larger() {
  for (const int size : {Times(kFactor), Times(kSmallFactor)}) {
    std::string ignored;
    if (size > path_.back() &&
        kLeastStepsOfSlice * costs_.of_step(size) <= kAffordable * work_ &&
        costs_.fits(size, &ignored)) {
      return size;
    }
  }
  return 0;
}

int BatchRace::Smaller() {
  const int size = path_.back() / kFactor;
  if (size < first_batch_size_ || work_ < next_smaller_) return 0;
  next_smaller_ = kNextSmaller * work_;
  return size;
}

BatchRace::Verdict BatchRace::Decide(double loss,
                                     const std::function<double()>& of_lowest) {
  if (loss < lowest_loss_) {
    lowest_loss_ = loss;
    return Verdict::kIsLowest;
  }
  const auto is_far_above = [loss](double low) {
    return loss > low + kFarAbove * std::abs(low);
  };
  if (!is_far_above(lowest_loss_)) return Verdict::kGoesOn;
  // Rare samples with large residuals may be among the new ones.
  work_ += costs_.of_judgement;
  if (std::isfinite(loss) && !is_far_above(of_lowest())) {
    return Verdict::kGoesOn;
  }
  ++num_returns_;
  return Verdict::kGoesBack;
}

bool BatchRace::Begin(double loss) {
  begin_ = work_;
  fall_ = loss > 0.0 ? std::max(1.0, last_loss_ / loss) : 1.0;
  last_loss_ = loss;
  work_ += costs_.of_judgement;
  std::vector<int> sizes = {path_.back()};
  for (const int size : {Larger(), Smaller()}) {
    if (size > 0) sizes.push_back(size);
  }
  if (sizes.size() == 1) {
    next_race_ = kRetry * work_;
    return false;
  }
  sizes_ = sizes;
  lane_ = 0;
  slice_ = kSlice * work_;
  for (const int size : sizes_) {
    slice_ = std::max(slice_, kLeastStepsOfSlice * costs_.of_step(size));
  }
  BeginSlice();
  return true;
}

void BatchRace::CountStep() { work_ += costs_.of_step(batch_size()); }

bool BatchRace::BeginNextSlice() {
  ++lane_;
  BeginSlice();
  return lane_ < static_cast<int>(sizes_.size());
}

int BatchRace::End(const std::vector<double>& losses) {
  work_ += costs_.of_judgement * static_cast<double>(losses.size());
  // The loss, times f.
  const auto score = [&](int lane) {
    const double ratio = 1.0 * sizes_[lane] / path_.back();
    return losses[lane] * std::min(fall_, std::max(1.0, ratio));
  };
  int winner = 0;
  for (int lane = 1; lane < static_cast<int>(losses.size()); ++lane) {
    if (score(lane) < score(winner)) winner = lane;
  }
  const int size = sizes_[winner];
  if (size != path_.back()) path_.push_back(size);
  sizes_.clear();
  lane_ = 0;
  next_race_ =
      work_ + std::max(kBetweenRaces * work_, kWorkPerRace * (work_ - begin_));
  return winner;
}

std::string BatchRace::Report() const {
  std::string why;
  const int larger = Times(kSmallFactor);
  if (larger > path_.back() && !costs_.fits(larger, &why)) {
    why = ", no larger: " + why;
  }
  std::string returns;
  if (num_returns_ > 0) {
    returns = fmt::format("; went back {} {}",
                          num_returns_,
                          num_returns_ == 1 ? "time" : "times");
  }
  return fmt::format("batch size {}{}{}", fmt::join(path_, ", "), why, returns);
}

void BatchRace::VisitState(StateArchive* archive) {
  const auto visit_sizes = [&](const std::string& name,
                               std::vector<int>* sizes) {
    Eigen::VectorXd values(sizes->size());
    std::copy(sizes->begin(), sizes->end(), values.begin());
    archive->Visit(name, &values);
    archive->Require(AreCounts(values, num_samples_), name);
    if (archive->error().empty()) sizes->assign(values.begin(), values.end());
  };
  visit_sizes("batch_sizes", &path_);
  archive->Require(!path_.empty() && path_.back() >= 1, "batch_sizes");
  archive->Visit("work", &work_);
  archive->Visit("next_race", &next_race_);
  archive->Visit("next_smaller", &next_smaller_);
  archive->Visit("last_loss", &last_loss_);
  archive->Visit("lowest_loss", &lowest_loss_);
  archive->Visit("num_returns", &num_returns_);
  visit_sizes("slices", &sizes_);
  archive->Visit("slice", &lane_);
  archive->Require(lane_ < std::max(1, static_cast<int>(sizes_.size())),
                   "slice");
  archive->Visit("work_of_slice", &slice_);
  archive->Visit("end_of_slice", &end_of_slice_);
  archive->Visit("begin_of_race", &begin_);
  archive->Visit("fall", &fall_);
}

}  // namespace invgrad
