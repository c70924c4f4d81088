// The ranks of this test program, which mpirun starts; CTest runs it with 1, 2,
// 3 and 4 ranks. A test compares what the ranks compute together with what each
// of them computes alone.
#ifndef TESTS_DISTRIBUTED_RANKS_H_
#define TESTS_DISTRIBUTED_RANKS_H_

#include <memory>

#include "invgrad/internal/communicator.h"

namespace invgrad {

std::shared_ptr<const Communicator> Ranks();

}  // namespace invgrad

#endif  // TESTS_DISTRIBUTED_RANKS_H_
