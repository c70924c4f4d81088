#include "bin/estimate/chordal_rule.h"

#include "invgrad/rules.h"

namespace invgrad {

bool ChordalRule::ComputeStep(const Linearization& /*at_x*/,
                              Eigen::VectorXd* /*step*/,
                              std::string* error) {
  *error = "chordal is a start for Ceres: ceres_lm+chordal";
  return false;
}

void RegisterChordalRule() {
  RegisterRule<ChordalRule>(
      "chordal",
      "ceres_lm+chordal: from the poses of chordal relaxation (g2o files), if "
      "they cost less than the start");
}

}  // namespace invgrad
