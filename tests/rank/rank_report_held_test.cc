// Names of what remains of a gauge where residuals or constant blocks hold a part
// of it.
#include <array>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "gtest/gtest.h"
#include "invgrad/rank_report.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace rank_report_held_test {

using Eigen::MatrixXd;
RankReport::Options Labelled(const double* values, const std::string& label) {
  RankReport::Options options;
  options.block_name = [values, label](const double* block) {
    return block == values ? label : "";
  };
  return options;
}

TEST(HeldGauge, RotationInThePlaneAboutAHeldPosition) {
  // 2 to 3400 poses: up to 10,200 parameters, by the sparse decomposition.
  for (const int size : {2, 3, 40, 3400}) {
    SCOPED_TRACE(size);
    ceres::Problem problem;
    Graph2 graph(size, 1.0, &problem);
    const int held = size / 2;
    double* pose = graph.poses[held].data();
    problem.SetManifold(pose, new ceres::SubsetManifold(3, {0, 1}));
    const RankReport report = Report(problem, Labelled(pose, "dock"));
    EXPECT_EQ(report.num_undetermined(), 1);
    ASSERT_EQ(report.gauges.size(), 1u) << report.ToText();
    EXPECT_EQ(report.gauges[0].name, "rigid motion in the plane");
    EXPECT_EQ(report.undetermined[0].generator, "rotation about `dock`");
    EXPECT_NE(
        report.ToText().find("(1 of 3 directions; " + std::to_string(size) +
                             " blocks)\n"
                             "    rotation about `dock`\n"),
        std::string::npos)
        << report.ToText();
  }
}

TEST(HeldGauge, PriorsInThePlane) {
  struct Case {
    MatrixXd prior;  // of pose 0
    Names names;
  };
  const MatrixXd I = MatrixXd::Identity(3, 3);
  for (const auto& [prior, names] :
       {Case{I.topRows(2), {"rotation about `block 0`"}},
        Case{I.topRows(1), {"translation y", "rotation about `block 0`"}},
        Case{I.middleRows(1, 1), {"translation x", "rotation about `block 0`"}},
        // The angle is component 2.
        Case{I.bottomRows(1),
             {"translation of component 0", "translation of component 1"}},
        Case{Row({0.6, 0.8, 0.0}),
             {"translation along (0.8, -0.6)", "rotation about `block 0`"}}}) {
    ceres::Problem problem;
    Graph2 graph(25, 1.0, &problem);
    AddPrior(prior, graph.poses[0].data(), &problem);
    EXPECT_EQ(NamesOf(problem), names);
  }
}

// Where there is no block, or more than one, the name has the coordinates: the
// others may be no points.
TEST(HeldGauge, RotationAboutAPointWithoutABlockOfItsOwn) {
  ceres::Problem problem;
  Graph2 graph(12, 1.0, &problem);
  graph.poses[3] = {1.0, 2.0, 0.1};
  graph.poses[8] = {2.0, 0.5, 0.4};
  const MatrixXd A = MatrixXd::Identity(2, 3);
  const auto mean = problem.AddResidualBlock(new Linear({A, A}),
                                             nullptr,
                                             graph.poses[3].data(),
                                             graph.poses[8].data());
  EXPECT_EQ(NamesOf(problem), Names{"rotation about (1.5, 1.25)"});
  problem.RemoveResidualBlock(mean);
  AddPrior(A, graph.poses[3].data(), &problem);
  graph.poses[8] = {1.0, 2.0, -2.0};
  EXPECT_EQ(NamesOf(problem), Names{"rotation about (1, 2)"});
}

// Lengths and angles in other units, and far from the origin.
TEST(HeldGauge, UnitsAndOriginDoNotMatter) {
  for (const double unit : {1e-6, 1.0, 1e6}) {
    for (const double offset : {0.0, 4e6}) {
      SCOPED_TRACE(testing::Message() << unit << " " << offset);
      ceres::Problem problem;
      Graph2 graph(30, 1.0, &problem);
      for (auto& pose : graph.poses) {
        for (int i = 0; i < 2; ++i) pose[i] = unit * (pose[i] + offset);
      }
      AddPrior(MatrixXd::Identity(2, 3), graph.poses[12].data(), &problem);
      EXPECT_EQ(NamesOf(problem, Labelled(graph.poses[12].data(), "dock")),
                Names{"rotation about `dock`"});
    }
  }
}

// x, y and angle in their own blocks.
TEST(HeldGauge, PriorsOnPosesOfThreeBlocks) {
  ceres::Problem unused_problem;
  Graph2 graph(9, 1.0, &unused_problem);
  ceres::Problem problem;
  for (int i = 0; i + 1 < 9; ++i) {
    double* a = graph.poses[i].data();
    double* b = graph.poses[i + 1].data();
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<SplitBetween2, 3, 1, 1, 1, 1, 1, 1>(
            new SplitBetween2),
        nullptr,
        a,
        a + 1,
        a + 2,
        b,
        b + 1,
        b + 2);
  }
  AddPrior(Row({1.0}), graph.poses[0].data(), &problem);
  AddPrior(Row({1.0}), graph.poses[0].data() + 1, &problem);
  EXPECT_EQ(NamesOf(problem), Names{"rotation about `block 0`, `block 1`"});
}

TEST(HeldGauge, RotationsInSpace) {
  for (const int size : {3, 15, 300}) {
    SCOPED_TRACE(size);
    ceres::Problem problem;
    Graph3 graph(size, &problem);
    graph.p[0] = {0.25, -1.5, 2.0};
    graph.p[2] = {1.0, 0.5, 0.0};
    problem.SetParameterBlockConstant(graph.p[0].data());
    EXPECT_EQ(NamesOf(problem, Labelled(graph.p[0].data(), "p 0")),
              (Names{"rotation about x through `p 0`",
                     "rotation about y through `p 0`",
                     "rotation about z through `p 0`"}));
    EXPECT_EQ(NamesOf(problem).front(),
              "rotation about x through the constant block at (0.25, -1.5, 2)");
    problem.SetParameterBlockConstant(graph.p[2].data());
    RankReport::Options options;
    options.block_name = [&graph](const double* values) {
      for (std::size_t i = 0; i < graph.p.size(); ++i) {
        if (values == graph.p[i].data()) return "p " + std::to_string(i);
      }
      return std::string();
    };
    EXPECT_EQ(NamesOf(problem, options),
              Names{"rotation about the axis through `p 0` and `p 2`"});
  }
}

// Two heights held: a hinge, and a rotation about the vertical.
TEST(HeldGauge, HeightsOfTwoPoses) {
  ceres::Problem problem;
  Graph3 graph(9, &problem);
  graph.p[2] = {1.0, 0.5, 0.0};
  graph.p[5] = {4.0, 4.5, 2.0};
  for (const int i : {2, 5}) {
    problem.SetManifold(graph.p[i].data(), new ceres::SubsetManifold(3, {2}));
  }
  EXPECT_EQ(NamesOf(problem, Labelled(graph.p[2].data(), "p 2")),
            (Names{"translation x",
                   "translation y",
                   "rotation about z through `p 2`",
                   "rotation about (0.6, 0.8, 0) through `p 2`"}));
}

// The tangent of an Eigen quaternion turns about the axes of the world.
MatrixXd TangentRows(const std::array<double, 4>& q) {
  Eigen::Matrix<double, 4, 3, Eigen::RowMajor> P;
  EXPECT_TRUE(
      ceres::EigenQuaternionManifold().PlusJacobian(q.data(), P.data()));
  return P.transpose();
}

TEST(HeldGauge, GravityAndPartsOfAPosition) {
  const MatrixXd I = MatrixXd::Identity(3, 3);
  {
    ceres::Problem problem;
    Graph3 graph(10, &problem);
    AddPrior(I, graph.p[4].data(), &problem);
    AddPrior(TangentRows(graph.q[4]).topRows(2), graph.q[4].data(), &problem);
    EXPECT_EQ(NamesOf(problem, Labelled(graph.p[4].data(), "p 4")),
              Names{"rotation about z through `p 4`"});
  }
  {
    ceres::Problem problem;
    Graph3 graph(10, &problem);
    AddPrior(I.topRows(1), graph.p[0].data(), &problem);
    EXPECT_EQ(NamesOf(problem),
              (Names{"translation y",
                     "translation z",
                     "rotation about x through `block 0`",
                     "rotation about y through `block 0`",
                     "rotation about z through `block 0`"}));
  }
  {
    ceres::Problem problem;
    Graph3 graph(10, &problem);
    AddPrior(TangentRows(graph.q[4]).topRows(2), graph.q[4].data(), &problem);
    EXPECT_EQ(NamesOf(problem),
              (Names{"translation x",
                     "translation y",
                     "translation z",
                     "rotation about z"}));
  }
}

// A rotation about z that lifts: a rigid motion, but neither a rotation nor a
// translation.
TEST(HeldGauge, ScrewHasNoName) {
  ceres::Problem problem;
  Graph3 graph(10, &problem);
  AddPrior(MatrixXd::Identity(2, 3), graph.p[0].data(), &problem);
  const MatrixXd tangent = TangentRows(graph.q[0]);
  AddPrior(tangent.topRows(2), graph.q[0].data(), &problem);
  problem.AddResidualBlock(
      new Linear({Row({0.0, 0.0, 1.0}), -0.7 * tangent.bottomRows(1)}),
      nullptr,
      graph.p[0].data(),
      graph.q[0].data());
  EXPECT_EQ(NamesOf(problem), Names{""});
}

// The centre of a camera (angle axis, translation, ...).
struct CameraCenter {
  template <typename T>
  bool operator()(const T* camera, T* r) const {
    const T inverse[3] = {-camera[0], -camera[1], -camera[2]};
    ceres::AngleAxisRotatePoint(inverse, camera + 3, r);
    return true;
  }
};

TEST(HeldGauge, ReconstructionsWithAHeldCamera) {
  Scene scene(4, 25);
  double* camera = scene.cameras[2].data();
  {
    ceres::Problem problem;
    scene.AddAllImages(&problem);
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<CameraCenter, 3, 9>(new CameraCenter),
        nullptr,
        camera);
    EXPECT_EQ(NamesOf(problem, Labelled(camera, "left")),
              (Names{"rotation about x through `left`",
                     "rotation about y through `left`",
                     "rotation about z through `left`",
                     "scale about `left`"}));
  }
  ceres::Problem problem;
  scene.AddAllImages(&problem);
  problem.SetParameterBlockConstant(camera);
  EXPECT_EQ(NamesOf(problem, Labelled(camera, "left")),
            Names{"scale about `left`"});
  // And a point: nothing remains.
  problem.SetParameterBlockConstant(scene.points[3].data());
  EXPECT_EQ(Report(problem).num_undetermined(), 0);
}

// The centre of a camera of two blocks has the translation's name.
TEST(HeldGauge, HeldCameraOfTwoBlocks) {
  Scene scene(4, 20);
  ceres::Problem problem;
  scene.AddSplitCameras(&problem);
  double* translation = scene.cameras[1].data() + 3;
  problem.SetParameterBlockConstant(scene.q[1].data());
  problem.SetParameterBlockConstant(translation);
  EXPECT_EQ(NamesOf(problem, Labelled(translation, "left")),
            Names{"scale about `left`"});
}

}  // namespace rank_report_held_test
}  // namespace invgrad
