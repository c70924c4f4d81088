/*
Trains, or minimizes, by every rule at every point of a grid of settings.

Sample runs:

  sweep --problem=toy_network --steps=200 \
    --grid="lambda=1,0.1,0.01; rule=half_inverse,adam:step_size=1e-2|3e-3"
  sweep --problem=sine --seconds=10 --tail=0.1 --output=runs/sine \
    --grid="xi=1,8,32,64; phi=0,45; rule=sip:step_size=1e-2|3e-3|1e-3,
      adam:step_size=1e-2|3e-3|1e-3"
  sweep --problem=oscillator_chain --epochs=25 --output=runs/networks \
    --grid="initialization=glorot,he; hidden=20,20-20; batch_size=32,0;
      rule=half_inverse,adam:step_size=1e-3:epochs=1|5>half_inverse"

  sweep --problem=more_garbow_hillstrom:spread=0.3 --output=runs/bard \
    --grid="function=bard,beale; seed=1..5;
      rule=ceres_lm,half_inverse:step_size=auto:truncation=1e-12|1e-6"

One run follows the other; a second call goes on with what is missing. With
--list_jobs it prints a command for each run instead, which GNU parallel runs,
on one machine or many; then --collect makes tables and pictures. On the ranks
of mpirun each takes the next run of the list in turn. docs/clusters.md.

Tables and pictures show the best alternative at each point of the grid, with a
remark if it is the smallest or largest one.

  DIR/flags.txt, DIR/versions.txt    see run_directory.h
  DIR/jobs/NUMBER-SETTINGS/...       see job_run.h
  DIR/sweep.csv                      one line a run
  DIR/table.txt, DIR/table.md        the best alternatives
  DIR/report.html                    see bin/sweep/report.h
  DIR/lines.png, heat_map.png, curves.png   see bin/sweep/plots.h
*/

#include "invgrad/compare/compare.h"
#include "problems/problems.h"

int main(int argc, char** argv) {
  invgrad::RegisterProblems();
  return invgrad::SweepMain(argc, argv);
}
