// The number of threads of BLAS and LAPACK in this process: for programs. No
// other function of the library changes it.
//
// OpenBLAS starts with one thread per processor, or with OPENBLAS_NUM_THREADS of
// the environment. One is best for most problems: several slow down products and
// decompositions of fewer than about 1000 columns, and where the library has
// threads of its own (the options called num_threads) these wait for each other
// when each calls a BLAS that has threads, too. Results are right in either case;
// they agree to the last digit between runs with the same number.
#ifndef INVGRAD_BLAS_THREADS_H_
#define INVGRAD_BLAS_THREADS_H_

namespace invgrad {

// CHECKs that num_threads > 0. Call it while no other thread computes. Without
// effect where BLAS is not OpenBLAS.
void SetBlasThreads(int num_threads);

// 1 where BLAS is not OpenBLAS.
int BlasThreads();

}  // namespace invgrad

#endif  // INVGRAD_BLAS_THREADS_H_
