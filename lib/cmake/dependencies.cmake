# Finds everything that invgrad needs. One message names all missing packages
# and the command that installs them.
#
# Included, not called: the imported targets and what find_package sets belong
# to the including file. Reads INVGRAD_WITH_COMPARE, INVGRAD_BUILD_PROGRAMS and
# INVGRAD_BUILD_TESTS; sets invgrad_has_torch and invgrad_has_mpi.

set(missing_names "")
set(missing_packages "")

macro(invgrad_note_if_missing name debian_package found)
  if(NOT ${found})
    list(APPEND missing_names "${name}")
    list(APPEND missing_packages ${debian_package})
  endif()
endmacro()

# Versions 3.4 and 5 serve, which its package does not take for compatible.
find_package(Eigen3 QUIET NO_MODULE)
if(Eigen3_FOUND AND Eigen3_VERSION VERSION_LESS 3.4)
  set(Eigen3_FOUND FALSE)
endif()
invgrad_note_if_missing("Eigen 3.4" libeigen3-dev Eigen3_FOUND)

find_package(glog QUIET)
invgrad_note_if_missing("glog" libgoogle-glog-dev glog_FOUND)

# 2.1 is the first version with ceres::Manifold.
find_package(Ceres 2.1 QUIET)
invgrad_note_if_missing("Ceres Solver 2.1" libceres-dev Ceres_FOUND)

# Formats messages.
find_package(fmt QUIET)
invgrad_note_if_missing("fmt" libfmt-dev fmt_FOUND)

# Writes reports.
find_package(nlohmann_json 3.11 QUIET)
invgrad_note_if_missing("nlohmann-json" nlohmann-json3-dev nlohmann_json_FOUND)

include(${CMAKE_CURRENT_LIST_DIR}/invgradLapack.cmake)
invgrad_note_if_missing("OpenBLAS" libopenblas-dev invgrad_blas_libraries)
invgrad_note_if_missing("cblas.h" libopenblas-dev CBLAS_INCLUDE_DIR)
invgrad_note_if_missing("LAPACKE" liblapacke-dev LAPACKE_LIBRARY)
invgrad_note_if_missing("lapacke.h" liblapacke-dev LAPACKE_INCLUDE_DIR)
invgrad_note_if_missing("CHOLMOD" libsuitesparse-dev CHOLMOD_LIBRARY)
invgrad_note_if_missing("cholmod.h" libsuitesparse-dev CHOLMOD_INCLUDE_DIR)

# Optional: the components invgrad::torch and invgrad::mpi. AUTO builds one if
# what it needs is found, ON requires that, OFF does not look for it.
set(INVGRAD_WITH_TORCH AUTO CACHE STRING
  "The component invgrad::torch, which needs libtorch: AUTO, ON or OFF")
set(INVGRAD_WITH_MPI AUTO CACHE STRING
  "The component invgrad::mpi, which needs MPI: AUTO, ON or OFF")
set_property(CACHE INVGRAD_WITH_TORCH INVGRAD_WITH_MPI
  PROPERTY STRINGS AUTO ON OFF)
set(invgrad_has_torch FALSE)
if(INVGRAD_WITH_TORCH)
  find_package(Torch QUIET)
  set(invgrad_has_torch ${Torch_FOUND})
  if(NOT INVGRAD_WITH_TORCH STREQUAL "AUTO")
    invgrad_note_if_missing("libtorch (for INVGRAD_WITH_TORCH)" libtorch-dev
      invgrad_has_torch)
  endif()
endif()
set(invgrad_has_mpi FALSE)
if(INVGRAD_WITH_MPI)
  find_package(MPI QUIET COMPONENTS CXX)
  set(invgrad_has_mpi ${MPI_CXX_FOUND})
  if(NOT INVGRAD_WITH_MPI STREQUAL "AUTO")
    invgrad_note_if_missing("MPI (for INVGRAD_WITH_MPI)"
      "libopenmpi-dev openmpi-bin" invgrad_has_mpi)
  endif()
endif()

if(INVGRAD_WITH_COMPARE)
  # Command-line flags.
  find_package(gflags QUIET)
  invgrad_note_if_missing("gflags" libgflags-dev gflags_FOUND)
endif()

if(INVGRAD_BUILD_PROGRAMS)
  # FFTs for the problems; the library does not need them.
  find_library(FFTW_LIBRARY fftw3)
  find_path(FFTW_INCLUDE_DIR fftw3.h)
  mark_as_advanced(FFTW_LIBRARY FFTW_INCLUDE_DIR)
  if(FFTW_LIBRARY AND FFTW_INCLUDE_DIR)
    set(FFTW_FOUND TRUE)
  else()
    set(FFTW_FOUND FALSE)
  endif()
  invgrad_note_if_missing("FFTW 3" libfftw3-dev FFTW_FOUND)

  # Nearest neighbours of points, in a header.
  find_path(NANOFLANN_INCLUDE_DIR nanoflann.hpp)
  mark_as_advanced(NANOFLANN_INCLUDE_DIR)
  invgrad_note_if_missing("nanoflann" libnanoflann-dev NANOFLANN_INCLUDE_DIR)

  # Reads the formulas of users.
  find_library(MUPARSER_LIBRARY muparser)
  find_path(MUPARSER_INCLUDE_DIR muParser.h)
  mark_as_advanced(MUPARSER_LIBRARY MUPARSER_INCLUDE_DIR)
  if(MUPARSER_LIBRARY AND MUPARSER_INCLUDE_DIR)
    set(MUPARSER_FOUND TRUE)
  else()
    set(MUPARSER_FOUND FALSE)
  endif()
  invgrad_note_if_missing("muParser" libmuparser-dev MUPARSER_FOUND)

  find_package(BZip2 QUIET)
  invgrad_note_if_missing("libbz2" libbz2-dev BZIP2_FOUND)

  find_package(benchmark QUIET)
  invgrad_note_if_missing("Google Benchmark" libbenchmark-dev benchmark_FOUND)

  # The programs run it to draw pictures.
  find_program(GNUPLOT_EXECUTABLE gnuplot)
  mark_as_advanced(GNUPLOT_EXECUTABLE)
  invgrad_note_if_missing("gnuplot" gnuplot-nox GNUPLOT_EXECUTABLE)
endif()

if(INVGRAD_BUILD_TESTS)
  find_package(GTest QUIET)
  invgrad_note_if_missing("GoogleTest" libgtest-dev GTest_FOUND)

  # A program that a test runs.
  find_program(PKG_CONFIG_EXECUTABLE pkg-config)
  mark_as_advanced(PKG_CONFIG_EXECUTABLE)
  invgrad_note_if_missing("pkg-config" pkg-config PKG_CONFIG_EXECUTABLE)
endif()

if(missing_names)
  list(REMOVE_DUPLICATES missing_packages)
  list(JOIN missing_names ", " missing_names)
  list(JOIN missing_packages " " missing_packages)
  message(FATAL_ERROR "Missing: ${missing_names}.\nOn Debian, install with\n"
    "  sudo apt-get install ${missing_packages}\n")
endif()
