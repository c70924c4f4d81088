#!/usr/bin/env bash
# Attacks the programs: kills their runs and lets them go on, gives them wrong
# flags, damaged files and damaged run directories, and lets their writes fail.
# Fails at a finding, and prints the command that repeats it.
#
#   bin/run_attack.sh                         each attack for 10 minutes
#   bin/run_attack.sh --seconds=60 --seed=7   for a minute, from another seed
#
# The attacks are tests/attack/*_test.cc; as many run at a time as there are
# cores.
set -euo pipefail
# shellcheck source=bin/setup.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"

install_missing "${program_packages[@]}" "${test_packages[@]}"
with_tests=true
build_release attack_test
"$build_dir/attack_test" --gtest_list_tests |
  awk '/^ / {print suite $1} /^[^ ]/ {suite = $1}' |
  xargs -I '{}' -P "$(nproc)" \
    "$build_dir/attack_test" --gtest_filter='{}' --gtest_brief=1 \
    --seconds=600 "$@"
