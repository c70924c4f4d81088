#include "problems/estimation/g2o_file.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/estimation/g2o_texts.h"
#include "tests/support/damaged_text.h"
#include "tests/support/published_data.h"
#include "tests/support/reader_check.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace g2o_file_test {

constexpr TextFormat<PoseGraph> kFormat = {ParseG2o, G2oText};

TEST(G2oFile, ReadsPosesInThePlane) {
  PoseGraph graph;
  std::string error;
  ASSERT_TRUE(ParseG2o(kG2oPlane, "f", &graph, &error)) << error;
  EXPECT_EQ(graph.dimension, 2);
  EXPECT_EQ(graph.ids, (std::vector<long>{3, 7}));
  EXPECT_EQ(graph.fixed, std::vector<int>{0});
  ASSERT_EQ(graph.poses.rows(), 3);
  ASSERT_EQ(graph.poses.cols(), 2);
  EXPECT_EQ(graph.poses.col(0), Eigen::Vector3d(0.5, -1.0, 3.25));
  EXPECT_EQ(graph.poses.col(1), Eigen::Vector3d(1e-300, 1e300, 0.0));
  ASSERT_EQ(graph.edges.size(), 2);
  const PoseGraph::Edge& edge = graph.edges[0];
  EXPECT_EQ(edge.from, 1);
  EXPECT_EQ(edge.to, 0);
  EXPECT_EQ(edge.measurement, Eigen::Vector3d(-0.031191, 0.5, -3.112485));
  EXPECT_EQ(edge.information,
            (Eigen::Matrix3d() << 4, 1, 2, 1, 5, 3, 2, 3, 6).finished());
}

TEST(G2oFile, ReadsPosesInSpace) {
  PoseGraph graph;
  std::string error;
  ASSERT_TRUE(ParseG2o(kG2oSpace, "f", &graph, &error)) << error;
  EXPECT_EQ(graph.dimension, 3);
  EXPECT_EQ(graph.ids, (std::vector<long>{0, 1}));
  EXPECT_EQ(graph.fixed, (std::vector<int>{1, 0}));
  ASSERT_EQ(graph.poses.rows(), 7);
  ASSERT_EQ(graph.poses.cols(), 2);
  EXPECT_EQ(graph.poses.col(0),
            (Eigen::VectorXd(7) << 0, 0, 0, 0, 0, 0, 1).finished());
  EXPECT_EQ(graph.poses.col(1).head(3),
            Eigen::Vector3d(0.341895, -0.0416997, 0.0330394));
  // Two roundings each.
  EXPECT_TRUE(graph.poses.col(1).tail(4).isApprox(
      Eigen::Vector4d(0.0, 0.6, 0.0, -0.8), 1e-15));
  ASSERT_EQ(graph.edges.size(), 1);
  const PoseGraph::Edge& edge = graph.edges[0];
  EXPECT_EQ(edge.from, 0);
  EXPECT_EQ(edge.to, 1);
  EXPECT_EQ(edge.measurement,
            (Eigen::VectorXd(7) << 1, 2, 3, 0.5, 0.5, 0.5, 0.5).finished());
  Eigen::MatrixXd information(6, 6);
  information << 10, 1, 0, 0, 0, 0,  //
      1, 10, 0, 0, 0, 0,             //
      0, 0, 10, 0, 0, 0,             //
      0, 0, 0, 400, 7, 9,            //
      0, 0, 0, 7, 401, -9,           //
      0, 0, 0, 9, -9, 99;
  EXPECT_EQ(edge.information, information);
}

TEST(G2oFile, ReadsLandmarksAndPriorsInThePlane) {
  PoseGraph graph;
  std::string error;
  ASSERT_TRUE(ParseG2o(kG2oPlaneLandmarks, "f", &graph, &error)) << error;
  EXPECT_EQ(graph.ids, std::vector<long>{1});
  EXPECT_EQ(graph.num_poses_by_edges, 1);
  // Where the prior says.
  EXPECT_EQ(graph.poses.col(0), Eigen::Vector3d(1.0, 2.0, 0.5));
  EXPECT_EQ(graph.landmark_ids, std::vector<long>{9});
  EXPECT_EQ(graph.num_landmarks_by_edges, 0);
  EXPECT_EQ(graph.landmarks.col(0), Eigen::Vector2d(3.0, -1e-3));
  EXPECT_TRUE(graph.fixed.empty());
  EXPECT_EQ(graph.fixed_landmarks, std::vector<int>{0});
  ASSERT_EQ(graph.edges.size(), 2);
  EXPECT_EQ(graph.edges[0].kind, PoseGraph::EdgeKind::kLandmark);
  EXPECT_EQ(graph.edges[0].measurement, Eigen::Vector2d(0.5, -0.25));
  EXPECT_EQ(graph.edges[0].information,
            (Eigen::Matrix2d() << 4, 1, 1, 2).finished());
  EXPECT_EQ(graph.edges[1].kind, PoseGraph::EdgeKind::kPrior);
  EXPECT_EQ(graph.edges[1].information(0, 0), 400.0);
  EXPECT_EQ(Eigen::MatrixXd(graph.edges[1].information).norm(), 400.0);
}

TEST(G2oFile, ReadsLandmarksPriorsAndOffsetsInSpace) {
  PoseGraph graph;
  std::string error;
  ASSERT_TRUE(ParseG2o(kG2oSpaceLandmarks, "f", &graph, &error)) << error;
  EXPECT_EQ(graph.ids, (std::vector<long>{2, 5}));
  EXPECT_EQ(graph.landmark_ids, (std::vector<long>{3, 6}));
  EXPECT_EQ(graph.num_poses_by_edges, 1);
  EXPECT_EQ(graph.num_landmarks_by_edges, 1);
  EXPECT_EQ(graph.fixed_landmarks, std::vector<int>{0});
  ASSERT_EQ(graph.offsets.size(), 2);
  EXPECT_EQ(graph.offsets[0].id, 11);
  EXPECT_EQ(graph.offsets[1].id, 0);
  ASSERT_EQ(graph.edges.size(), 4);
  const PoseGraph::Edge& between = graph.edges[1];
  EXPECT_EQ(between.kind, PoseGraph::EdgeKind::kRelative);
  EXPECT_EQ(between.offset_from, 0);
  EXPECT_EQ(between.offset_to, 1);
  EXPECT_EQ(between.to, 1);
  const PoseGraph::Edge& prior = graph.edges[2];
  EXPECT_EQ(prior.kind, PoseGraph::EdgeKind::kPrior);
  EXPECT_EQ(prior.from, 1);
  EXPECT_EQ(prior.offset_from, 1);
  EXPECT_EQ(prior.information(2, 2), 5.0);
  const PoseGraph::Edge& seen = graph.edges[3];
  EXPECT_EQ(seen.kind, PoseGraph::EdgeKind::kLandmark);
  EXPECT_EQ(seen.to, 1);
  EXPECT_EQ(seen.measurement, Eigen::Vector3d(1.0, 0.0, 0.0));
}

TEST(G2oFile, WritesEveryTagInKind) {
  PoseGraph graph;
  std::string error;
  ASSERT_TRUE(ParseG2o(kG2oPlaneLandmarks, "f", &graph, &error)) << error;
  EXPECT_EQ(G2oText(graph),
            "VERTEX_SE2 1 1 2 0.5\n"
            "VERTEX_XY 9 3 -0.001\n"
            "FIX 9\n"
            "EDGE_SE2_XY 1 9 0.5 -0.25 4 1 2\n"
            "EDGE_PRIOR_SE2 1 1 2 0.5 400 0 0 0 0 0\n");
  ASSERT_TRUE(ParseG2o(kG2oSpaceLandmarks, "f", &graph, &error)) << error;
  const std::string text = G2oText(graph);
  for (const char* line :
       {"PARAMS_SE3OFFSET 11 0.1 0 0 0 0 0.6 0.8\n",
        "VERTEX_TRACKXYZ 3 1 0 -1\n",
        "FIX 3\n",
        "EDGE_SE3_TRACKXYZ 2 3 11 1 2 3 9 1 0 9 0 9\n",
        "EDGE_SE3_OFFSET 2 5 11 0 1 2 3 0 0 0 1 1 0 0 0 0 0 1",
        "EDGE_SE3_PRIOR 5 0 1 2 3 0 0 0 1 0 0 0 0 0 0 0 0 0 0 0 5"}) {
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
  }
}

TEST(G2oFile, SkipsAByteOrderMark) {
  for (const std::string whole : kG2oTexts) {
    PoseGraph expected;
    PoseGraph graph;
    std::string error;
    ASSERT_TRUE(ParseG2o(whole, "f", &expected, &error)) << error;
    ASSERT_TRUE(ParseG2o("\xEF\xBB\xBF" + whole, "f", &graph, &error)) << error;
    EXPECT_EQ(G2oText(graph), G2oText(expected));
  }
}

TEST(G2oFile, ReadsEveryEndOfLinesAndOfTheText) {
  for (const std::string whole : kG2oTexts) {
    for (const std::string& text : {WithCrLf(whole),
                                    whole + "\n \t\r\n\n",
                                    whole.substr(0, whole.size() - 1)}) {
      PoseGraph expected;
      PoseGraph graph;
      std::string error;
      ASSERT_TRUE(ParseG2o(whole, "f", &expected, &error)) << error;
      ASSERT_TRUE(ParseG2o(text, "f", &graph, &error)) << error;
      EXPECT_EQ(G2oText(graph), G2oText(expected));
    }
  }
}

TEST(G2oFile, WritesWhatItReads) {
  const TemporaryFolder folder;
  for (const std::string text : {kG2oPlane, kG2oSpace}) {
    PoseGraph graph;
    PoseGraph back;
    std::string error;
    ASSERT_TRUE(ParseG2o(text, "f", &graph, &error)) << error;
    graph.poses(0, 0) = 1.0 / 3.0;
    graph.poses(1, 0) = std::numeric_limits<double>::denorm_min();
    graph.edges[0].information *= 0.1;
    ASSERT_TRUE(WriteG2oFile(folder / "x.g2o", graph, &error)) << error;
    ASSERT_TRUE(ReadG2oFile(folder / "x.g2o", &back, &error)) << error;
    EXPECT_EQ(back.dimension, graph.dimension);
    EXPECT_EQ(back.ids, graph.ids);
    EXPECT_EQ(back.fixed, graph.fixed);
    EXPECT_EQ(back.poses, graph.poses);
    ASSERT_EQ(back.edges.size(), graph.edges.size());
    for (size_t i = 0; i < graph.edges.size(); ++i) {
      EXPECT_EQ(back.edges[i].from, graph.edges[i].from);
      EXPECT_EQ(back.edges[i].to, graph.edges[i].to);
      EXPECT_EQ(back.edges[i].measurement, graph.edges[i].measurement);
      EXPECT_EQ(back.edges[i].information, graph.edges[i].information);
    }
    EXPECT_EQ(G2oText(back), G2oText(graph));
  }
}

// Another normalization would change last bits.
TEST(G2oFile, LeavesNormalizedQuaternionsAlone) {
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector4d quaternion(std::sin(i),
                                     std::sin(2 * i + 1.0),
                                     std::cos(3 * i),
                                     std::sin(5 * i + 2.0));
    std::string text = "VERTEX_SE3:QUAT 0 0 0 0";
    for (const double value : quaternion) {
      text += " " + std::to_string(value);
    }
    EXPECT_EQ(FindReaderFlaw(kFormat, text), "") << text;
  }
}

TEST(G2oFile, WritesNoOtherData) {
  const TemporaryFolder folder;
  PoseGraph good;
  std::string error;
  ASSERT_TRUE(ParseG2o(kG2oSpace, "f", &good, &error)) << error;
  std::vector<PoseGraph> bad(10, good);
  bad[0] = {};
  bad[1].dimension = 2;
  bad[2].ids[1] = 0;
  bad[3].ids[1] = -1;
  bad[4].poses(1, 1) = std::nan("");
  bad[5].poses(3, 1) = 2.0;
  bad[6].fixed[0] = 0;
  bad[7].edges[0].from = 1;
  bad[8].edges[0].measurement.resize(3);
  bad[9].edges[0].information *= -1.0;
  for (const PoseGraph& graph : bad) {
    error.clear();
    EXPECT_FALSE(WriteG2oFile(folder / "x.g2o", graph, &error));
    EXPECT_EQ(error.find("cannot write " + folder / "x.g2o:"), 0) << error;
  }
  EXPECT_EQ(folder.NumFiles(), 0);
}

TEST(G2oFile, SaysWhichFileCannotBeRead) {
  const TemporaryFolder folder;
  PoseGraph graph;
  std::string error;
  EXPECT_FALSE(ReadG2oFile(folder / "none", &graph, &error));
  EXPECT_EQ(error, "cannot read " + folder / "none: No such file or directory");
  EXPECT_FALSE(ReadG2oFile(folder / "", &graph, &error));
  EXPECT_EQ(error, "cannot read " + folder / ": not a regular file");
}

TEST(G2oFile, SurvivesDamage) {
  for (const char* whole : kG2oTexts) {
    for (const std::string& text : DamagedTexts(whole)) {
      ASSERT_EQ(FindReaderFlaw(kFormat, text), "") << text;
    }
  }
}

TEST(G2oFile, SurvivesTheFuzzersCorpus) {
  for (const std::string& text : FuzzCorpus("g2o_file")) {
    EXPECT_EQ(FindReaderFlaw(kFormat, text), "") << text;
  }
}

TEST(G2oFile, ReadsPublishedFiles) {
  struct Case {
    const char* name;
    int dimension;
    int num_poses;
    int num_edges;
  };
  for (const Case& published :
       {Case{"M3500.g2o", 2, 3500, 5453}, {"sphere2500.g2o", 3, 2500, 4949}}) {
    const std::string path =
        PublishedData(std::string("g2o/") + published.name);
    if (path.empty()) {
      GTEST_SKIP() << published.name << " is not in g2o/ of $INVGRAD_DATA: see "
                   << "https://lucacarlone.mit.edu/datasets/";
    }
    PoseGraph graph;
    std::string error;
    ASSERT_TRUE(ReadG2oFile(path, &graph, &error)) << error;
    EXPECT_EQ(graph.dimension, published.dimension);
    EXPECT_EQ(graph.ids.size(), published.num_poses);
    EXPECT_EQ(graph.edges.size(), published.num_edges);
    EXPECT_EQ(FindReaderFlaw(kFormat, G2oText(graph)), "");
  }
}

}  // namespace g2o_file_test
}  // namespace invgrad
