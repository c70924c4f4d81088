// The built-in gauges of poses: see gauge.h.
#ifndef INVGRAD_RANK_POSE_GAUGES_H_
#define INVGRAD_RANK_POSE_GAUGES_H_

#include <vector>

#include "invgrad/rank/gauge.h"

namespace invgrad {

// Rigid motions, or with_scale similarities: one gauge a layout of the blocks.
std::vector<Gauge> PlanarGauges(bool with_scale);
std::vector<Gauge> SpatialGauges(bool with_scale);

}  // namespace invgrad

#endif  // INVGRAD_RANK_POSE_GAUGES_H_
