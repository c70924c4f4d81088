// What ParseG2o says about texts that it refuses.

#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "problems/estimation/g2o_file.h"
#include "tests/estimation/g2o_texts.h"
#include "tests/support/damaged_text.h"

namespace invgrad {
namespace g2o_file_messages_test {

TEST(G2oFileMessages, SaysWhatIsWrongAndWhere) {
  struct Case {
    const char* text;
    int line;
    const char* replacement;
    const char* message;
  };
  const std::vector<Case> cases = {
      {kG2oPlane,
       2,
       "VERTEX_CAM 3 0 0 0",
       "2: found 'VERTEX_CAM'; expected one of VERTEX_SE2, VERTEX_SE3:QUAT, "
       "VERTEX_XY, VERTEX_TRACKXYZ, EDGE_SE2, EDGE_PRIOR_SE2, EDGE_SE2_XY, "
       "EDGE_SE3:QUAT, EDGE_SE3_OFFSET, EDGE_SE3_PRIOR, EDGE_SE3_TRACKXYZ, "
       "PARAMS_SE3OFFSET, FIX"},
      {kG2oPlane,
       2,
       "VERTEX_TRACKXYZ 3 0 0 0",
       "5: a tag of SE2; expected SE3 as in the lines before"},
      {kG2oPlane,
       2,
       "VERTEX_XY 3 0 0",
       "5: vertex 3 is a landmark; expected a pose"},
      {kG2oPlane,
       2,
       "VERTEX_SE2",
       "2: the line ends; expected a vertex's id: an integer from 0 to "
       "9223372036854775807"},
      {kG2oPlane,
       2,
       "VERTEX_SE2 -1 0 0 0",
       "2: found '-1'; expected a vertex's id: an integer from 0 to "
       "9223372036854775807"},
      {kG2oPlane,
       2,
       "VERTEX_SE2 9223372036854775808 0 0 0",
       "2: found '9223372036854775808'; expected a vertex's id: an integer "
       "from 0 to 9223372036854775807"},
      {kG2oPlane,
       2,
       "VERTEX_SE2 3 0 0",
       "2: the line ends; expected a pose's coordinate: a finite double"},
      {kG2oPlane,
       2,
       "VERTEX_SE2 3 0 0 0 0",
       "2: found '0'; expected the line's end"},
      {kG2oPlane,
       2,
       "VERTEX_SE2 3 0 nan 0",
       "2: found 'nan'; expected a pose's coordinate: a finite double"},
      {kG2oPlane,
       2,
       "VERTEX_SE2 3 0 inf 0",
       "2: found 'inf'; expected a pose's coordinate: a finite double"},
      {kG2oPlane,
       2,
       "VERTEX_SE2 3 0 0 1e999",
       "2: found '1e999'; expected a pose's coordinate: a finite double"},
      {kG2oPlane,
       6,
       "VERTEX_XY 7 0 0",
       "5: vertex 7 is a landmark; expected a pose"},
      {kG2oPlaneLandmarks,
       3,
       "VERTEX_SE2 9 0 0 0",
       "2: vertex 9 is a pose; expected a landmark"},
      // It is a pose and a landmark, of edges alone.
      {kG2oPlaneLandmarks,
       2,
       "EDGE_SE2_XY 4 1 0.5 -0.25 4 1 2",
       "2: vertex 1 is a pose; expected a landmark"},
      {kG2oPlaneLandmarks,
       2,
       "EDGE_SE2_XY 1 9 0.5 -0.25 4 1",
       "2: the line ends; expected an entry of the information matrix: a "
       "finite double"},
      {kG2oPlaneLandmarks,
       2,
       "EDGE_SE2_XY 1 9 0.5 -0.25 4 3 2",
       "2: the information matrix has a negative eigenvalue; expected the "
       "inverse of a covariance, or a semidefinite matrix"},
      {kG2oSpaceLandmarks,
       3,
       "PARAMS_SE3OFFSET 12 0 0 0 0 0 0 1",
       "1: there is no offset 11; expected the id of a PARAMS_SE3OFFSET"},
      {kG2oSpaceLandmarks,
       3,
       "PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1",
       "7: offset 0 is there twice; expected another id"},
      {kG2oSpaceLandmarks,
       3,
       "PARAMS_SE3OFFSET 11 0 0 0 0 0 0 0",
       "3: the quaternion is zero; expected a rotation"},
      {kG2oSpaceLandmarks,
       6,
       "EDGE_SE3_PRIOR 5 -1 1 2 3 0 0 0 1",
       "6: found '-1'; expected an offset's id: an integer from 0 to "
       "9223372036854775807"},
      {kG2oPlane,
       3,
       "FIX",
       "3: the line ends; expected a vertex's id: an integer "
       "from 0 to 9223372036854775807"},
      {kG2oPlane,
       3,
       "FIX 5",
       "3: there is no vertex 5; expected the id of a vertex"},
      {kG2oPlane,
       3,
       "FIX 3 3",
       "3: vertex 3 is fixed twice; expected each vertex once"},
      {kG2oPlane,
       5,
       "EDGE_SE2 3 3 0 0 0 1 0 0 1 0 1",
       "5: the edge joins vertex 3 with itself; expected two vertices"},
      {kG2oPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 0 0 1 0",
       "5: the line ends; expected an entry of the information matrix: a "
       "finite double"},
      {kG2oPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 0 0 1 0 1 0",
       "5: found '0'; expected the line's end"},
      {kG2oPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 2 0 1 0 1",
       "5: the information matrix has a negative eigenvalue; expected the "
       "inverse of a covariance, or a semidefinite matrix"},
      // Overflows in the factorization.
      {kG2oPlane,
       5,
       "EDGE_SE2 3 7 0 0 0 1 1e300 1e300 1 0 1",
       "5: the information matrix has a negative eigenvalue; expected the "
       "inverse of a covariance, or a semidefinite matrix"},
      {kG2oPlane,
       6,
       "VERTEX_SE2 3 0 0 0",
       "6: vertex 3 is there twice; expected another id"},
      {kG2oPlane,
       6,
       "VERTEX_SE3:QUAT 7 0 0 0 0 0 0 1",
       "6: a tag of SE3; expected SE2 as in the lines before"},
      {kG2oSpace,
       2,
       "VERTEX_SE2 1 0 0 0",
       "2: a tag of SE2; expected SE3 as in the lines before"},
      {kG2oSpace,
       2,
       "VERTEX_SE3:QUAT 1 0 0 0 0 0 -0.0 0",
       "2: the quaternion is zero; expected a rotation"},
      {kG2oSpace,
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
  EXPECT_EQ(error, "f:1: the text is empty; expected vertices and edges");
  EXPECT_FALSE(ParseG2o("# nothing\n\n", "f", &graph, &error));
  EXPECT_EQ(error, "f:2: the text ends; expected vertices and edges");
}

}  // namespace g2o_file_messages_test
}  // namespace invgrad
