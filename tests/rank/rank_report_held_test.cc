// Names of what remains of a gauge where residuals or constant blocks hold a part
// of it.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Geometry"
#include "Eigen/QR"
#include "gtest/gtest.h"
#include "invgrad/rank/rank_report.h"
#include "tests/rank/rank_problems.h"

namespace invgrad {
namespace rank_report_held_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Names = std::vector<std::string>;

// Of all undetermined directions, which are of one gauge, "" for no name.
Names NamesOf(const ceres::Problem& problem,
              const RankReport::Options& options = {}) {
  const RankReport report = Report(problem, options);
  ExpectConsistent(problem, report);
  EXPECT_EQ(report.gauges.size(), 1u) << report.ToText();
  Names names;
  for (const RankReport::Direction& direction : report.undetermined) {
    EXPECT_FALSE(direction.gauge.empty());
    names.push_back(direction.generator);
  }
  return names;
}

RankReport::Options Labelled(const double* values, const std::string& label) {
  RankReport::Options options;
  options.block_name = [values, label](const double* block) {
    return block == values ? label : "";
  };
  return options;
}

void AddPrior(const MatrixXd& A, double* x, ceres::Problem* problem) {
  problem->AddResidualBlock(new Linear({A}), nullptr, x);
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

// Points in the plane, any subspace of whose motions may be undetermined: the
// others have a residual each.
struct Points {
  explicit Points(int size) : x(size) {
    NumpyRandom random(17);
    for (auto& point : x) {
      for (double& entry : point) entry = random.Uniform(-4.0, 4.0);
    }
  }

  // (x, y) -> a + w (-y, x) + e (x, y)
  VectorXd Motion(double ax, double ay, double w, double e) const {
    VectorXd motion(2 * x.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      motion[2 * i] = ax - w * x[i][1] + e * x[i][0];
      motion[2 * i + 1] = ay + w * x[i][0] + e * x[i][1];
    }
    return motion;
  }

  RankReport ReportOf(const MatrixXd& undetermined) {
    const Eigen::Index n = undetermined.rows();
    const Eigen::Index k = undetermined.cols();
    const MatrixXd Q =
        Eigen::HouseholderQR<MatrixXd>(undetermined).householderQ();
    const MatrixXd A = Q.rightCols(n - k).transpose();
    ceres::Problem problem;
    std::vector<MatrixXd> coefficients;
    std::vector<double*> blocks;
    for (std::size_t i = 0; i < x.size(); ++i) {
      coefficients.emplace_back(A.middleCols(2 * static_cast<int>(i), 2));
      blocks.push_back(x[i].data());
    }
    problem.AddResidualBlock(new Linear(coefficients), nullptr, blocks);
    RankReport report = Report(problem);
    ExpectConsistent(problem, report);
    EXPECT_EQ(report.num_undetermined(), k);
    return report;
  }

  std::vector<std::array<double, 2>> x;
};

TEST(HeldGauge, ElementsOfTheSimilaritiesOfPoints) {
  Points points(7);
  const auto [x, y] = points.x[5];
  const VectorXd turn = points.Motion(y, -x, 1.0, 0.0);     // about point 5
  const VectorXd growth = points.Motion(-x, -y, 0.0, 1.0);  // the same
  const VectorXd up = points.Motion(0.0, 1.0, 0.0, 0.0);
  const auto both = [](const VectorXd& a, const VectorXd& b) {
    MatrixXd result(a.size(), 2);
    result << a + 0.3 * b, b - a;  // mixed
    return result;
  };
  struct Case {
    MatrixXd undetermined;
    Names names;
  };
  for (const auto& [undetermined, names] :
       {Case{turn, {"rotation about `block 5`"}},
        Case{growth, {"scale about `block 5`"}},
        Case{both(turn, growth),
             {"rotation about `block 5`", "scale about `block 5`"}},
        Case{both(up, growth), {"translation y", "scale about `block 5`"}},
        // A spiral, alone and beside a translation.
        Case{turn + 0.5 * growth, {""}},
        Case{both(up, turn + 0.5 * growth), {"translation y", ""}}}) {
    const RankReport report = points.ReportOf(undetermined);
    ASSERT_EQ(report.undetermined.size(), names.size()) << report.ToText();
    for (std::size_t i = 0; i < names.size(); ++i) {
      EXPECT_EQ(report.undetermined[i].generator, names[i]);
    }
    EXPECT_EQ(report.gauges.size(), 1u);
  }
}

TEST(HeldGauge, OtherCombinationsAreNoGauge) {
  for (const int size : {2, 3, 5, 20}) {
    for (const int k : {1, 2, 3}) {
      SCOPED_TRACE(testing::Message() << size << " points, " << k);
      Points points(size);
      NumpyRandom random(100 * size + k);
      MatrixXd undetermined(2 * size, k);
      for (auto column : undetermined.colwise()) {
        for (double& entry : column) entry = random.Uniform(-1.0, 1.0);
      }
      const RankReport report = points.ReportOf(undetermined);
      EXPECT_TRUE(report.gauges.empty()) << report.ToText();
    }
  }
}

// One direction off a rotation by 1e-3 is no rotation.
TEST(HeldGauge, NearlyARotationIsNoGauge) {
  Points points(7);
  VectorXd motion = points.Motion(0.2, -0.4, 1.0, 0.0);
  motion[4] += 1e-3;
  EXPECT_TRUE(points.ReportOf(motion).gauges.empty());
}

// y_c = gain_c colour_c
struct ChannelProducts {
  template <typename T>
  bool operator()(const T* gain, const T* colour, T* r) const {
    for (int c = 0; c < 3; ++c) r[c] = gain[c] * colour[c] - 0.5;
    return true;
  }
};

TEST(HeldGauge, FactorOfEachChannel) {
  for (const int num_images : {1, 4, 60}) {
    SCOPED_TRACE(num_images);
    NumpyRandom random(23);
    std::vector<std::array<double, 3>> gains(num_images);
    std::vector<std::array<double, 3>> colours(6);
    for (auto* blocks : {&gains, &colours}) {
      for (auto& block : *blocks) {
        for (double& entry : block) entry = random.Uniform(0.5, 2.0);
      }
    }
    ceres::Problem problem;
    for (auto& gain : gains) {
      for (auto& colour : colours) {
        problem.AddResidualBlock(
            new ceres::AutoDiffCostFunction<ChannelProducts, 3, 3, 3>(
                new ChannelProducts),
            nullptr,
            gain.data(),
            colour.data());
      }
    }
    EXPECT_EQ(NamesOf(problem),
              (Names{"factor of component 0",
                     "factor of component 1",
                     "factor of component 2"}));
    AddPrior(Row({0.0, 1.0, 0.0}), gains[0].data(), &problem);
    EXPECT_EQ(NamesOf(problem),
              (Names{"factor of component 0", "factor of component 2"}));
    problem.SetManifold(colours[2].data(), new ceres::SubsetManifold(3, {0}));
    EXPECT_EQ(NamesOf(problem), Names{"factor of component 2"});
  }
}

// A gauge of one's own names what remains of it by itself.
TEST(HeldGauge, CombinationsOfOnesOwnGauge) {
  std::vector<std::array<double, 4>> x(5, {1.0, 2.0, 3.0, 4.0});
  const MatrixXd I = MatrixXd::Identity(4, 4);
  ceres::Problem problem;
  for (std::size_t i = 0; i + 1 < x.size(); ++i) {
    problem.AddResidualBlock(
        new Linear({I, -I}), nullptr, x[i].data(), x[i + 1].data());
  }
  // Translations with these rows' null vector (1, 2, -1, 0) / 2 remain.
  MatrixXd held(3, 4);
  held << 2.0, -1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  AddPrior(held, x[1].data(), &problem);
  RankReport::Options options;
  Gauge gauge;
  gauge.name = "offsets";
  gauge.generators = {"a", "b", "c", "d"};
  gauge.motions = [](const GaugeComponent& component, MatrixXd* motions) {
    for (const GaugeBlock& block : component.blocks) {
      motions->middleRows(block.offset, 4).setIdentity();
    }
    return true;
  };
  options.gauges = {gauge};
  EXPECT_EQ(NamesOf(problem, options), Names{""});
  VectorXd given;
  options.gauges[0].name_combinations = [&given](const GaugeComponent&,
                                                 const MatrixXd& coefficients) {
    EXPECT_EQ(coefficients.cols(), 1);
    given = coefficients.col(0);
    return std::vector<Gauge::Combination>{
        {"no such motion", VectorXd::Ones(4)}, {"a + 2 b - c", given}};
  };
  // A combination that changes the residuals is not reported.
  EXPECT_EQ(NamesOf(problem, options), Names{"a + 2 b - c"});
  EXPECT_LE((given / given[0] - Eigen::Vector4d(1.0, 2.0, -1.0, 0.0)).norm(),
            1e-12);
}

}  // namespace rank_report_held_test
}  // namespace invgrad
