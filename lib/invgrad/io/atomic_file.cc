#include "invgrad/io/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

#include "fmt/core.h"
#include "invgrad/core/memory_limit.h"

namespace invgrad {
namespace {

std::string Reason(int error_number) {
  return std::generic_category().message(error_number);
}

// Opens a new file beside `path`; null and errno on failure. Unlike mkstemp, it
// gives the file the user's usual permissions.
std::FILE* OpenTemporary(const std::string& path, std::string* temporary) {
  static std::atomic<unsigned> counter{0};
  constexpr int kMaxTries = 100;
  std::FILE* file = nullptr;
  errno = EEXIST;
  // EEXIST: left by a killed program with the same process id.
  for (int i = 0; i < kMaxTries && file == nullptr && errno == EEXIST; ++i) {
    *temporary = fmt::format("{}.tmp{}-{}", path, getpid(), counter++);
    file = std::fopen(temporary->c_str(), "wbxe");
  }
  return file;
}

}  // namespace

bool WriteFile(const std::string& path,
               std::string_view bytes,
               std::string* error) {
  return WriteFile(path, std::vector<std::string_view>{bytes}, error);
}

bool WriteFile(const std::string& path,
               const std::vector<std::string_view>& parts,
               std::string* error) {
  std::string temporary;
  std::FILE* const file = OpenTemporary(path, &temporary);
  // Reports the first error; closes in any case.
  int error_number = 0;
  const auto check = [&error_number](bool is_done) {
    if (!is_done && error_number == 0) error_number = errno;
  };
  check(file != nullptr);
  if (file != nullptr) {
    for (const std::string_view part : parts) {
      check(part.empty() ||
            std::fwrite(part.data(), 1, part.size(), file) == part.size());
    }
    check(std::fflush(file) == 0 && fsync(fileno(file)) == 0);
    check(std::fclose(file) == 0);
    if (error_number == 0) {
      check(std::rename(temporary.c_str(), path.c_str()) == 0);
    }
    if (error_number != 0) unlink(temporary.c_str());
  }
  if (error_number == 0) return true;
  *error = fmt::format("cannot write {}: {}", path, Reason(error_number));
  return false;
}

std::string TargetOfTemporary(const std::string& temporary) {
  const auto skip_digits = [&temporary](size_t end) {
    while (end > 0 && temporary[end - 1] >= '0' && temporary[end - 1] <= '9') {
      --end;
    }
    return end;
  };
  constexpr std::string_view kMark = ".tmp";
  const size_t counter = skip_digits(temporary.size());
  if (counter == temporary.size() || counter == 0) return "";
  const size_t dash = counter - 1;
  const size_t process = skip_digits(dash);
  if (temporary[dash] != '-' || process == dash || process <= kMark.size() ||
      temporary.compare(process - kMark.size(), kMark.size(), kMark) != 0) {
    return "";
  }
  return temporary.substr(0, process - kMark.size());
}

bool ReadFile(const std::string& path,
              std::string* bytes,
              std::string* error,
              std::uint64_t max_size) {
  std::string all;
  std::uint64_t size = 0;
  if (!ReadBeginning(path, 0, &all, &size, error)) return false;
  if (size > max_size) {
    *error =
        fmt::format("cannot read {}: it has {} bytes; at most {} are allowed",
                    path,
                    size,
                    max_size);
    return false;
  }
  // A file of the system may have no size, or no end.
  constexpr std::uint64_t kMinLimit = 1 << 20;
  const std::uint64_t limit = std::min(max_size, std::max(size, kMinLimit));
  if (!FitsInMemory(fmt::format("cannot read {}: it", path),
                    {{"its bytes", static_cast<double>(size)}},
                    /*limit=*/0.0,
                    error) ||
      !ReadBeginning(path, limit + 1, &all, &size, error)) {
    return false;
  }
  if (all.size() > limit) {
    *error = fmt::format("cannot read {}: it has no end, or grows", path);
    return false;
  }
  *bytes = std::move(all);
  return true;
}

bool ReadBeginning(const std::string& path,
                   std::uint64_t max_size,
                   std::string* bytes,
                   std::uint64_t* file_size,
                   std::string* error) {
  // Does not wait for the writer of a pipe.
  const int file = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  struct stat status = {};
  std::string beginning, failure;
  if (file < 0 || fstat(file, &status) != 0) {
    failure = Reason(errno);
  } else if (!S_ISREG(status.st_mode)) {
    failure = "not a regular file";
  } else {
    beginning.reserve(std::min<std::uint64_t>(status.st_size, max_size));
  }
  for (ssize_t count = 1;
       failure.empty() && count != 0 && beginning.size() < max_size;) {
    char buffer[1 << 16];
    count = read(
        file,
        buffer,
        std::min<std::uint64_t>(sizeof(buffer), max_size - beginning.size()));
    if (count > 0) beginning.append(buffer, count);
    if (count < 0 && errno != EINTR) failure = Reason(errno);
  }
  if (file >= 0) close(file);
  if (!failure.empty()) {
    *error = fmt::format("cannot read {}: {}", path, failure);
    return false;
  }
  *bytes = std::move(beginning);
  *file_size = status.st_size;
  return true;
}

}  // namespace invgrad
