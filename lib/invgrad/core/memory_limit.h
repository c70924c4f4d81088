// The memory that a computation may allocate, and the message if it needs more.
//
//   batch_size=100000 needs 35 GB (Gram matrix 32 GB, activations 2.6 GB, ...);
//   the limit is 17.6 GB (three quarters of this machine's memory)
//
// Needs are estimated before anything large is allocated.
// Units:   bytes, as double: no product of sizes overflows. A GB is 1e9 bytes.
#ifndef INVGRAD_CORE_MEMORY_LIMIT_H_
#define INVGRAD_CORE_MEMORY_LIMIT_H_

#include <string>
#include <vector>

namespace invgrad {

// Three quarters of the machine's memory, or of the process's limit (ulimit -v)
// if that is smaller.
double MemoryLimit();

// "17.6 GB", three digits.
std::string FormatBytes(double bytes);

// Memory that one part of a computation holds at the same time as the others.
struct MemoryPart {
  std::string name;  // "Gram matrix"
  double bytes = 0.0;
};

double TotalBytes(const std::vector<MemoryPart>& parts);

// Whether `bytes` fit into `limit`; 0: MemoryLimit(). Allocates nothing.
bool FitsInMemory(double bytes, double limit);

// "batch_size=100000 needs 35 GB (Gram matrix 32 GB, activations 2.6 GB)": the
// parts of `who`, largest first.
std::string MemoryText(const std::string& who, std::vector<MemoryPart> parts);

// Whether the parts fit. If not, *error is their MemoryText and the limit.
bool FitsInMemory(const std::string& who,
                  std::vector<MemoryPart> parts,
                  double limit,
                  std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_CORE_MEMORY_LIMIT_H_
