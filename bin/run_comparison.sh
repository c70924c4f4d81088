#!/usr/bin/env bash
# The main job: trains a network in front of the coupled oscillators with nine
# methods, 6 seconds each, prints one table, and leaves histories, weights,
# pictures and report.html in runs/oscillator_chain. First installs missing
# packages and builds.
#
#   bin/run_comparison.sh                  as in README.md
#   bin/run_comparison.sh --all            27 methods
#   bin/run_comparison.sh --seeds=1 ...    with other flags of `compare`
#
# Its exit code is that of `compare`: 2 if a method failed, docs/programs.md.
set -euo pipefail
# shellcheck source=bin/setup.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/setup.sh"

install_missing "${program_packages[@]}"
build_release compare
# --- The comparison itself ---
# The best step sizes of small grids for the first-order rules, the published one
# for half_inverse:truncation=1e-10, Adam and sip_gradient (the book's
# scale-invariant training); auto, adaptive and geodesic need none. Ceres'
# minimizers work on all samples at once.
rules=(
  gradient_descent:step_size=3e-2:momentum=0.9:batch_size=256
  adam:step_size=1e-3:batch_size=256
  sip_gradient:step_size=1e-3:batch_size=256
  half_inverse:truncation=1e-10
  adaptive
  geodesic
  gauss_newton:step_size=auto
  kfac_half_inverse:step_size=auto
  ceres_lbfgs
)
if [[ "${1:-}" == --all ]]; then
  shift
  rules+=(
    gradient_descent:step_size=1e-1:batch_size=256
    rmsprop:step_size=1e-3:batch_size=256
    adagrad:step_size=1e-2:batch_size=256
    adadelta:step_size=1:batch_size=256
    newton:batch_size=256
    saddle_free_newton:batch_size=256
    half_inverse:step_size=auto
    power:kappa=0.75:step_size=auto
    levenberg_marquardt:step_size=auto
    layer_half_inverse:step_size=auto
    krylov:batch_size=256:iterations=100
    ceres_lm
    ceres_lm:linear_solver=cgnr
    ceres_dogleg
    ceres_bfgs
    ceres_nonlinear_cg
    ceres_steepest_descent
    ceres_lm+half_inverse:truncation=1e-2:step_size=auto:rho=1:linear_solver=cgnr
  )
fi
"$build_dir/bin/compare" --problem=oscillator_chain --seconds=6 \
  --rules="$(IFS=,; echo "${rules[*]}")" \
  --output="$root/runs/oscillator_chain" --overwrite "$@"
