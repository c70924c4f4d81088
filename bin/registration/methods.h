// The methods that the program registration compares, and how each of them
// solves an alignment.
#ifndef BIN_REGISTRATION_METHODS_H_
#define BIN_REGISTRATION_METHODS_H_

#include <memory>
#include <string>
#include <vector>

#include "ceres/problem.h"
#include "invgrad/update_rule.h"

namespace invgrad {

struct RegistrationMethod {
  enum class Kind { kOdometry, kLm, kHalfInverse, kDetermined, kEigenvalue };

  std::string label;  // as it was given
  Kind kind = Kind::kOdometry;
  double eigenvalue = 0.0;  // of kEigenvalue: the threshold
};

// "lm,eigenvalue:100,determined". Returns false, with *error, if a name is
// unknown, or a threshold is not a number >= 0.
bool ParseRegistrationMethods(const std::string& text,
                              std::vector<RegistrationMethod>* methods,
                              std::string* error);

// The rule whose proposals solve an alignment; null: it has none. tau is the
// threshold of kDetermined.
std::unique_ptr<UpdateRule> MakeRegistrationRule(
    const RegistrationMethod& method, double tau);

// ceres::Solve, by the proposals of `rule` alone; null: by Ceres' own steps.
void SolveAlignment(UpdateRule* rule, ceres::Problem* problem);

// The directions that the rule's last step left alone; -1: the method leaves
// none alone at any time.
int NumLeftAlone(const RegistrationMethod& method, const UpdateRule* rule);

}  // namespace invgrad

#endif  // BIN_REGISTRATION_METHODS_H_
