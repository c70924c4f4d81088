// A program that starts itself on several ranks.
#ifndef BIN_SWEEP_MPIRUN_H_
#define BIN_SWEEP_MPIRUN_H_

namespace invgrad {

// Starts this program, with its arguments, by mpirun on this machine (or on
// those of a scheduler's allocation), waits, and ends this process with the exit
// code of rank 0. Passes an Interrupt on. Returns if there is no
// mpirun, or no MPI in this program.
void RunByMpirun(int num_ranks);

// At the end of main: hands the exit code to a RunByMpirun that has started this
// rank, because mpirun explains one that is not 0. Returns the code to return.
int HandOverExitCode(int exit_code);

// Says how an interrupted run goes on, unless the RunByMpirun that has started
// this rank will.
void WarnOfInterrupt();

}  // namespace invgrad

#endif  // BIN_SWEEP_MPIRUN_H_
