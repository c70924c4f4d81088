/*
Compares methods on one problem: same start, same data, same budget. A method
is an update rule; LOSS/SIMULATOR/RULE, a rule with pull-backs through loss
and simulator (sip is newton/inverse/adam); a minimizer of Ceres; or a sequence
of phases, separated by ">": lib/invgrad/method.h.

Sample runs:

  compare --list
  compare --problem=squared_component --steps=10 --overwrite \
    --rules=gradient_descent:step_size=0.01,newton:step_size=0.3333
  compare --problem=oscillator_chain --epochs=5 --overwrite \
    --rules=half_inverse:truncation=1e-10,adam:step_size=1e-3:batch_size=256
  compare --problem=oscillator_chain:coupling=cubic --seconds=20 --seeds=1..3 \
    --rules=half_inverse,gauss_newton,adam:step_size=3e-4:batch_size=512 \
    --output=runs/cubic
  compare --problem=quantum_dipole --seconds=20 --output=runs/quantum \
    --rules=half_inverse:step_size=0.5:truncation=1e-5,adam:step_size=5e-4
  compare --problem=oscillator_chain --epochs=25 --output=runs/phases \
    --rules="half_inverse,adam:batch_size=256:epochs=5>half_inverse"
  compare --flagfile=runs/phases/flags.txt --output=runs/again
  mpirun -n 2 compare --problem=oscillator_chain --steps=20 --overwrite

docs/programs.md has more. Ctrl-C ends the current method, skips the others, and
keeps the results so far.
*/

#include "invgrad/compare/compare.h"

#include "problems/problems.h"

int main(int argc, char** argv) {
  invgrad::RegisterProblems();
  return invgrad::CompareMain(argc, argv);
}
