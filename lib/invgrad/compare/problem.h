// What a program of compare.h can run: a problem is physics, data, and known
// facts about its optimum. RegisterProblem (compare.h) makes one of a struct
// with the settings as fields and
//
//   // Names, ranges and help of the settings.
//   void Describe(OptionSet* set);
//   // Returns false, with *error set, if a setting or problem->data are not
//   // allowed.
//   bool Create(LearningProblem* problem, std::string* error) const;
//
// The argument of Create says what kind of problem it is:
//
//   LearningProblem*       a network in front of a simulator is trained
//   EquationProblem*       a differential equation that a network solves
//                          (equation_problem.h)
//   PointProblem*          the simulator's input x is looked for
//   LeastSquaresProblem*   any ceres::Problem
#ifndef INVGRAD_COMPARE_PROBLEM_H_
#define INVGRAD_COMPARE_PROBLEM_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/data.h"
#include "invgrad/dense_network.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/model.h"
#include "invgrad/option_set.h"

namespace invgrad {

class PointObjective;  // minimize.h

struct PointProblem {
  // y = P(x), L(y, y*), y* and the start.
  std::shared_ptr<const Simulator> simulator;
  std::shared_ptr<const InverseSimulator> inverse;  // null: none is known
  std::shared_ptr<const Loss> loss;
  Eigen::VectorXd target;
  Eigen::VectorXd start;
  // Known facts, if any.
  std::optional<Eigen::VectorXd> minimizer;
  std::optional<double> minimum;
  // The number of rows if x is a field on a grid, row by row, for pictures; 0
  // otherwise.
  int field_rows = 0;

  PointObjective MakeObjective() const;
};

// A measure of a model besides its loss, for example the distance of x from the
// true x. Smaller is better.
struct Metric {
  std::string name;  // "x_distance"
  // `x`: |x| x N, the network's outputs for the N samples of `data`. NaN if it
  // has no value.
  std::function<double(const Eigen::MatrixXd& x, const DataSet& data)> evaluate;
  // What no network can get below, because the data do not determine it, if
  // known.
  std::optional<double> floor = std::nullopt;
};

// A function of two coordinates that the network represents, at the test data:
// a grid whose first coordinate is constant in a row.
struct FunctionOnGrid {
  int rows = 0;
  // The true values, row by row, as `values` has them.
  std::function<Eigen::VectorXd()> truth;
  // For the network's outputs x, |x| x N.
  std::function<Eigen::VectorXd(const Eigen::MatrixXd& x, const DataSet& data)>
      values;
};

struct LearningProblem {
  std::shared_ptr<const Model> model;
  std::shared_ptr<const InverseSimulator> inverse;  // null: none is known
  // Evaluated on the test data; on the train data if there are no test data.
  std::optional<Metric> metric;
  std::optional<FunctionOnGrid> function_on_grid;  // for pictures
  DataSet train;
  DataSet test;  // may have no samples
  // Null, or the fresh samples of each step; `train` is then for evaluation.
  std::shared_ptr<const DataSource> source;
  Initialization initialization = Initialization::kGlorotUniform;
  // The published settings: the defaults of a run.
  int batch_size = 0;  // 0: all samples
  int num_epochs = 100;
  // Of a sample's input that is a field: channels, rows, columns.
  std::vector<std::int64_t> input_shape;
  // The array that the samples are made from, one a row. If it is set before
  // Create, Create uses it in place of generated data.
  Eigen::MatrixXd data;
};

// A sum of squares, with loss functions, manifolds and bounds as in any
// ceres::Problem.
struct LeastSquaresProblem {
  // Adds the residual blocks to the empty problem, with the parameter blocks at
  // the start of this seed. The same seed must give the same problem. Returns
  // the owner of the parameter blocks, which lives as long as the problem.
  std::function<std::shared_ptr<void>(int seed, ceres::Problem* problem)> fill;
  // The least cost, 1/2 sum rho(|r|^2), if it is known.
  std::optional<double> minimum;
  // Of Ceres' trust regions, where a method names none: dense_qr,
  // sparse_normal_cholesky, dense_schur, ...
  std::string linear_solver = "dense_qr";
  int max_num_iterations = 200;  // the budget, if no other is given
};

struct PhysicsProblem {
  // Exactly one of these is set.
  std::optional<PointProblem> point;
  std::optional<LearningProblem> learning;
  std::optional<LeastSquaresProblem> least_squares;
};

}  // namespace invgrad

#endif  // INVGRAD_COMPARE_PROBLEM_H_
