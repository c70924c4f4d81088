#include "invgrad/blas_threads.h"

#include "invgrad/core/openblas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

void SetBlasThreads(int num_threads) {
  CHECK_GT(num_threads, 0);
  if (openblas_set_num_threads) openblas_set_num_threads(num_threads);
}

int BlasThreads() {
  return openblas_get_num_threads ? openblas_get_num_threads() : 1;
}

}  // namespace invgrad
