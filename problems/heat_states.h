// Heat distributions for the heat problems: random rectangles in a box.
//
//   x_gt = sum_{i < c} s_i 1[|r - p_i| <= h_i],   c = floor(4 + 7 U)
//   per rectangle and axis: p_i = L/2 + 0.8 L (U - 1/2), h_i = 10 U, then p_i
//   is moved so that the rectangle lies in the box;   s_i = U
//
// with U from [0, 1). A cell holds the mean over its area.
//
// Shapes:  states: one per row, the cells of a rows x cols grid, row by row.
//          rows = 1 is one dimension, with intervals for rectangles.
// Units:   the box has the side L = 64, the published number of cells, for any
//          number of cells.
// Data:    numpy's stream: for every state U for c; then, for each of ten
//          rectangles, of which c are used, p, h (one U an axis, rows first)
//          and s.
// Source:  Holl, Koltun, Thuerey, NeurIPS 2022, arXiv 2109.15048, and its code,
//          heat/inv_diffuse.py, generate_heat_example. There PhiFlow draws the
//          numbers and computes a cell's share in a rectangle from the distance
//          of its centre.
#ifndef PROBLEMS_HEAT_STATES_H_
#define PROBLEMS_HEAT_STATES_H_

#include "Eigen/Core"

namespace invgrad {

constexpr double kHeatBoxSide = 64.0;

// num_states x (rows cols).
Eigen::MatrixXd RandomHeatStates(int num_states, int rows, int cols, int seed);

}  // namespace invgrad

#endif  // PROBLEMS_HEAT_STATES_H_
