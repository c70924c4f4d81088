# shellcheck shell=bash
# Common functions of the commands in this folder; sourced, not run.
#
#   install_missing PACKAGE...   installs those that are missing, by apt-get
#   build_release TARGET...      configures and builds into build/release; with
#                                the tests if with_tests=true
#
# Both end the command with status 1 and one message if they fail.

root="$(CDPATH='' cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)"
build_dir="$root/build/release"
readonly root build_dir

# The packages that lib/cmake/dependencies.cmake needs for the library and the
# programs, and the build tools; and those that the tests need, too.
# shellcheck disable=SC2034  # the sourcing commands read it
readonly program_packages=(
  cmake ninja-build g++
  libceres-dev libeigen3-dev libgoogle-glog-dev libgflags-dev libfmt-dev
  nlohmann-json3-dev
  libopenblas-dev liblapacke-dev libsuitesparse-dev libfftw3-dev libbz2-dev
  libnanoflann-dev libmuparser-dev libbenchmark-dev
  gnuplot-nox
)
# shellcheck disable=SC2034
readonly test_packages=(libgtest-dev pkg-config bzip2)

# Prints those of its arguments that are not installed, one a line.
missing_packages() {
  local package
  for package in "$@"; do
    # A package of two architectures has two lines.
    dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null |
      grep -qx installed || echo "$package"
  done
}

# What is built or tested if it is installed: the components of libtorch
# (invgrad::torch) and MPI (invgrad::mpi), and reports in a browser.
# shellcheck disable=SC2034  # the sourcing commands read it
readonly optional_packages=(libtorch-dev libopenmpi-dev openmpi-bin chromium)

cannot_install() {
  local reason="$1"
  shift
  echo "Missing packages, and $reason. Run as root, then start again:" >&2
  echo "  apt-get update && apt-get install -y --no-install-recommends $*" >&2
  exit 1
}

install_missing() {
  if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    echo "No dpkg and apt-get here: assuming that these are installed: $*" >&2
    return
  fi
  local missing as_root=()
  mapfile -t missing < <(missing_packages "$@")
  if ((${#missing[@]} == 0)); then return; fi

  echo "Installing ${missing[*]}"
  if ((EUID != 0)); then
    command -v sudo >/dev/null ||
      cannot_install "you are not root and have no sudo" "${missing[@]}"
    sudo true || cannot_install "sudo was refused" "${missing[@]}"
    as_root=(sudo)
  fi
  # Continues if one of several sources fails: the installation then reports it.
  "${as_root[@]}" apt-get update -q ||
    echo "apt-get update failed; trying with the lists as they are" >&2
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -q -y --no-install-recommends \
    -o DPkg::Lock::Timeout=120 "${missing[@]}" ||
    cannot_install "apt-get could not install them" "${missing[@]}"
}

# One compiler per processor and per 3 GB of memory, which translation units
# with many Jets need.
build_jobs() {
  local by_memory jobs
  by_memory=$(awk '/^MemAvailable:/ {print int($2 / 3e6)}' /proc/meminfo)
  jobs=$(nproc)
  if ((by_memory < jobs)); then jobs=$by_memory; fi
  echo $((jobs > 0 ? jobs : 1))
}

build_release() {
  local options=()
  # Only for a new folder; an existing configuration is kept.
  if [[ ! -f "$build_dir/CMakeCache.txt" ]]; then
    options+=(-DCMAKE_UNITY_BUILD=ON -DINVGRAD_BUILD_TESTS=OFF)
  fi
  if [[ "${with_tests:-}" == true ]]; then
    options+=(-DINVGRAD_BUILD_TESTS=ON)
  fi
  # Only switched on here, never off: a run without CI in the same folder must
  # not rebuild everything.
  if [[ "${CI:-}" == true ]]; then
    options+=(-DINVGRAD_WARNINGS_AS_ERRORS=ON)
  fi
  cmake -S "$root" --preset release "${options[@]}"
  cmake --build "$build_dir" --parallel "$(build_jobs)" --target "$@"
}
