#include "invgrad/output_layer/drift_ridge.h"

#include "gtest/gtest.h"

namespace invgrad {
namespace {

TEST(DriftRidge, RisesWhereTheStepsUndoTheFit) {
  DriftRidge drift;
  const double first = drift.RidgeFor(1e9);
  EXPECT_EQ(drift.RidgeFor(1e-9), first) << "there is no last residual";
  drift.SetResidual(0.5);
  EXPECT_EQ(drift.RidgeFor(8.0), first / 2.0) << "at the limit";
  EXPECT_EQ(drift.RidgeFor(8.1), 4.0 * first);
  for (int k = 0; k < 20; ++k) drift.RidgeFor(8.1);
  EXPECT_EQ(drift.RidgeFor(8.1), 1.0);
  for (int k = 0; k < 100; ++k) drift.RidgeFor(0.5);
  const double smallest = drift.RidgeFor(0.5);
  EXPECT_GT(smallest, 0.0);
  EXPECT_LE(smallest, 1e-16);
}

TEST(DriftRidge, AnExactFitThatStaysIsNoReasonToRaise) {
  DriftRidge drift;
  const double first = drift.RidgeFor(1.0);
  drift.SetResidual(0.0);
  EXPECT_LT(drift.RidgeFor(0.0), first);
  EXPECT_GT(drift.RidgeFor(1e-30), first / 2.0);
}

}  // namespace
}  // namespace invgrad
