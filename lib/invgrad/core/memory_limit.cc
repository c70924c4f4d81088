#include "invgrad/core/memory_limit.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iterator>
#include <limits>

namespace invgrad {

namespace {

constexpr double kShare = 0.75;

double MachineBytes() {
  static const double bytes =
      1.0 * sysconf(_SC_PHYS_PAGES) * sysconf(_SC_PAGESIZE);
  return bytes;
}

double ProcessBytes() {
  rlimit limit;
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) {
    return std::numeric_limits<double>::infinity();
  }
  return static_cast<double>(limit.rlim_cur);
}

std::string LimitText(double limit) {
  if (limit > 0.0) return FormatBytes(limit);
  return FormatBytes(MemoryLimit()) + " (three quarters of " +
         (ProcessBytes() < MachineBytes() ? "what this process may have)"
                                          : "this machine's memory)");
}

}  // namespace

double MemoryLimit() {
  return kShare * std::min(MachineBytes(), ProcessBytes());
}

std::string FormatBytes(double bytes) {
  static constexpr const char* kUnits[] = {
      "bytes", "kB", "MB", "GB", "TB", "PB", "EB"};
  const char* const* unit = kUnits;
  // What would be rounded to 1000 is 1 of the next unit.
  while (bytes >= 999.5 && unit + 1 < std::end(kUnits)) {
    bytes /= 1000.0;
    ++unit;
  }
  char text[64];
  std::snprintf(text, sizeof(text), "%.3g %s", bytes, *unit);
  return text;
}

double TotalBytes(const std::vector<MemoryPart>& parts) {
  double total = 0.0;
  for (const MemoryPart& part : parts) total += part.bytes;
  return total;
}

bool FitsInMemory(double bytes, double limit) {
  return bytes <= (limit > 0.0 ? limit : MemoryLimit());
}

bool FitsInMemory(const std::string& who,
                  std::vector<MemoryPart> parts,
                  double limit,
                  std::string* error) {
  const double total = TotalBytes(parts);
  if (FitsInMemory(total, limit)) return true;
  std::stable_sort(
      parts.begin(), parts.end(), [](const MemoryPart& a, const MemoryPart& b) {
        return a.bytes > b.bytes;
      });
  *error = who + " needs " + FormatBytes(total);
  if (parts.size() == 1) {
    *error += " for " + parts[0].name;
  } else {
    // What is less than a hundredth explains nothing.
    std::string list;
    for (const MemoryPart& part : parts) {
      if (part.bytes < 0.01 * total) break;
      list += (list.empty() ? "" : ", ") + part.name + " " +
              FormatBytes(part.bytes);
    }
    *error += " (" + list + ")";
  }
  *error += "; the limit is " + LimitText(limit);
  return false;
}

}  // namespace invgrad
