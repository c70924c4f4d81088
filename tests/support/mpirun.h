// Tests of programs that mpirun starts on several ranks.
#ifndef INVGRAD_TESTS_SUPPORT_MPIRUN_H_
#define INVGRAD_TESTS_SUPPORT_MPIRUN_H_

#include <sys/types.h>

#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "bin/support/ranks.h"

namespace invgrad {

inline constexpr char kNoMpi[] = "there is no MPI (apt install libopenmpi-dev)";

// Returns false if there is no mpirun. Lets Open MPI start more ranks than there
// are cores, of which those that wait do not keep the others from working, and
// as root, as in a container.
inline bool PrepareMpirun() {
  for (const char* name : {"OMPI_ALLOW_RUN_AS_ROOT",
                           "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM",
                           "OMPI_MCA_mpi_yield_when_idle",
                           "OMPI_MCA_rmaps_base_oversubscribe"}) {
    ::setenv(name, "1", /*overwrite=*/0);
  }
  ::setenv("OMPI_MCA_hwloc_base_binding_policy", "none", /*overwrite=*/0);
  // Open MPI 5.
  ::setenv("PRTE_MCA_rmaps_default_mapping_policy",
           ":oversubscribe",
           /*overwrite=*/0);
  ::setenv("PRTE_MCA_hwloc_default_binding_policy", "none", /*overwrite=*/0);
  return kHasMpi && std::system("mpirun --version > /dev/null 2>&1") == 0;
}

// "mpirun -n N program arguments".
inline std::vector<std::string> MpirunCommand(
    int num_ranks,
    const std::string& program,
    const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {
      "mpirun", "-n", std::to_string(num_ranks), program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  return words;
}

// The children of a process: the ranks of mpirun.
inline std::vector<pid_t> Children(pid_t parent) {
  const std::string pid = std::to_string(parent);
  std::ifstream list("/proc/" + pid + "/task/" + pid + "/children");
  std::vector<pid_t> children;
  for (pid_t child = 0; list >> child;) children.push_back(child);
  return children;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_MPIRUN_H_
