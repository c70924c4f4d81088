// Programs on several ranks, started by a launcher (mpirun, srun). Without one,
// or with one rank, everything here is a run in one process, and MPI is not
// initialized without one.
//
// Every rank runs the same program with the same flags. Only rank 0 prints:
// stdout of the others is /dev/null, Warn says nothing there, an Interrupt may be
// silent; what glog reports before a crash is printed by any rank.
#ifndef BIN_SUPPORT_RANKS_H_
#define BIN_SUPPORT_RANKS_H_

#include <functional>
#include <memory>
#include <string>

#include "bin/support/program.h"
#include "bin/support/run_directory.h"
#include "invgrad/internal/communicator.h"

namespace invgrad {

#ifdef INVGRAD_MPI
constexpr bool kHasMpi = true;
#else
constexpr bool kHasMpi = false;
#endif

// RunProgram on every rank. `run` must return the same on all ranks
// (Communicator::Agree); an exception on one of several ends all. SIGUSR1, which
// mpirun and srun pass on to the ranks, counts as SIGTERM. Exit code 1, with one
// message, if the ranks differ in program, arguments or BLAS kernels, or if the
// launcher started several ranks and MPI has one.
int RunProgramOnRanks(int argc,
                      char** argv,
                      const std::string& usage,
                      bool (*run)(RunCounts* counts, std::string* error));

// All ranks; null without a launcher. Inside of RunProgramOnRanks.
std::shared_ptr<const Communicator> ProgramRanks();
inline int NumRanks() {
  return ProgramRanks() == nullptr ? 1 : ProgramRanks()->size();
}
inline bool IsFirstRank() {
  return ProgramRanks() == nullptr || ProgramRanks()->rank() == 0;
}

// Communicator::Agree; in one process, `ok`.
inline bool AgreeOnRanks(bool ok, std::string* error) {
  return ProgramRanks() == nullptr ? ok : ProgramRanks()->Agree(ok, error);
}
// Whether it is true on at least one rank.
bool IsTrueOnAnyRank(bool is_true);

// Whether the text is the same on all ranks; otherwise *error is "rank 2 on HOST
// has WHAT TEXT, and rank 0 on HOST has TEXT".
bool IsSameOnRanks(const std::string& what,
                   const std::string& text,
                   std::string* error);

// Waits until all ranks are here, without using the processor.
void WaitForRanks();

// On several ranks, each takes every NumRanks()th of the runs, for the files that
// they leave, until a signal; returns when all ranks have done so. False on all
// ranks, with *error, if a run is false on one. In one process it does nothing.
bool RunShareOfRank(int num_runs,
                    const std::function<bool(int number)>& run,
                    std::string* error);

// PrepareRunDirectory by rank 0, in a directory that all ranks see; otherwise
// false on all ranks, with *error, and the directory is as it was.
bool PrepareRunDirectoryOnRanks(ExistingDirectory existing,
                                const RunIdentity& identity,
                                std::string* error);

// Waits for a file that another rank has written: a shared file system may show
// it late. Returns whether it is there.
bool WaitForFile(const std::string& path, double max_seconds);

}  // namespace invgrad

#endif  // BIN_SUPPORT_RANKS_H_
