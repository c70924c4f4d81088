#include "invgrad/core/memory_limit.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include "fmt/core.h"
#include "fmt/ranges.h"

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
  return fmt::format("{} (three quarters of {})",
                     FormatBytes(MemoryLimit()),
                     ProcessBytes() < MachineBytes()
                         ? "what this process may have"
                         : "this machine's memory");
}

}  // namespace

double MemoryLimit() {
  return kShare * std::min(MachineBytes(), ProcessBytes());
}

std::string FormatBytes(double bytes) {
  static constexpr const char* kUnits[] = {
      "bytes", "kB", "MB", "GB", "TB", "PB", "EB"};
  const char* const* unit = kUnits;
  // 999.5 would be printed as 1e+03.
  while (bytes >= 999.5 && unit + 1 < std::end(kUnits)) {
    bytes /= 1000.0;
    ++unit;
  }
  return fmt::format("{:.3g} {}", bytes, *unit);
}

double TotalBytes(const std::vector<MemoryPart>& parts) {
  double total = 0.0;
  for (const MemoryPart& part : parts) total += part.bytes;
  return total;
}

bool FitsInMemory(double bytes, double limit) {
  return bytes <= (limit > 0.0 ? limit : MemoryLimit());
}

std::string MemoryText(const std::string& who, std::vector<MemoryPart> parts) {
  const double total = TotalBytes(parts);
  std::stable_sort(
      parts.begin(), parts.end(), [](const MemoryPart& a, const MemoryPart& b) {
        return a.bytes > b.bytes;
      });
  // Parts below a hundredth are left out.
  std::vector<std::string> list;
  for (const MemoryPart& part : parts) {
    if (part.bytes < 0.01 * total) break;
    list.push_back(fmt::format("{} {}", part.name, FormatBytes(part.bytes)));
  }
  return fmt::format("{} needs {} {}",
                     who,
                     FormatBytes(total),
                     parts.size() == 1
                         ? "for " + parts[0].name
                         : fmt::format("({})", fmt::join(list, ", ")));
}

bool FitsInMemory(const std::string& who,
                  std::vector<MemoryPart> parts,
                  double limit,
                  std::string* error) {
  if (FitsInMemory(TotalBytes(parts), limit)) return true;
  *error = fmt::format("{}; the limit is {}",
                       MemoryText(who, std::move(parts)),
                       LimitText(limit));
  return false;
}

}  // namespace invgrad
