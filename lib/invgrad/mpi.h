// Runs on several ranks by MPI.
//
//   int main(int argc, char** argv) {
//     const invgrad::MpiSession session(&argc, &argv);
//     options.communicator = session.communicator();
//
//   mpirun -n 4 program ...
//
// Without a launcher the session is a run in one process, and MPI is not
// initialized.
//
// Fails:   if a rank is lost, MPI ends the others.
#ifndef INVGRAD_MPI_H_
#define INVGRAD_MPI_H_

#include <memory>

#include "invgrad/internal/communicator.h"

namespace invgrad {

// Whether a launcher (mpirun, srun) has started this process as a rank.
bool IsLaunchedByMpi();

// Initializes MPI, and finalizes it at its end. One session a process.
class MpiSession {
 public:
  MpiSession(int* argc, char*** argv);
  ~MpiSession();
  MpiSession(const MpiSession&) = delete;
  MpiSession& operator=(const MpiSession&) = delete;

  // All ranks; null if there is no launcher.
  std::shared_ptr<const Communicator> communicator() const {
    return communicator_;
  }

 private:
  std::shared_ptr<const Communicator> communicator_;
};

}  // namespace invgrad

#endif  // INVGRAD_MPI_H_
