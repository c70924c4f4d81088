// The registration of problems/registration/cylinder.h: one alignment, from the
// start and with the stopping rule of the published comparison.
//
//   start  t = (0.2, 0.8, 0.5) m, roll and pitch 0.1, yaw 2 degrees; truth: 0
//   step   planes, weights and H at each pose; at most 30 steps, until one is
//          shorter than 1 mm and 1e-4 rad
//
//   clouds  scan and target
//   same    the same points, as published
//   noise   the same points, each with its own normal noise
//   others  other points of the same cylinder, as a second scan has
#ifndef BIN_REGISTRATION_CYLINDER_STUDY_H_
#define BIN_REGISTRATION_CYLINDER_STUDY_H_

#include <string>
#include <vector>

#include "bin/registration/methods.h"
#include "bin/support/program.h"

namespace invgrad {

struct CylinderOptions {
  double noise = 0.01;  // of the clouds `noise`: standard deviation [m]
  double tau = 0.1;     // of `determined`
};

// The study has kOdometry (no step), kEigenvalue and kDetermined. Returns false,
// with *error, if one is another.
bool CheckCylinderMethods(const std::vector<RegistrationMethod>& methods,
                          std::string* error);

// All clouds, methods (CHECKed) and seeds: prints the medians over the seeds,
// and writes DIR/cylinder.txt, .md and .csv. Returns false, with *error, if a
// step has no finite H, or a file cannot be written.
bool StudyCylinder(const std::vector<RegistrationMethod>& methods,
                   const std::vector<int>& seeds,
                   const CylinderOptions& options,
                   const std::string& folder,
                   RunCounts* counts,
                   std::string* error);

}  // namespace invgrad

#endif  // BIN_REGISTRATION_CYLINDER_STUDY_H_
