// The linearization of a learning problem in the middle of training, for tests
// of linear algebra: spectra of Jacobians change in training.
#ifndef INVGRAD_TESTS_SUPPORT_TRAINED_LINEARIZATION_H_
#define INVGRAD_TESTS_SUPPORT_TRAINED_LINEARIZATION_H_

#include <string>

#include "invgrad/compare/problem.h"
#include "invgrad/linearization.h"

namespace invgrad {

// J and g of the first `batch_size` training samples (0: the problem's own
// number), after `num_steps` Adam steps of size 1e-3 on batches of that size
// from the initial weights of seed 0. Returns false, with *error set, if the
// training diverges or the batch size does not fit.
bool LinearizeAfterTraining(const LearningProblem& problem,
                            int batch_size,
                            int num_steps,
                            Linearization* linearization,
                            std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_TRAINED_LINEARIZATION_H_
