#!/usr/bin/env bash
# The main job: trains a network in front of the coupled oscillators with every
# method, prints one table, and leaves histories, weights and pictures in
# runs/oscillator_chain. Installs what is missing and builds first.
#
#   bin/run_comparison.sh                  as in README.md
#   bin/run_comparison.sh --seeds=1 ...    with other flags of `compare`
set -euo pipefail
# shellcheck source=bin/setup.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"

install_missing "${required_packages[@]}"
build_release compare
# --- The comparison itself ---
"$build_dir/bin/compare" --problem=oscillator_chain \
  --output="$root/runs/oscillator_chain" --overwrite "$@"
