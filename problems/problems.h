// The table of problems.
#ifndef PROBLEMS_PROBLEMS_H_
#define PROBLEMS_PROBLEMS_H_

#include <string>
#include <vector>

#include "problems/problem.h"

namespace invgrad {

const std::vector<ProblemRow>& Problems();

// The row with this name, or null.
const ProblemRow* FindProblem(const std::string& name);

// Makes the problem of a specification "name:key=value:...". Returns false,
// with *error set, if it is invalid.
bool CreateProblem(const std::string& specification,
                   const Eigen::MatrixXd* data,
                   PhysicsProblem* problem,
                   std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_PROBLEMS_H_
