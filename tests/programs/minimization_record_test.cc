// The record of a minimization: read as it was written, and only by its run.

#include "bin/support/minimization_record.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "gtest/gtest.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace minimization_record_test {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

class Record : public testing::Test {
 protected:
  Record() {
    identity_.Add("method", "ceres_lm");
    budget_.max_num_iterations = 10;
    record_.summary.termination_type = ceres::CONVERGENCE;
    record_.summary.initial_cost = 0.1 + 0.2;
    record_.summary.final_cost = 1e-300;
    record_.summary.total_time_in_seconds = 1.0 / 3.0;
    record_.summary.num_outside_domain = 2;
    record_.summary.message = "two\nlines, and \xc3\xa4";
    for (int k = 0; k < 3; ++k) {
      ceres::IterationSummary& iteration =
          record_.summary.iterations.emplace_back();
      iteration.iteration = k;
      iteration.cost = k == 2 ? kInfinity : 0.7 / (k + 1);
      iteration.cumulative_time_in_seconds = 0.1 * k;
      iteration.step_is_successful = k != 2;
    }
    record_.status = "converged";
    record_.num_evaluations = 17;
    record_.points.resize(2, 3);
    record_.points << 1.0, -0.0, std::nan(""), 4.0, 5.0, 1e-310;
  }

  bool Write() {
    const bool is_written =
        WriteRecord(path_, identity_, budget_, record_, &error_);
    EXPECT_TRUE(is_written) << error_;
    return is_written;
  }
  bool Read() { return ReadRecord(path_, identity_, budget_, &read_, &error_); }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "ceres_lm.run";
  RunIdentity identity_;
  MinimizerOptions budget_;
  MinimizationRecord record_, read_;
  std::string error_;
};

TEST_F(Record, IsReadBitForBit) {
  ASSERT_TRUE(Write());
  ASSERT_TRUE(Read()) << error_;
  const MinimizerSummary &a = record_.summary, &b = read_.summary;
  EXPECT_EQ(b.termination_type, a.termination_type);
  EXPECT_EQ(b.initial_cost, a.initial_cost);
  EXPECT_EQ(b.final_cost, a.final_cost);
  EXPECT_EQ(b.total_time_in_seconds, a.total_time_in_seconds);
  EXPECT_EQ(b.num_outside_domain, 2);
  EXPECT_EQ(b.message, a.message);
  ASSERT_EQ(b.iterations.size(), 3u);
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(b.iterations[k].iteration, k);
    EXPECT_EQ(b.iterations[k].cost, a.iterations[k].cost);
    EXPECT_EQ(b.iterations[k].cumulative_time_in_seconds,
              a.iterations[k].cumulative_time_in_seconds);
    EXPECT_EQ(b.iterations[k].step_is_successful, k != 2);
  }
  EXPECT_EQ(read_.status, "converged");
  EXPECT_FALSE(read_.has_failed);
  EXPECT_EQ(read_.num_evaluations, 17);
  ASSERT_EQ(read_.points.rows(), 2);
  ASSERT_EQ(read_.points.cols(), 3);
  EXPECT_TRUE(std::isnan(read_.points(0, 2)));
  EXPECT_TRUE(std::signbit(read_.points(0, 1)));
  EXPECT_EQ(read_.points(1, 2), 1e-310);
}

TEST_F(Record, ARunThatIsNotThereIsNoError) {
  EXPECT_FALSE(Read());
  EXPECT_EQ(error_, "");
}

TEST_F(Record, AnInterruptedRunLeavesNone) {
  record_.summary.termination_type = ceres::USER_SUCCESS;
  ASSERT_TRUE(Write());
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(Record, ALargerBudgetWantsTheRunAgainUnlessItHadConverged) {
  for (const bool has_converged : {true, false}) {
    SCOPED_TRACE(has_converged);
    record_.summary.termination_type =
        has_converged ? ceres::CONVERGENCE : ceres::NO_CONVERGENCE;
    budget_.max_num_iterations = 10;
    ASSERT_TRUE(Write());
    EXPECT_TRUE(Read()) << error_;
    budget_.max_num_iterations = 11;
    EXPECT_EQ(Read(), has_converged);
    EXPECT_EQ(error_, "");
  }
}

TEST_F(Record, OfAnotherRunIsRefused) {
  ASSERT_TRUE(Write());
  identity_ = RunIdentity();
  identity_.Add("method", "ceres_dogleg");
  EXPECT_FALSE(Read());
  EXPECT_NE(error_.find("ceres_lm, now method: ceres_dogleg"),
            std::string::npos)
      << error_;
}

TEST_F(Record, DamagedIsRefused) {
  ASSERT_TRUE(Write());
  std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(-3, std::ios::end);
  file.put('x');
  file.close();
  EXPECT_FALSE(Read());
  EXPECT_NE(error_.find("damaged"), std::string::npos) << error_;
}

}  // namespace minimization_record_test
}  // namespace invgrad
