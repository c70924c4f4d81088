// The methods that the program registration compares, and how each of them
// solves an alignment.
#ifndef BIN_REGISTRATION_METHODS_H_
#define BIN_REGISTRATION_METHODS_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "ceres/problem.h"
#include "invgrad/update_rule.h"

namespace invgrad {

struct RegistrationMethod {
  enum class Kind { kOdometry, kLm, kHalfInverse, kDetermined, kEigenvalue };

  std::string label;  // as it was given
  Kind kind = Kind::kOdometry;
  // Of kEigenvalue: the threshold; 0: gauss_newton.
  double eigenvalue = 0.0;
};

// "lm,eigenvalue:100,determined". Returns false, with *error, if a name is
// unknown, or a threshold is not a number >= 0.
bool ParseRegistrationMethods(const std::string& text,
                              std::vector<RegistrationMethod>* methods,
                              std::string* error);

// The Gauss-Newton step without the eigenvectors of H = J^T J whose eigenvalues
// are at most the threshold, which has the units of H. Of H its lower triangle
// is read. Returns false, with *error, if H or gradient is not finite.
bool EigenvalueStep(const Eigen::MatrixXd& H,
                    const Eigen::VectorXd& gradient,
                    double threshold,
                    Eigen::VectorXd* step,
                    int* num_left_alone,
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
