// Problems whose data do not fit are refused before the data are made.

#include <sys/resource.h>

#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "problems/problems.h"
#include "tests/support/address_limit.h"

namespace invgrad {
namespace problem_memory_test {

// While it lives, the process may have so many bytes of memory, and
// MemoryLimit() is three quarters of them.
class ProcessLimit {
 public:
  explicit ProcessLimit(rlim_t bytes) {
    EXPECT_EQ(getrlimit(RLIMIT_AS, &before_), 0);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    EXPECT_EQ(setrlimit(RLIMIT_AS, &limit), 0);
  }
  ~ProcessLimit() { EXPECT_EQ(setrlimit(RLIMIT_AS, &before_), 0); }
  ProcessLimit(const ProcessLimit&) = delete;
  ProcessLimit& operator=(const ProcessLimit&) = delete;

 private:
  rlimit before_;
};

std::string Refusal(const std::string& specification,
                    const Eigen::MatrixXd* data = nullptr) {
  PhysicsProblem problem;
  std::string error;
  EXPECT_FALSE(CreateProblem(specification, data, &problem, &error))
      << specification;
  return error;
}

// On any machine: 2e7 samples of (4 + 2 * 4 * (2 + 1e5)) numbers.
TEST(ProblemMemory, TheMessageSaysWhatIsNeededAndWhatIsAllowed) {
  const std::string error =
      Refusal("oscillator_correction:num_samples=10000000:horizon=100000");
  EXPECT_EQ(error.rfind("problem oscillator_correction: "
                        "num_samples=10000000:num_oscillators=2:horizon=100000 "
                        "needs 128 TB for its data; the limit is ",
                        0),
            0u)
      << error;
  EXPECT_NE(error.find("(three quarters of "), std::string::npos) << error;
}

// The largest settings of every problem with data, in a process that may have
// little: what allocates first would be thrown out by std::bad_alloc.
TEST(ProblemMemory, TheLargestSettingsOfAllProblemsAreRefused) {
  if (!kCanLimitAddresses) GTEST_SKIP() << "under a sanitizer";
  const ProcessLimit limit(800'000'000);
  const std::string correction =
      "oscillator_correction:num_samples=100:horizon=100000:num_oscillators=8";
  const std::string pinn =
      "poisson_pinn:points=random:num_interior=10000000:num_boundary=10000000";
  for (const std::string& specification : std::vector<std::string>{
           "oscillator_chain:num_samples=10000000",
           "oscillator_chain:num_samples=10000000:num_oscillators=8",
           "oscillator_tracking:num_samples=10000000:horizon=100000",
           correction,
           "quantum_dipole:num_samples=10000000:num_steps=100000",
           "poisson:num_samples=1000000:resolution=32",
           "heat_1d:num_samples=1000000:resolution=1024",
           "heat:num_samples=1000000:resolution=64",
           "sine:num_samples=10000000",
           "exponential:num_samples=10000000",
           "multimodal:num_samples=10000000",
           "regression_1d:num_samples=10000000",
           "random_polynomial:num_samples=10000000",
           pinn}) {
    EXPECT_NE(Refusal(specification).find(" for its data; the limit is 600 MB"),
              std::string::npos)
        << Refusal(specification);
  }
}

TEST(ProblemMemory, ReplacedDataCountBySamplesAndSettings) {
  const Eigen::MatrixXd data = Eigen::MatrixXd::Zero(500, 4);
  if (!kCanLimitAddresses) GTEST_SKIP() << "under a sanitizer";
  const ProcessLimit limit(800'000'000);
  // 500 (4 + 2 * 4 * (2 + 1e5)) numbers.
  EXPECT_EQ(Refusal("oscillator_correction:horizon=100000", &data),
            "problem oscillator_correction: data of 500 samples"
            ":num_oscillators=2:horizon=100000 needs 3.2 GB for its data; the "
            "limit is 600 MB (three quarters of what this process may have)");
}

}  // namespace problem_memory_test
}  // namespace invgrad
