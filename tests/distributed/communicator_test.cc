#include "invgrad/internal/communicator.h"

#include <cstddef>
#include <numeric>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/distributed/ranks.h"

namespace invgrad {
namespace communicator_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(Communicator, SumsOverTheRanks) {
  const int size = Ranks()->size();
  VectorXd values = VectorXd::LinSpaced(5, 0.0, 4.0);
  values.array() += Ranks()->rank();
  Ranks()->Sum(values.data(), values.size());
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(values[i], i * size + size * (size - 1) / 2.0);
  }
  Ranks()->Sum(nullptr, 0);
}

TEST(Communicator, AllRanksGetTheSameBitsOfASum) {
  VectorXd values(1000);
  for (int i = 0; i < 1000; ++i) values[i] = 1.0 / (3.0 + i + Ranks()->rank());
  VectorXd again = values;
  Ranks()->Sum(values.data(), values.size());
  Ranks()->Sum(again.data(), again.size());
  EXPECT_EQ(values, again);
  VectorXd of_first = values;
  Ranks()->Broadcast(0, of_first.data(), of_first.size());
  EXPECT_EQ(values, of_first);
}

TEST(Communicator, SharesDifferByAtMostOneAndCoverAll) {
  for (const int total : {1, 2, 3, 5, 100}) {
    int next = 0;
    for (int r = 0; r < Ranks()->size(); ++r) {
      const Share share = Ranks()->ShareOf(total, r);
      EXPECT_EQ(share.first, next);
      EXPECT_GE(share.count, total / Ranks()->size());
      EXPECT_LE(share.count, total / Ranks()->size() + 1);
      next += share.count;
    }
    EXPECT_EQ(next, total);
  }
}

TEST(Communicator, GathersColumnsInOrder) {
  constexpr int kItems = 11, kPerItem = 2;
  MatrixXd all(3, kItems * kPerItem);
  std::iota(all.data(), all.data() + all.size(), 0.0);
  const Share share = Ranks()->OwnShare(kItems);
  const MatrixXd own =
      all.middleCols(share.first * kPerItem, share.count * kPerItem);
  EXPECT_EQ(Ranks()->GatherColumns(own, kItems, kPerItem), all);
}

TEST(Communicator, GathersTexts) {
  const std::string own(Ranks()->rank(), 'x');
  const std::vector<std::string> texts = Ranks()->GatherTexts(own);
  ASSERT_EQ(static_cast<int>(texts.size()), Ranks()->size());
  for (int r = 0; r < Ranks()->size(); ++r) {
    EXPECT_EQ(texts[r], std::string(r, 'x'));
  }
}

TEST(Communicator, AllRanksReportTheFirstFailure) {
  std::string error;
  EXPECT_TRUE(Ranks()->Agree(true, &error));
  const int last = Ranks()->size() - 1;
  error = "rank " + std::to_string(Ranks()->rank());
  EXPECT_FALSE(Ranks()->Agree(Ranks()->rank() < last, &error));
  EXPECT_EQ(error, "rank " + std::to_string(last));
  error = "rank " + std::to_string(Ranks()->rank());
  EXPECT_FALSE(Ranks()->Agree(false, &error));
  EXPECT_EQ(error, "rank 0");
}

TEST(Communicator, CountsWhatItSends) {
  const double before = Ranks()->num_sent();
  VectorXd values = VectorXd::Zero(10);
  Ranks()->Sum(values.data(), 10);
  EXPECT_EQ(Ranks()->num_sent() - before, 20.0);
  const std::vector<std::ptrdiff_t> sizes(Ranks()->size(), 10);
  VectorXd all(10 * Ranks()->size());
  Ranks()->Gather(values.data(), sizes, all.data());
  EXPECT_EQ(Ranks()->num_sent() - before, 20.0 + 10.0 * (Ranks()->size() - 1));
}

}  // namespace communicator_test
}  // namespace invgrad
