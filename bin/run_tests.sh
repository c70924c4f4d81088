#!/usr/bin/env bash
# Runs all tests: installs missing packages, those of optional components too,
# builds, and runs ctest.
#
#   bin/run_tests.sh               all of them
#   bin/run_tests.sh -R spectral   only those whose names match (ctest's options)
#   build/release/spectral_test --gtest_filter='Svd*'   single ones of a folder
#
# With CI=true in the environment, compiler warnings are errors.
set -euo pipefail
# shellcheck source=bin/setup.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"

install_missing "${program_packages[@]}" "${test_packages[@]}"
for package in "${optional_packages[@]}"; do
  # In a subshell, because a failure ends it.
  (install_missing "$package") ||
    echo "Without $package: what needs it is not tested"
done
with_tests=true
build_release all
# One more test than processors, because some wait: for ranks, or for a signal.
ctest --test-dir "$build_dir" --output-on-failure --no-tests=error \
  --parallel "$(($(nproc) + 1))" "$@"
