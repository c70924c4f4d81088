#include "invgrad/io/digest.h"

#include <string>

#include "gtest/gtest.h"

namespace invgrad {
namespace digest_test {

// The vectors of the draft's appendix.
TEST(Digest, IsFnv1a) {
  EXPECT_EQ(Digest().Hex(), "cbf29ce484222325");
  EXPECT_EQ(Digest().Add("a").Hex(), "af63dc4c8601ec8c");
  EXPECT_EQ(Digest().Add("foobar").Hex(), "85944171f73967e8");
  EXPECT_EQ(Digest().Add("foo").Add("bar").Hex(), "85944171f73967e8");
}

TEST(Digest, DistinguishesShapesAndSigns) {
  const Eigen::MatrixXd wide = Eigen::MatrixXd::Ones(2, 3);
  const Eigen::MatrixXd tall = Eigen::MatrixXd::Ones(3, 2);
  Eigen::MatrixXd flipped = wide;
  flipped.row(0) *= -1.0;
  const std::string digest = Digest().Add(wide).Hex();
  EXPECT_EQ(Digest().Add(Eigen::MatrixXd(wide)).Hex(), digest);
  EXPECT_NE(Digest().Add(tall).Hex(), digest);
  EXPECT_NE(Digest().Add(flipped).Hex(), digest);
  EXPECT_NE(Digest().Add(Eigen::MatrixXd(0, 3)).Hex(),
            Digest().Add(Eigen::MatrixXd(3, 0)).Hex());
}

}  // namespace digest_test
}  // namespace invgrad
