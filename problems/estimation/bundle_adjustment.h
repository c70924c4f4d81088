// The bundle adjustment of "Bundle Adjustment in the Large" as a
// ceres::Problem.
//
//   P = R(rotation) X + translation,   p = -(P_1, P_2) / P_3
//   residual = f (1 + k1 |p|^2 + k2 |p|^4) p - (x, y)
//
// Units:   pixels. A camera is one parameter block of 9, a point one of 3: the
//          columns of `data`, which must outlive the problem and not move.
// Cost:    one Jet of 12 derivatives an observation.
// Fails:   residuals are not finite for a point in the camera's plane.
//
// [1] https://grail.cs.washington.edu/projects/bal
#ifndef PROBLEMS_ESTIMATION_BUNDLE_ADJUSTMENT_H_
#define PROBLEMS_ESTIMATION_BUNDLE_ADJUSTMENT_H_

#include <memory>

#include "Eigen/Core"
#include "ceres/cost_function.h"
#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "invgrad/random.h"
#include "problems/estimation/bal_file.h"
#include "problems/estimation/robust_loss.h"

namespace invgrad {

// Parameter blocks: camera, point. The caller owns it.
ceres::CostFunction* MakeReprojectionError(double x, double y);

// One loss function an observation, owned by the problem.
void AddBundleAdjustment(const MakeLossFunction& make_loss,
                         BalData* data,
                         ceres::Problem* problem);

// Points are eliminated first, for the Schur complement.
std::shared_ptr<ceres::ParameterBlockOrdering> PointsFirst(BalData* data);

// The position of a camera, -R^T translation.
Eigen::Vector3d CameraCenter(const Eigen::Matrix<double, 9, 1>& camera);

// Noise of standard deviation `sigma`: on rotations in radians; on camera
// positions and points in units of the scene's size, the median distance of a
// point to the median point. Rotation noise does not change a camera's
// position.
void PerturbBundleAdjustment(double sigma, NumpyRandom* random, BalData* data);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_BUNDLE_ADJUSTMENT_H_
