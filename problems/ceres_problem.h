// Our problems as ordinary ceres::Problems, for solvers and tools that take
// those: residual blocks of ModelCost (invgrad/cost.h).
//
//   CeresProblem problem;
//   std::string error;
//   if (!CreateCeresProblem("oscillator_chain", {}, &problem, &error)) ...
//   ceres::Solve(options, problem.problem.get(), &summary);
#ifndef PROBLEMS_CERES_PROBLEM_H_
#define PROBLEMS_CERES_PROBLEM_H_

#include <memory>
#include <string>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/cost.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/model.h"

namespace invgrad {

struct CeresProblem {
  // Cost and gradient of the problem are those of the model over the data.
  std::shared_ptr<const Model> model;
  std::shared_ptr<const InverseSimulator> inverse;  // null: none is known
  DataSet data;  // of a point problem one sample
  // The weights, or the simulator's input x of a point problem: at the start
  // (weights: of seed 0). The blocks are WeightBlocks(model->network(), data).
  std::unique_ptr<Eigen::VectorXd> unknowns;
  std::unique_ptr<ceres::Problem>
      problem;  // destroyed before what it refers to
};

// Makes the problem of a specification (problems.h). Returns false, with *error,
// if it is invalid, or if its loss is not a squared norm.
bool CreateCeresProblem(const std::string& specification,
                        const ModelBlockOptions& options,
                        CeresProblem* problem,
                        std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_CERES_PROBLEM_H_
