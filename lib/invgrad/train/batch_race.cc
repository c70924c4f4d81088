#include "invgrad/train/batch_race.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "fmt/ranges.h"

namespace invgrad {
namespace {

constexpr int kNumFirstSteps = 8;
constexpr int kFactor = 4;
// Of the work so far: between races, of a slice, and of a slice of a larger
// batch at most.
constexpr double kBetweenRaces = 0.25;
constexpr double kSlice = 0.03;
constexpr double kAffordable = 0.25;
constexpr int kLeastStepsOfSlice = 4;
constexpr double kWorkPerRace = 4.0;  // between races, over that of a race
// Until one is tried again where there is only one size.
constexpr double kRetry = 1.3;
constexpr double kStall = 1.3;
constexpr double kNextSmaller = 4.0;
constexpr double kWorse = 1.5;

}  // namespace

BatchRace::BatchRace(int first_batch_size, int num_samples, Costs costs)
    : first_batch_size_(first_batch_size),
      num_samples_(num_samples),
      costs_(std::move(costs)),
      batch_size_(first_batch_size),
      path_(Eigen::VectorXd::Constant(1, first_batch_size)),
      next_race_((1.0 + 0.5) * kNumFirstSteps *
                 costs_.of_step(first_batch_size)) {}

int BatchRace::Larger(double loss) {
  const bool has_stalled = !(loss < last_loss_ / kStall);
  last_loss_ = loss;
  if (costs_.is_tall(batch_size_) && !has_stalled) return 0;
  for (const int factor : {kFactor, 2}) {
    const int size = static_cast<int>(
        std::min(1.0 * factor * batch_size_, 1.0 * num_samples_));
    if (size > batch_size_ &&
        kLeastStepsOfSlice * costs_.of_step(size) <= kAffordable * work_ &&
        costs_.fits(size, &limit_)) {
      return size;
    }
  }
  return 0;
}

int BatchRace::Smaller() {
  const int size = batch_size_ / kFactor;
  if (size < first_batch_size_ || work_ < next_smaller_) return 0;
  next_smaller_ = kNextSmaller * work_;
  return size;
}

bool BatchRace::Begin(double loss) {
  begin_ = work_;
  work_ += costs_.of_judgement;
  std::vector<int> sizes = {batch_size_};
  for (const int size : {Larger(loss), Smaller()}) {
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
  const auto best = std::min_element(losses.begin(), losses.end());
  int winner = static_cast<int>(best - losses.begin());
  if (*best < kWorse * last_loss_) {
    const int size = sizes_[winner];
    if (size != batch_size_) {
      path_.conservativeResize(path_.size() + 1);
      path_[path_.size() - 1] = size;
      batch_size_ = size;
    }
  } else {
    winner = -1;
  }
  sizes_.clear();
  lane_ = 0;
  next_race_ =
      work_ + std::max(kBetweenRaces * work_, kWorkPerRace * (work_ - begin_));
  return winner;
}

std::string BatchRace::Report() const {
  std::vector<int> sizes;
  for (const double size : path_) sizes.push_back(static_cast<int>(size));
  return fmt::format("batch size {}{}{}",
                     fmt::join(sizes, ", "),
                     limit_.empty() ? "" : ", no larger: ",
                     limit_);
}

void BatchRace::VisitState(StateArchive* archive) {
  archive->Visit("batch_size", &batch_size_);
  archive->Visit("batch_sizes", &path_);
  archive->Require(batch_size_ >= 1 && batch_size_ <= num_samples_ &&
                       AreCounts(path_, num_samples_),
                   "batch_size");
  archive->Visit("work", &work_);
  archive->Visit("next_race", &next_race_);
  archive->Visit("next_smaller", &next_smaller_);
  archive->Visit("last_loss", &last_loss_);
  Eigen::VectorXd sizes(sizes_.size());
  std::copy(sizes_.begin(), sizes_.end(), sizes.begin());
  archive->Visit("slices", &sizes);
  archive->Visit("slice", &lane_);
  archive->Require(AreCounts(sizes, num_samples_) &&
                       (sizes.size() == 0 ? lane_ == 0 : lane_ < sizes.size()),
                   "slices");
  archive->Visit("work_of_slice", &slice_);
  archive->Visit("end_of_slice", &end_of_slice_);
  archive->Visit("begin_of_race", &begin_);
  if (!archive->is_reading() || !archive->error().empty()) return;
  sizes_.assign(sizes.begin(), sizes.end());
}

}  // namespace invgrad
