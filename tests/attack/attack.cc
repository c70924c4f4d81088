#include "tests/attack/attack.h"

#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <map>

#include "fmt/core.h"
#include "gflags/gflags.h"
#include "gtest/gtest.h"

DEFINE_double(seconds, 4.0, "how long each attack looks for findings");
DEFINE_uint64(seed, 1, "of the first case; the next ones count on");

namespace invgrad {
namespace {

std::map<std::string, int>& Counts() {
  static auto& counts = *new std::map<std::string, int>;
  return counts;
}

int NumFailures() {
  return testing::UnitTest::GetInstance()
      ->current_test_info()
      ->result()
      ->total_part_count();
}

}  // namespace

void Attack(const std::function<void(Dice* dice)>& attack_case) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(
                         std::chrono::duration<double>(FLAGS_seconds));
  const testing::TestInfo& test =
      *testing::UnitTest::GetInstance()->current_test_info();
  const std::string name =
      fmt::format("{}.{}", test.test_suite_name(), test.name());
  constexpr int kMaxFindings = 10;
  int num_findings = 0;
  std::uint64_t seed = FLAGS_seed;
  Counts().clear();
  do {
    SCOPED_TRACE(fmt::format(
        "attack_test --gtest_filter={} --seed={} --seconds=0", name, seed));
    const int before = NumFailures();
    Dice dice(seed++);
    attack_case(&dice);
    if (NumFailures() > before) ++num_findings;
  } while (Clock::now() < end && num_findings < kMaxFindings);
  std::cout << fmt::format("{}: {} cases from seed {}, {} findings",
                           name,
                           seed - FLAGS_seed,
                           FLAGS_seed,
                           num_findings);
  for (const auto& [what, count] : Counts()) {
    std::cout << ", " << count << " " << what;
  }
  std::cout << std::endl;
}

void Count(const std::string& what) { ++Counts()[what]; }

}  // namespace invgrad

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  gflags::ParseCommandLineFlags(&argc, &argv, true);
  // In memory, where fsync takes no time: most of a small run's time.
  if (access("/dev/shm", W_OK) == 0) {
    setenv("TEST_TMPDIR", "/dev/shm", /*overwrite=*/0);
  }
  return RUN_ALL_TESTS();
}
