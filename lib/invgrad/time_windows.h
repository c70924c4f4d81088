// Solves an evolution equation in windows of time, one network after another.
// Use it where one network (equation.h) is not exact enough over the whole
// time.
//
//   u = u_k for t_{k-1} <= t <= t_k,   u_k(t_{k-1}, x) = u_{k-1}(t_{k-1}, x)
//
// The first coordinate of a point is the time. The equation is of first order
// in it; write u_tt = f as u_t = v, v_t = f. At a seam u is continuous exactly,
// because u_k takes the end of u_{k-1} as its boundary values g
// (trial_function.h); so are its derivatives in x, and u_t is as continuous as
// both satisfy the equation. A window is shorter than the whole, so that its
// network can be smaller, and no later time influences an earlier one.
//
// Cost:    K trainings; g of window k evaluates the k - 1 networks before it at
//          each of its points, once.
// Fails:   with the message of the window that fails; before training if there
//          are several windows and the equation reads a second derivative in
//          time, or the options have a checkpoint_path.
#ifndef INVGRAD_TIME_WINDOWS_H_
#define INVGRAD_TIME_WINDOWS_H_

#include <functional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/equation.h"
#include "invgrad/train.h"
#include "invgrad/trial_function.h"

namespace invgrad {

struct TimeWindow {
  double begin;
  double end;
  // u at its beginning, as a function of the point (t, x, ..), whose t it does
  // not read.
  InputFunction start;
};

// The equation in a window. Its trial function has u = start where t = begin.
using MakeWindowEquation = std::function<Equation(const TimeWindow& window)>;

struct WindowSolutions {
  std::vector<double> times;        // t_0 .. t_K
  std::vector<Equation> equations;  // K
  std::vector<Eigen::VectorXd> weights;
  std::vector<TrainResult> runs;

  // u at the points (d x N): num_functions x N. A point before t_0 belongs to
  // the first window, one after t_K to the last one.
  bool At(const Eigen::MatrixXd& points,
          Eigen::MatrixXd* u,
          std::string* error) const;
};

// Trains each window by `method` with the same options; a budget in seconds is
// that of a window. times: at least two, ascending (CHECKed). Batches are all
// points. A callback that ends the training of a window successfully leaves out
// those after it. Returns false, with *error, if a window cannot be trained or
// diverges, or if a callback aborts it; the windows before it are then in
// *solutions.
bool SolveInWindows(const std::vector<double>& times,
                    const InputFunction& start,
                    const MakeWindowEquation& make_equation,
                    const std::string& method,
                    const TrainOptions& options,
                    WindowSolutions* solutions,
                    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TIME_WINDOWS_H_
