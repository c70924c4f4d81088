#include "problems/estimation/g2o_file.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/damaged_text.h"
#include "tests/support/published_data.h"
#include "tests/support/reader_check.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace g2o_file_test {

constexpr TextFormat<PoseGraph> kFormat = {ParseG2o, G2oText};

// Vertex 7 is named before it is there.
const char kPlane[] = R"(# two poses
VERTEX_SE2 3 0.5 -1 3.25
FIX 3

EDGE_SE2 7 3 -0.031191 +.5 -3.112485 4 1 2 5 3 6
VERTEX_SE2 7 1e-300 1e300 -0.0
EDGE_SE2 3 7 0 0 0 1e-300 0 0 1e-300 0 1e300
)";

// The second quaternion has length 5e200.
const char kSpace[] = R"(VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1
VERTEX_SE3:QUAT 1 0.341895 -0.0416997 0.0330394 0 3e200 0 -4e200
EDGE_SE3:QUAT 0 1 1 2 3 1 1 1 1 10 1 0 0 0 0 10 0 0 0 0 10 0 0 0 400 7 9 401 -9 99
FIX 1 0
)";

TEST(G2oFile, ReadsPosesInThePlane) {
  PoseGraph graph;
  std::string error;
  ASSERT_TRUE(ParseG2o(kPlane, "f", &graph, &error)) << error;
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
  ASSERT_TRUE(ParseG2o(kSpace, "f", &graph, &error)) << error;
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

TEST(G2oFile, ReadsEveryEndOfLinesAndOfTheText) {
  for (const std::string whole : {kPlane, kSpace}) {
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
  for (const std::string text : {kPlane, kSpace}) {
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
  ASSERT_TRUE(ParseG2o(kSpace, "f", &good, &error)) << error;
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

TEST(G2oFile, SaysWhatIsWrongAndWhere) {
  struct Case {
    const char* text;
    int line;
    const char* replacement;
    const char* message;
  };
  const std::vector<Case> cases = {
      {kPlane,
       2,
       "VERTEX_TRACKXYZ 3 0 0 0",
       "2: found 'VERTEX_TRACKXYZ'; expected VERTEX_SE2, VERTEX_SE3:QUAT, "
       "EDGE_SE2, EDGE_SE3:QUAT or FIX"},
      {kPlane,
       2,
       "VERTEX_SE2",
       "2: the line ends; expected a vertex's id: an integer from 0 to "
       "9223372036854775807"},
      {kPlane,
       2,
       "VERTEX_SE2 -1 0 0 0",
       "2: found '-1'; expected a vertex's id: an integer from 0 to "
       "9223372036854775807"},
      {kPlane,
       2,
       "VERTEX_SE2 9223372036854775808 0 0 0",
       "2: found '9223372036854775808'; expected a vertex's id: an integer "
       "from 0 to 9223372036854775807"},
      {kPlane,
       2,
       "VERTEX_SE2 3 0 0",
       "2: the line ends; expected a pose's coordinate: a finite double"},
      {kPlane,
       2,
       "VERTEX_SE2 3 0 0 0 0",
       "2: found '0'; expected the line's end"},
      {kPlane,
       2,
       "VERTEX_SE2 3 0 nan 0",
       "2: found 'nan'; expected a pose's coordinate: a finite double"},
      {kPlane,
       2,
       "VERTEX_SE2 3 0 inf 0",
       "2: found 'inf'; expected a pose's coordinate: a finite double"},
      {kPlane,
       2,
       "VERTEX_SE2 3 0 0 1e999",
       "2: found '1e999'; expected a pose's coordinate: a finite double"},
      {kPlane, 2, "", "5: there is no vertex 3; expected the id of a vertex"},
      {kPlane,
       3,
       "FIX",
       "3: the line ends; expected a vertex's id: an integer "
       "from 0 to 9223372036854775807"},
      {kPlane,
       3,
       "FIX 5",
       "3: there is no vertex 5; expected the id of a vertex"},
      {kPlane,
       3,
       "FIX 3 3",
       "3: vertex 3 is fixed twice; expected each vertex once"},
      {kPlane,
       5,
       "EDGE_SE2 4 3 0 0 0 1 0 0 1 0 1",
       "5: there is no vertex 4; expected the id of a vertex"},
      {kPlane,
       5,
       "EDGE_SE2 3 4 0 0 0 1 0 0 1 0 1",
       "5: there is no vertex 4; expected the id of a vertex"},
      {kPlane,
       5,
       "EDGE_SE2 3 3 0 0 0 1 0 0 1 0 1",
       "5: the edge joins vertex 3 with itself; expected two vertices"},
      {kPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 0 0 1 0",
       "5: the line ends; expected an entry of the information matrix: a "
       "finite double"},
      {kPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 0 0 1 0 1 0",
       "5: found '0'; expected the line's end"},
      {kPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 2 0 1 0 1",
       "5: the information matrix is not positive definite; expected the "
       "inverse of a covariance"},
      {kPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 0 0 0 0 1",
       "5: the information matrix is not positive definite; expected the "
       "inverse of a covariance"},
      // Overflows in the factorization.
      {kPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 1e300 1e300 1 0 1",
       "5: the information matrix is not positive definite; expected the "
       "inverse of a covariance"},
      {kPlane,
       6,
       "VERTEX_SE2 3 0 0 0",
       "6: vertex 3 is there twice; expected another id"},
      {kPlane,
       6,
       "VERTEX_SE3:QUAT 7 0 0 0 0 0 0 1",
       "6: a tag of SE3; expected SE2 as in the lines before"},
      {kSpace,
       2,
       "VERTEX_SE2 1 0 0 0",
       "2: a tag of SE2; expected SE3 as in the lines before"},
      {kSpace,
       2,
       "VERTEX_SE3:QUAT 1 0 0 0 0 0 -0.0 0",
       "2: the quaternion is zero; expected a rotation"},
      {kSpace,
       3,
       "EDGE_SE3:QUAT 0 1 1 2 3 0 0 0 0",
       "3: the quaternion is zero; expected a rotation"},
  };
  PoseGraph sentinel;
  sentinel.dimension = 2;
  sentinel.ids = {7};
  sentinel.poses.setConstant(3, 1, 7.0);
  for (const Case& bad : cases) {
    PoseGraph graph = sentinel;
    std::string error;
    EXPECT_FALSE(ParseG2o(ReplaceLine(bad.text, bad.line, bad.replacement),
                          "d/f.g2o",
                          &graph,
                          &error));
    EXPECT_EQ(error, std::string("d/f.g2o:") + bad.message);
    EXPECT_EQ(G2oText(graph), G2oText(sentinel));
  }
  PoseGraph graph;
  std::string error;
  EXPECT_FALSE(ParseG2o("", "f", &graph, &error));
  EXPECT_EQ(error,
            "f:1: the text is empty; expected a VERTEX_SE2 or a "
            "VERTEX_SE3:QUAT");
  EXPECT_FALSE(ParseG2o("# nothing\n\n", "f", &graph, &error));
  EXPECT_EQ(error,
            "f:2: the text ends; expected a VERTEX_SE2 or a VERTEX_SE3:QUAT");
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
  for (const char* whole : {kPlane, kSpace}) {
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
