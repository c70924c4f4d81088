// The scans of a path, each aligned with the one before it.
//
//   T_k = T_{k-1} P_k,   P_k: the pose relative to the scan before
//
// An alignment starts at the odometry: the true relative pose with normal noise
// of 5 mm and 1 mrad in each direction. Ten times, each point is matched to its
// nearest, and the problem (problems/registration/alignment.h) is solved.
//
// The error of P_k is its position and its rotation vector against the true
// ones, in the scene's axes. The drift is the length of the sum of the errors
// so far along the axes that the scene determines, and along the others.
//
// Scans and odometry are the same for all methods, and for all units up to
// rounding.
#ifndef BIN_REGISTRATION_TRACK_H_
#define BIN_REGISTRATION_TRACK_H_

#include <cstdint>
#include <vector>

#include "Eigen/Geometry"
#include "bin/registration/methods.h"
#include "problems/registration/scan.h"

namespace invgrad {

struct TrackOptions {
  int num_scans = 100;
  // Of `determined`; 0: TauForNormals(error of the first scan's normals), but
  // at least 0.1.
  double tau = 0.0;
  bool guards_edges = true;  // as in AlignmentOptions
  ScanOptions scan;
  std::uint32_t seed = 1;
};

struct TrackedScan {
  // [0]: along the determined axes; [1]: along the others.
  double position_drift[2] = {0.0, 0.0};  // [m]
  double rotation_drift[2] = {0.0, 0.0};  // [rad]
  int num_left_alone = -1;  // by the last step; -1: no such method
  // T_k in the scene; metres.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

struct Track {
  std::vector<TrackedScan> scans;  // the first is that of T_0, without errors
  double normal_error = 0.0;       // of the first scan [rad]
  bool is_finite = true;
};

// Ends early after a signal.
Track TrackScans(const Scene& scene,
                 const RegistrationMethod& method,
                 const TrackOptions& options);

}  // namespace invgrad

#endif  // BIN_REGISTRATION_TRACK_H_
