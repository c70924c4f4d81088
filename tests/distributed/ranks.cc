#include "tests/distributed/ranks.h"

#include <iostream>
#include <string>

#include "glog/logging.h"
#include "gtest/gtest.h"
#include "invgrad/mpi.h"
#include "problems/problems.h"

namespace invgrad {
namespace {

std::shared_ptr<const Communicator>& Current() {
  static std::shared_ptr<const Communicator> ranks;
  return ranks;
}

// Prints only failures, with the rank.
class FailurePrinter final : public testing::EmptyTestEventListener {
  void OnTestStart(const testing::TestInfo& test) override {
    name_ = std::string(test.test_suite_name()) + "." + test.name();
  }
  void OnTestPartResult(const testing::TestPartResult& result) override {
    if (!result.failed()) return;
    std::cerr << "rank " << Current()->rank() << ": " << name_ << ": "
              << result.file_name() << ":" << result.line_number() << ": "
              << result.message() << std::endl;
  }

  std::string name_;
};

}  // namespace

std::shared_ptr<const Communicator> Ranks() { return Current(); }

}  // namespace invgrad

int main(int argc, char** argv) {
  invgrad::RegisterProblems();
  testing::InitGoogleTest(&argc, argv);
  const invgrad::MpiSession session(&argc, &argv);
  CHECK(session.communicator() != nullptr) << "Start it by mpirun.";
  invgrad::Current() = session.communicator();
  if (session.communicator()->rank() > 0) {
    auto& listeners = testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
    listeners.Append(new invgrad::FailurePrinter);
  }
  return RUN_ALL_TESTS();
}
