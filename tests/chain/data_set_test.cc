#include <limits>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/data.h"

namespace invgrad {
namespace data_set_test {

using Eigen::MatrixXd;

DataSet FourSamples() {
  DataSet data;
  data.inputs.resize(2, 4);
  data.inputs << 0, 1, 2, 3, 10, 11, 12, 13;
  data.contexts = -data.inputs.topRows(1);
  data.targets = data.inputs.bottomRows(1);
  data.solutions = 2.0 * data.inputs;
  return data;
}

TEST(DataSetTest, SelectKeepsTheGivenOrder) {
  const DataSet selected = FourSamples().Select({3, 1, 3});
  ASSERT_EQ(selected.num_samples(), 3);
  EXPECT_EQ(selected.inputs.row(0), Eigen::RowVector3d(3, 1, 3));
  EXPECT_EQ(selected.contexts.row(0), Eigen::RowVector3d(-3, -1, -3));
  EXPECT_EQ(selected.targets.row(0), Eigen::RowVector3d(13, 11, 13));
  EXPECT_EQ(selected.solutions.row(0), Eigen::RowVector3d(6, 2, 6));
}

TEST(DataSetTest, RangeIsContiguous) {
  const DataSet range = FourSamples().Range(1, 2);
  EXPECT_EQ(range.inputs.row(0), Eigen::RowVector2d(1, 2));
  EXPECT_EQ(range.contexts.row(0), Eigen::RowVector2d(-1, -2));
  EXPECT_EQ(range.targets.row(0), Eigen::RowVector2d(11, 12));
  EXPECT_EQ(range.solutions.row(1), Eigen::RowVector2d(22, 24));
  EXPECT_EQ(FourSamples().Range(4, 0).num_samples(), 0);
}

TEST(DataSetTest, APieceKnowsItsPlaceInTheBatch) {
  DataSet batch;
  batch.inputs = Eigen::MatrixXd::Random(2, 10);
  EXPECT_EQ(batch.batch_size(), 10);
  const DataSet piece = batch.Piece(4, 5);
  EXPECT_EQ(piece.num_samples(), 5);
  EXPECT_EQ(piece.batch_size(), 10);
  EXPECT_EQ(piece.first_in_batch, 4);
  EXPECT_EQ(piece.inputs, batch.inputs.middleCols(4, 5));
  const DataSet part = piece.Piece(2, 3);
  EXPECT_EQ(part.batch_size(), 10);
  EXPECT_EQ(part.first_in_batch, 6);
  // A range is a batch of its own.
  EXPECT_EQ(batch.Range(4, 5).batch_size(), 5);
}

TEST(DataSetTest, AnArrayWithoutRowsMayHaveNoColumns) {
  DataSet data = FourSamples();
  data.contexts.resize(0, 0);
  EXPECT_EQ(data.Range(1, 2).contexts.cols(), 2);
  EXPECT_EQ(data.Select({0, 1, 2}).contexts.cols(), 3);
}

TEST(DataSetTest, NamesArraySampleAndEntryThatIsNotFinite) {
  std::string error;
  DataSet data = FourSamples();
  EXPECT_TRUE(data.IsFinite(&error));
  EXPECT_EQ(error, "");
  data.inputs(1, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(data.IsFinite(&error));
  EXPECT_EQ(error, "inputs: entry 1 of sample 2 is nan");
  data = FourSamples();
  data.targets(0, 3) = -std::numeric_limits<double>::infinity();
  EXPECT_FALSE(data.IsFinite(&error));
  EXPECT_EQ(error, "targets: entry 0 of sample 3 is -inf");
}

TEST(DataSetDeathTest, RefusesSamplesThatDoNotExist) {
  EXPECT_DEATH(FourSamples().Select({4}), "4 vs. 4");
  EXPECT_DEATH(FourSamples().Range(3, 2), "2 vs. 1");
}

}  // namespace data_set_test
}  // namespace invgrad
