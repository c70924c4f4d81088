// A problem is physics, data, and known facts about its optimum.
//
// A point problem looks for the simulator's input x; a learning problem trains
// a network in front of the simulator. A new problem is one header and one row
// in problems.cc. The header has a struct with the settings as fields and
//
//   // Names, ranges and help of the settings.
//   void Describe(OptionSet* set);
//   // Returns false, with *error set, if a setting or problem->data are not
//   // allowed. A point problem has PointProblem* in place of LearningProblem*.
//   bool Create(LearningProblem* problem, std::string* error) const;
//
// The programs' flags, the listing, the conformance tests and docs/problems.md
// come from the table.
#ifndef PROBLEMS_PROBLEM_H_
#define PROBLEMS_PROBLEM_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/data.h"
#include "invgrad/dense_network.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/model.h"
#include "invgrad/option_set.h"
#include "invgrad/rules.h"

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
  Eigen::VectorXd truth;  // row by row
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

struct PhysicsProblem {
  // Exactly one of the two is set.
  std::optional<PointProblem> point;
  std::optional<LearningProblem> learning;
};

struct ProblemRow {
  std::string name;      // "oscillator_chain"
  std::string equation;  // one line
  std::string source;
  std::function<std::vector<OptionSet::Row>()> options;
  // `data`, if not null, replaces the generated data of a learning problem; it
  // is an error for a point problem. Returns false, with *error set, if a
  // setting or the data are not allowed.
  std::function<bool(const Settings& settings,
                     const Eigen::MatrixXd* data,
                     PhysicsProblem* problem,
                     std::string* error)>
      create;
};

// J and g of the first `batch_size` training samples (0: the problem's own
// number), after `num_steps` Adam steps of size 1e-3 on batches of that size
// from the initial weights of seed 0: spectra of Jacobians change in training.
// Returns false, with *error set, if the training diverges or the batch size
// does not fit.
bool LinearizeAfterTraining(const LearningProblem& problem,
                            int batch_size,
                            int num_steps,
                            Linearization* linearization,
                            std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_PROBLEM_H_
