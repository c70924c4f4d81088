// OpenBLAS' own functions. Each is null where the BLAS of the process is another
// one, so test before the call.
#ifndef INVGRAD_CORE_OPENBLAS_H_
#define INVGRAD_CORE_OPENBLAS_H_

extern "C" {
__attribute__((weak)) void openblas_set_num_threads(int num_threads);
__attribute__((weak)) int openblas_get_num_threads(void);
__attribute__((weak)) char* openblas_get_config(void);
__attribute__((weak)) char* openblas_get_corename(void);
}

#endif  // INVGRAD_CORE_OPENBLAS_H_
