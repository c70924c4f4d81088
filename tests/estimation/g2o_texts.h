// Small files of g2o with all tags, for tests.
#ifndef INVGRAD_TESTS_ESTIMATION_G2O_TEXTS_H_
#define INVGRAD_TESTS_ESTIMATION_G2O_TEXTS_H_

namespace invgrad {

// Vertex 7 is named before it is there.
inline constexpr char kG2oPlane[] = R"(# two poses
VERTEX_SE2 3 0.5 -1 3.25
FIX 3

EDGE_SE2 7 3 -0.031191 +.5 -3.112485 4 1 2 5 3 6
VERTEX_SE2 7 1e-300 1e300 -0.0
EDGE_SE2 3 7 0 0 0 1e-300 0 0 1e-300 0 1e300
)";

// The second quaternion has length 5e200.
inline constexpr char kG2oSpace[] = R"(VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1
VERTEX_SE3:QUAT 1 0.341895 -0.0416997 0.0330394 0 3e200 0 -4e200
EDGE_SE3:QUAT 0 1 1 2 3 1 1 1 1 10 1 0 0 0 0 10 0 0 0 0 10 0 0 0 400 7 9 401 -9 99
FIX 1 0
)";

// Every other tag of the plane; vertex 1 has no line.
inline constexpr char kG2oPlaneLandmarks[] = R"(FIX 9
EDGE_SE2_XY 1 9 0.5 -0.25 4 1 2
VERTEX_XY 9 3 -1e-3
EDGE_PRIOR_SE2 1 1 2 0.5 400 0 0 0 0 0
)";

// Every other tag of space; pose 5 and landmark 6 have no line.
inline constexpr char kG2oSpaceLandmarks[] =
    R"(EDGE_SE3_TRACKXYZ 2 3 11 1 2 3 9 1 0 9 0 9
EDGE_SE3_OFFSET 2 5 11 0 1 2 3 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 4 0 0 4 0 4
PARAMS_SE3OFFSET 11 0.1 0 0 0 0 0.6 0.8
VERTEX_TRACKXYZ 3 1 0 -1
VERTEX_SE3:QUAT 2 0 0 0 0 0 0 1
EDGE_SE3_PRIOR 5 0 1 2 3 0 0 0 1 0 0 0 0 0 0 0 0 0 0 0 5 0 0 0 4 0 0 4 0 4
PARAMS_SE3OFFSET 0 0 0 0 0 0 0 1
EDGE_SE3_TRACKXYZ 5 6 0 1 0 0 1 0 0 1 0 1
FIX 3
)";

inline constexpr const char* kG2oTexts[] = {
    kG2oPlane, kG2oSpace, kG2oPlaneLandmarks, kG2oSpaceLandmarks};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_ESTIMATION_G2O_TEXTS_H_
