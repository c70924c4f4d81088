# Finds OpenBLAS, LAPACKE and CHOLMOD (Ceres' own sparse Cholesky factorization);
# adds the target invgrad::lapack if all are there.
# Read when invgrad is built, and again by the project that uses it installed,
# where they may lie elsewhere.
#
# OpenBLAS stands before every other library on the link line, because LAPACKE
# and Ceres bring in liblapack.so.3 and libblas.so.3, which may be any BLAS that
# the machine's alternatives name: the first library that defines dgemm_ or
# dsyevd_ serves all of them.
find_package(OpenBLAS QUIET)
find_library(LAPACKE_LIBRARY lapacke)
find_path(LAPACKE_INCLUDE_DIR lapacke.h)
mark_as_advanced(LAPACKE_LIBRARY LAPACKE_INCLUDE_DIR)
if(LAPACKE_LIBRARY AND LAPACKE_INCLUDE_DIR)
  set(LAPACKE_FOUND TRUE)
else()
  set(LAPACKE_FOUND FALSE)
endif()

find_library(CHOLMOD_LIBRARY cholmod)
find_path(CHOLMOD_INCLUDE_DIR cholmod.h PATH_SUFFIXES suitesparse)
mark_as_advanced(CHOLMOD_LIBRARY CHOLMOD_INCLUDE_DIR)
if(CHOLMOD_LIBRARY AND CHOLMOD_INCLUDE_DIR)
  set(CHOLMOD_FOUND TRUE)
else()
  set(CHOLMOD_FOUND FALSE)
endif()

if(OpenBLAS_FOUND AND LAPACKE_FOUND AND CHOLMOD_FOUND
    AND NOT TARGET invgrad::lapack)
  # Imported, so that the installed invgrad refers to the target, not to files.
  add_library(invgrad::lapack INTERFACE IMPORTED)
  target_include_directories(invgrad::lapack SYSTEM INTERFACE
    ${OpenBLAS_INCLUDE_DIRS} ${LAPACKE_INCLUDE_DIR} ${CHOLMOD_INCLUDE_DIR})
  target_link_libraries(invgrad::lapack INTERFACE
    ${OpenBLAS_LIBRARIES} ${LAPACKE_LIBRARY} ${CHOLMOD_LIBRARY})
endif()
