#include "bin/support/step_case.h"

#include <string>

#include "glog/logging.h"
#include "invgrad/io/numpy_random.h"
#include "problems/problems.h"

namespace invgrad {

const std::vector<StepCaseRow>& StepCaseRows() {
  static const auto& rows = *new std::vector<StepCaseRow>{
      {"linear_chain", "oscillator_chain", 1e-10, {}, false, false},
      {"cubic_chain",
       "oscillator_chain:coupling=cubic",
       1e-6,
       {},
       false,
       false},
      {"quantum_dipole", "quantum_dipole", 1e-5, {}, false, false},
      {"poisson", "poisson", 1e-5, {}, true, false},
      {"million", "poisson", 1e-5, {64, 512, 1024, 416, 64}, true, true},
  };
  return rows;
}

StepCase::StepCase(const StepCaseRow& case_row, double truncation)
    : row(&case_row),
      filter(SpectralFilter::HalfInverse(truncation > 0.0 ? truncation
                                                          : row->truncation)) {
  PhysicsProblem physics;
  std::string error;
  CHECK(CreateProblem(row->problem, nullptr, &physics, &error)) << error;
  problem = *physics.learning;
  model = problem.model;
  if (!row->widths.empty()) {
    model = std::make_shared<Model>(model->WithNetwork(
        DenseNetwork(row->widths, model->network().hidden_activation())));
  }
  batch = problem.train.Range(0, problem.batch_size);
  NumpyRandom random(1);
  weights = model->network().InitialWeights(problem.initialization, &random);
  Linearize(&at_weights);
}

void StepCase::Linearize(Linearization* at) const {
  std::string error;
  CHECK(model->Linearize(
      weights, batch, LinearizationParts::Jacobian(), at, &error))
      << error;
}

double StepCase::LimitFlops() const {
  double widths = 0.0;
  for (size_t l = 1; l < model->network().widths().size(); ++l) {
    widths += model->network().widths()[l];
  }
  const double m = J().rows();
  return m * m * widths + 4.0 / 3.0 * m * m * m;
}

}  // namespace invgrad
