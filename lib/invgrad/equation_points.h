// Points in a box, with quadrature weights.
//
//   sum_s w_s f(a_s) ~ mean of f over the box,   sum_s w_s = 1
//
// Gauss points: tensor products of Gauss-Legendre rules, exact for polynomials
// of degree 2 k - 1 in each coordinate. A network's residual is smooth: its
// mean square is then that of the whole box and not of the points alone, which
// a network can fit in between. They are denser at the faces.
// A sequence has equal weights: a_s = frac(offset + s alpha), alpha_i = phi^-i
// with the positive root of phi^(d+1) = phi + 1 [1], for d >= 3.
//
// [1] Roberts. The unreasonable effectiveness of quasirandom sequences. 2018.
//     (The generalized golden ratio; Kronecker sequences.)
#ifndef INVGRAD_EQUATION_POINTS_H_
#define INVGRAD_EQUATION_POINTS_H_

#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct Box {
  Eigen::VectorXd lower;
  Eigen::VectorXd upper;
};

struct QuadraturePoints {
  Eigen::MatrixXd points;   // d x N
  Eigen::VectorXd weights;  // N
};

// The rule of `count` nodes on [0, 1].
QuadraturePoints GaussRule(int count);

// Gauss rules in panels of one coordinate, [ends[i], ends[i + 1]] with
// counts[i] nodes: dense where a function is steep.
QuadraturePoints GaussPanels(const std::vector<double>& ends,
                             const std::vector<int>& counts);

// The product of rules of one coordinate each; the last one runs fastest.
QuadraturePoints ProductPoints(const std::vector<QuadraturePoints>& rules);

// counts: Gauss nodes a coordinate.
QuadraturePoints GaussPoints(const Box& box, const std::vector<int>& counts);

// Of a box of two coordinates: Gauss points in the first, equidistant ones in
// the second, in which functions are periodic: exact for num_x - 1 waves.
QuadraturePoints GaussTimesPeriodic(const Box& box, int num_t, int num_x);

// The points first, first + 1, .. of the sequence.
QuadraturePoints SequencePoints(const Box& box, int count, long first);

// count points of a sequence on each of both faces of the coordinates `first`,
// first + 1, .., with equal weights.
QuadraturePoints FacePoints(const Box& box, int first, int count);

// A grid with its faces, of equal weights.
Eigen::MatrixXd GridPoints(const Box& box, const std::vector<int>& counts);

}  // namespace invgrad

#endif  // INVGRAD_EQUATION_POINTS_H_
