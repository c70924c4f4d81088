// Sets the number of threads of BLAS and LAPACK in this process. Programs call
// it once, at the beginning of main. No other function of the library changes
// this number.
//
// OpenBLAS starts with one thread per processor, or with as many as the
// environment variable OPENBLAS_NUM_THREADS says. One thread is best for most
// problems. Several threads slow down products and decompositions of fewer than
// about 1000 columns. They also wait for each other where the library has
// threads of its own (options called num_threads). Results are right in either
// case. They agree to the last digit between runs with the same number of
// threads.
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
