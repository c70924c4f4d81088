// The gauges of poses: rigid motions and similarities, in the plane and in space.
#ifndef INVGRAD_RANK_POSE_GAUGE_H_
#define INVGRAD_RANK_POSE_GAUGE_H_

#include "invgrad/rank/pose_scene.h"
#include "invgrad/rank_report.h"

namespace invgrad {

Gauge PoseGauge(bool with_scale, const PlanarLayout& layout);
Gauge PoseGauge(bool with_scale, const SpatialLayout& layout);

}  // namespace invgrad

#endif  // INVGRAD_RANK_POSE_GAUGE_H_
