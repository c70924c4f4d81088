#include "bin/sweep/dispatch.h"

#include <algorithm>
#include <csignal>
#include <thread>
#include <utility>

#include "bin/support/ranks.h"
#include "bin/sweep/mpirun.h"
#include "report/interrupt.h"
#ifdef INVGRAD_MPI
#include <mpi.h>
#endif

namespace invgrad {
namespace {

// To a rank: the number of a job, or that there is none any more. To rank 0:
// that a job has ended, with its error, or that the rank has got a signal.
constexpr char kEnd[] = "end";
constexpr char kHasEnded[] = "ended ";
constexpr char kHasSignal[] = "signal";

#ifdef INVGRAD_MPI
void Send(int rank, const std::string& text) {
  MPI_Send(text.data(),
           static_cast<int>(text.size()),
           MPI_CHAR,
           rank,
           0,
           MPI_COMM_WORLD);
}

// Returns false if there is no message.
bool Receive(int rank, std::string* text) {
  int is_there = 0, size = 0;
  MPI_Status status;
  MPI_Iprobe(rank, 0, MPI_COMM_WORLD, &is_there, &status);
  if (is_there == 0) return false;
  MPI_Get_count(&status, MPI_CHAR, &size);
  text->resize(size);
  MPI_Recv(
      text->data(), size, MPI_CHAR, rank, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  return true;
}
#else
void Send(int /*rank*/, const std::string& /*text*/) {}
bool Receive(int /*rank*/, std::string* /*text*/) { return false; }
#endif

// Not a blocking receive, which takes all of a core.
void Pause() {
  constexpr std::chrono::milliseconds kPause(10);
  std::this_thread::sleep_for(kPause);
}

}  // namespace

Dispatcher::Dispatcher(RunOfJob run)
    : run_(std::move(run)), slots_(NumRanks()) {}

Dispatcher::~Dispatcher() {
  own_.Stop();
  for (int rank = 1; rank < NumRanks(); ++rank) Send(rank, kEnd);
  for (; !IsIdle(); Pause()) {
    for (int rank = 0; rank < NumRanks(); ++rank) {
      std::string ignored;
      HasEnded(rank, &ignored);
    }
  }
}

std::vector<JobStatus> Dispatcher::Run(
    Schedule* schedule,
    const RunOfJob& prepare,
    const std::function<void(const std::vector<JobStatus>&)>& on_wait) {
  std::vector<JobStatus> statuses(schedule->num_jobs());
  Clock::time_point end = Clock::time_point::max();
  bool is_stopped = false;
  while (true) {
    if (Interrupt::IsRequested() && !is_stopped) {
      is_stopped = true;
      WarnOfInterrupt();
      own_.Stop();  // the other ranks have the signal, too, or are lost
      constexpr std::chrono::milliseconds kPatience(500);
      end = Clock::now() + kPatience;
    }
    bool has_more = !is_stopped;
    for (int rank = 0; rank < NumRanks(); ++rank) {
      Slot& slot = slots_[rank];
      const std::chrono::duration<double> seconds = Clock::now() - slot.start;
      const int ended = slot.job;
      std::string error;
      if (HasEnded(rank, &error)) {
        statuses[ended] = {JobStatus::State::kEnded, error, 0.0};
        schedule->Finish(ended, seconds.count());
      } else if (slot.job >= 0) {
        statuses[slot.job].seconds = seconds.count();
      }
      while (has_more && slot.job < 0) {
        const int job = schedule->Next();
        has_more = job >= 0;
        if (!has_more) break;
        JobStatus& status = statuses[job];
        if (prepare(job, &status.error) && Start(rank, job, &status.error)) {
          status.state = JobStatus::State::kRunning;
        } else {
          status.state = JobStatus::State::kEnded;
          schedule->Finish(job, 0.0);
        }
      }
    }
    on_wait(statuses);
    if (IsIdle() || Clock::now() > end) return statuses;
    Pause();
  }
}

bool Dispatcher::Start(int rank, int job, std::string* error) {
  if (rank == 0) {
    const auto run = [&](std::string* why) { return run_(job, why); };
    if (!own_.Start(run, error)) return false;
  } else {
    Send(rank, std::to_string(job));
  }
  slots_[rank] = {job, Clock::now()};
  return true;
}

bool Dispatcher::HasEnded(int rank, std::string* error) {
  if (rank == 0 ? !own_.HasEnded(error) : !Receive(rank, error)) return false;
  if (rank != 0) {
    if (*error == kHasSignal) {
      if (!Interrupt::IsRequested()) std::raise(SIGTERM);
      return false;
    }
    error->erase(0, sizeof(kHasEnded) - 1);
  }
  slots_[rank].job = -1;
  return true;
}

bool Dispatcher::IsIdle() const {
  return std::all_of(slots_.begin(), slots_.end(), [](const Slot& slot) {
    return slot.job < 0;
  });
}

void ServeJobs(const RunOfJob& run) {
  ChildProcess child;
  bool is_ended = false, has_signal = false;
  while (!is_ended || child.is_running()) {
    std::string text;
    if (!is_ended && Receive(0, &text)) {
      is_ended = text == kEnd;
      const int job = is_ended ? -1 : std::stoi(text);
      std::string error;
      if (!is_ended &&
          !child.Start([&](std::string* why) { return run(job, why); },
                       &error)) {
        Send(0, kHasEnded + error);
      }
    }
    if (Interrupt::IsRequested() && !has_signal) {
      has_signal = true;
      Send(0, kHasSignal);
    }
    if (is_ended || has_signal) child.Stop();
    if (child.HasEnded(&text)) Send(0, kHasEnded + text);
    Pause();
  }
}

}  // namespace invgrad
