/*
Estimates the parameters of nonlinear regressions (NIST StRD, or a formula of
yours on a table), of bundle adjustments (BAL), of pose graphs (g2o) and of
registered least-squares problems. Compares rules, Ceres' minimizers, and
minimizers with proposals of rules, from the same starts.

Sample runs:

  estimate --list
  estimate --input=nist/BoxBOD.dat \
    --methods=ceres_lm,ceres_lm+geodesic,ceres_lm+half_inverse:step_size=auto
  estimate --input=nist --plots=false --overwrite \
    --methods=ceres_lm,ceres_bfgs
  estimate --input=nist/Lanczos1.dat --separable=both --overwrite
  estimate --input=problem-16-22106-pre.txt.bz2 --threads=2 --overwrite
  estimate --input=nist/BoxBOD.dat --covariance --overwrite
  estimate --input=decay.csv --model="signal=a*exp(-k*time)+c" \
    --start_values=a=1,k=1,c=0 --bounds=k=0.. --deviations=sigma \
    --covariance --overwrite
  estimate --input=sphere2500.g2o --perturb=0.1 --seeds=1..3 --overwrite \
    --methods=ceres_lm,geodesic,ceres_lm+chordal
  estimate --problems=more_garbow_hillstrom:function=bard --seeds=1..5 \
    --methods=ceres_lm,ceres_lm+half_inverse --overwrite
  estimate --input=M3500.g2o --loss=huber:1 --overwrite \
    --methods=ceres_lm,ceres_lm:linear_solver=cgnr

docs/results/estimation.md lists the sources of the files. Ctrl-C ends the
current method, skips the others, and keeps the results so far.
*/

#include "invgrad/compare/compare.h"
#include "problems/estimation/estimation_files.h"
#include "problems/problems.h"

int main(int argc, char** argv) {
  invgrad::RegisterProblems();
  invgrad::RegisterEstimationFiles();
  return invgrad::EstimateMain(argc, argv);
}
