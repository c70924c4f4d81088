#include "bin/support/ranks.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <initializer_list>
#include <iostream>
#include <thread>
#include <vector>

#include "bin/support/output_options.h"
#include "fmt/core.h"
#include "invgrad/core/blas_kernels.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/io/digest.h"
#include "report/interrupt.h"
#ifdef INVGRAD_MPI
#include <mpi.h>

#include "invgrad/mpi.h"
#endif

namespace invgrad {
namespace {

namespace fs = std::filesystem;

std::shared_ptr<const Communicator> ranks;  // null: none
bool (*run_of_rank)(RunCounts* counts, std::string* error) = nullptr;
int standard_error = -1;  // a copy, while stderr is closed

// The first of the variables that is set, as a number; -1 if none is.
int FirstNumber(std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (const char* text = std::getenv(name)) return std::atoi(text);
  }
  return -1;
}

// What the launcher says: Open MPI, MPICH and srun --mpi=pmi2, srun.
int LauncherRank() {
  return FirstNumber(
      {"OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID"});
}
int LauncherSize() {
  return FirstNumber(
      {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"});
}

std::string HostName() {
  char name[256] = "";
  gethostname(name, sizeof(name) - 1);
  return name;
}

void SendToNull(int file) {
  const int null = open("/dev/null", O_WRONLY);
  dup2(null, file);
  close(null);
}

bool CheckRanks(int argc, char** argv, std::string* error) {
  if (NumRanks() == 1 && LauncherSize() > 1) {
    *error = fmt::format(
        "the launcher has started {} ranks, and each finds itself alone: "
        "this program is built {}; start it by the launcher of the same MPI "
        "(mpirun; srun --mpi=pmix)",
        LauncherSize(),
        ranks == nullptr ? "without MPI, or srun started it without --mpi"
                         : "with another MPI");
    return false;
  }
  if (NumRanks() == 1) return true;
  std::string program;
  bool is_read = ReadFile("/proc/self/exe", &program, error);
  std::string arguments;
  for (int i = 1; i < argc; ++i) arguments += argv[i] + std::string(" ");
  return ranks->Agree(is_read, error) &&
         IsSameOnRanks(
             "a program with the digest", Digest().Add(program).Hex(), error) &&
         IsSameOnRanks("the arguments", arguments, error) &&
         IsSameOnRanks("the BLAS kernels (OPENBLAS_CORETYPE sets them)",
                       BlasKernels(),
                       error);
}

bool RunOnRank(RunCounts* counts, std::string* error) {
  if (standard_error >= 0) dup2(standard_error, STDERR_FILENO);
  try {
    return run_of_rank(counts, error);
  } catch (const std::exception& exception) {
    if (NumRanks() == 1) throw;
    // The others may wait for this one: the launcher ends them.
    std::cerr << fmt::format(
        "rank {} on {}: {}\n", ranks->rank(), HostName(), exception.what());
    _exit(1);
  }
}

extern "C" void EndEarly(int /*signal_number*/) {
  if (!Interrupt::IsRequested()) raise(SIGTERM);
}

}  // namespace

int RunProgramOnRanks(int argc,
                      char** argv,
                      const std::string& usage,
                      bool (*run)(RunCounts* counts, std::string* error)) {
  const bool is_silent = LauncherRank() > 0;
  if (is_silent) {
    SendToNull(STDOUT_FILENO);
    SilenceMessages();
  }
  UseProcessorsKernels(argv);  // before MPI: may start the program again
#ifdef INVGRAD_MPI
  if (IsLaunchedByMpi()) std::signal(SIGUSR1, EndEarly);
  // Ended by exit, also by that of gflags.
  static const MpiSession session(&argc, &argv);
  ranks = session.communicator();
#endif
  run_of_rank = run;
  gflags::SetArgv(argc, const_cast<const char**>(argv));  // for Warn
  std::string error;
  if (!CheckRanks(argc, argv, &error)) {
    Warn(error);
    return 1;
  }
  if (is_silent) {  // all ranks print the same about their flags
    standard_error = dup(STDERR_FILENO);
    SendToNull(STDERR_FILENO);
  }
  return RunProgram(argc, argv, usage, RunOnRank);
}

std::shared_ptr<const Communicator> ProgramRanks() { return ranks; }

bool IsTrueOnAnyRank(bool is_true) {
  double num_true = is_true ? 1.0 : 0.0;
  if (NumRanks() > 1) ranks->Sum(&num_true, 1);
  return num_true > 0.0;
}

void WaitForRanks() {
#ifdef INVGRAD_MPI
  if (NumRanks() == 1) return;
  MPI_Request request;
  MPI_Ibarrier(MPI_COMM_WORLD, &request);
  for (int has_come = 0; has_come == 0;) {
    MPI_Test(&request, &has_come, MPI_STATUS_IGNORE);
    constexpr std::chrono::milliseconds kPause(1);
    if (has_come == 0) std::this_thread::sleep_for(kPause);
  }
#endif
}

bool RunShareOfRank(int num_runs,
                    const std::function<bool(int number)>& run,
                    std::string* error) {
  if (NumRanks() == 1) return true;
  bool is_good = true;
  for (int i = ranks->rank(); i < num_runs; i += NumRanks()) {
    if (Interrupt::IsRequested()) break;
    is_good = is_good && run(i);
  }
  WaitForRanks();
  return ranks->Agree(is_good, error);
}

bool IsSameOnRanks(const std::string& what,
                   const std::string& text,
                   std::string* error) {
  if (NumRanks() == 1) return true;
  const std::vector<std::string> texts = ranks->GatherTexts(text);
  const std::vector<std::string> hosts = ranks->GatherTexts(HostName());
  const auto other =
      std::find_if(texts.begin(), texts.end(), [&](const std::string& each) {
        return each != texts[0];
      });
  if (other == texts.end()) return true;
  *error = fmt::format("rank {} on {} has {} {}, and rank 0 on {} has {}",
                       other - texts.begin(),
                       hosts[other - texts.begin()],
                       what,
                       *other,
                       hosts[0],
                       texts[0]);
  return false;
}

bool PrepareRunDirectoryOnRanks(ExistingDirectory existing,
                                const RunIdentity& identity,
                                std::string* error) {
  if (NumRanks() == 1) return PrepareRunDirectory(existing, identity, error);
  const std::string& output = Output().output;
  // A new name, one that the next run removes if this one is killed.
  std::error_code failure;
  const bool is_new = !fs::exists(output, failure);
  const auto now = std::chrono::system_clock::now().time_since_epoch().count();
  const std::string token = ranks->GatherTexts(
      fmt::format("{}/flags.txt.tmp{}-{}", output, getpid(), now))[0];
  bool is_good = true;
  if (IsFirstRank()) {
    is_good = MakeDirectories(output, error) && WriteFile(token, "", error);
  }
  is_good = ranks->Agree(is_good, error);
  if (is_good) {
    constexpr double kMaxSeconds = 5.0;
    is_good = WaitForFile(token, kMaxSeconds);
    *error = fmt::format(
        "--output={}: rank {} on {} does not see what rank 0 has written "
        "there; "
        "it must be a directory that all machines share",
        output,
        ranks->rank(),
        HostName());
    is_good = ranks->Agree(is_good, error);
  }
  if (IsFirstRank()) {
    fs::remove(token, failure);
    if (!is_good && is_new) fs::remove(output, failure);
    if (is_good) is_good = PrepareRunDirectory(existing, identity, error);
  }
  return ranks->Agree(is_good, error);
}

bool WaitForFile(const std::string& path, double max_seconds) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(
                         std::chrono::duration<double>(max_seconds));
  std::error_code failure;
  while (!fs::exists(path, failure)) {
    if (Clock::now() > end) return false;
    constexpr std::chrono::milliseconds kPause(50);
    std::this_thread::sleep_for(kPause);
  }
  return true;
}

}  // namespace invgrad
