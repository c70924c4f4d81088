// A problem is physics, data, and what is known about its optimum.
//
// There are two kinds. In a point problem the simulator's input x itself is
// sought; in a learning problem a network in front of the simulator is trained.
// A new problem is one header and one row in problems.cc; the programs' flags,
// the listing, the conformance tests and docs/problems.md are made from the
// table.
#ifndef PROBLEMS_PROBLEM_H_
#define PROBLEMS_PROBLEM_H_

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/chain/data_set.h"
#include "invgrad/chain/dense_network.h"
#include "invgrad/chain/model.h"
#include "invgrad/core/option_set.h"
#include "invgrad/inverse/inverse_simulator.h"
#include "invgrad/minimize/chain_objective.h"
#include "invgrad/rules/rules.h"

namespace invgrad {

struct PointProblem {
  // y = P(x), L(y, y*), y* and the start.
  std::shared_ptr<const Simulator> simulator;
  std::shared_ptr<const InverseSimulator> inverse;  // null: none is known
  std::shared_ptr<const Loss> loss;
  Eigen::VectorXd target;
  Eigen::VectorXd start;
  // Known facts, where there are any.
  std::optional<Eigen::VectorXd> minimizer;
  std::optional<double> minimum;
  // If x is a field on a grid, row by row, the number of its rows: pictures
  // then show it. 0: it is not.
  int field_rows = 0;

  ChainObjective MakeObjective() const {
    return ChainObjective(simulator, loss, target, start);
  }
};

// How good a model is, where the loss does not tell: the distance of x from the
// true one, say. The smaller the better.
struct Metric {
  std::string name;  // "x_distance"
  // `x`: |x| x N, the network's outputs for the N samples of `data`. NaN where
  // it has no value.
  std::function<double(const Eigen::MatrixXd& x, const DataSet& data)> evaluate;
};

struct LearningProblem {
  std::shared_ptr<const Model> model;
  std::shared_ptr<const InverseSimulator> inverse;  // null: none is known
  std::optional<Metric>
      metric;  // of the test data, or, without, the train data
  DataSet train;
  DataSet test;  // may have no samples
  Initialization initialization = Initialization::kGlorotUniform;
  // The published settings, used where the command line says nothing.
  int batch_size = 0;  // 0: all samples
  int num_epochs = 100;
  // The array that `data` (see ProblemRow::create) would have to be to give
  // the same problem.
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
  // `data`, if not null, replaces the generated data of a learning problem;
  // point problems refuse it. False with *error set if a setting or the data
  // are not allowed.
  std::function<bool(const Settings& settings,
                     const Eigen::MatrixXd* data,
                     PhysicsProblem* problem,
                     std::string* error)>
      create;
};

}  // namespace invgrad

#endif  // PROBLEMS_PROBLEM_H_
