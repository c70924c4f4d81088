// A rank of a run whose other ranks do not exist, for what a rank computes
// alone.
#ifndef INVGRAD_TESTS_SUPPORT_ONE_RANK_H_
#define INVGRAD_TESTS_SUPPORT_ONE_RANK_H_

#include <vector>

#include "glog/logging.h"
#include "invgrad/internal/communicator.h"

namespace invgrad {

class OneRank final : public Communicator {
 public:
  OneRank(int rank, int size) : rank_(rank), size_(size) {}

  int rank() const override { return rank_; }
  int size() const override { return size_; }
  void Sum(double* /*values*/, std::ptrdiff_t /*size*/) const override {
    LOG(FATAL) << "There is one rank.";
  }
  void SumParts(const double* /*values*/,
                const std::vector<std::ptrdiff_t>& /*sizes*/,
                double* /*own*/) const override {
    LOG(FATAL) << "There is one rank.";
  }
  void Broadcast(int /*root*/,
                 double* /*values*/,
                 std::ptrdiff_t /*size*/) const override {
    LOG(FATAL) << "There is one rank.";
  }
  void Gather(const double* /*own*/,
              const std::vector<std::ptrdiff_t>& /*sizes*/,
              double* /*all*/) const override {
    LOG(FATAL) << "There is one rank.";
  }
  double num_sent() const override { return 0.0; }

 private:
  int rank_;
  int size_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_ONE_RANK_H_
