# Finds BLAS with its C interface, LAPACK, LAPACKE and CHOLMOD (Ceres' own sparse
# Cholesky factorization); adds the target invgrad::lapack if all are there.
# Read when invgrad is built, and again by the project that uses it installed,
# where they may lie elsewhere.
#
# BLAS and LAPACK are OpenBLAS, which is what invgrad is tested with, or, where
# OpenBLAS is missing or BLA_VENDOR is set, what FindLAPACK finds. The file and
# the header are looked for as such, because packages of OpenBLAS differ in what
# their OpenBLASConfig.cmake says.
#
# BLAS stands before every other library on the link line, because LAPACKE and
# Ceres bring in liblapack.so.3 and libblas.so.3, which may be any BLAS that the
# machine's alternatives name: the first library that defines dgemm_ or dsyevd_
# serves all of them.
#
# FindBLAS, which Ceres calls, sets BLA_VENDOR to All if it was not set.
find_library(OPENBLAS_LIBRARY openblas)
if(OPENBLAS_LIBRARY AND (NOT BLA_VENDOR OR BLA_VENDOR STREQUAL "All"))
  set(invgrad_blas_libraries ${OPENBLAS_LIBRARY})
else()
  find_package(LAPACK QUIET)
  set(invgrad_blas_libraries ${LAPACK_LIBRARIES} ${BLAS_LIBRARIES})
endif()
find_path(CBLAS_INCLUDE_DIR cblas.h PATH_SUFFIXES openblas)

find_library(LAPACKE_LIBRARY lapacke)
find_path(LAPACKE_INCLUDE_DIR lapacke.h PATH_SUFFIXES openblas)

find_library(CHOLMOD_LIBRARY cholmod)
find_path(CHOLMOD_INCLUDE_DIR cholmod.h PATH_SUFFIXES suitesparse)
mark_as_advanced(OPENBLAS_LIBRARY CBLAS_INCLUDE_DIR
  LAPACKE_LIBRARY LAPACKE_INCLUDE_DIR CHOLMOD_LIBRARY CHOLMOD_INCLUDE_DIR)

if(invgrad_blas_libraries AND CBLAS_INCLUDE_DIR
    AND LAPACKE_LIBRARY AND LAPACKE_INCLUDE_DIR
    AND CHOLMOD_LIBRARY AND CHOLMOD_INCLUDE_DIR
    AND NOT TARGET invgrad::lapack)
  # Imported, so that the installed invgrad refers to the target, not to files.
  add_library(invgrad::lapack INTERFACE IMPORTED)
  target_include_directories(invgrad::lapack SYSTEM INTERFACE
    ${CBLAS_INCLUDE_DIR} ${LAPACKE_INCLUDE_DIR} ${CHOLMOD_INCLUDE_DIR})
  target_link_libraries(invgrad::lapack INTERFACE
    ${invgrad_blas_libraries} ${LAPACKE_LIBRARY} ${CHOLMOD_LIBRARY})
endif()
