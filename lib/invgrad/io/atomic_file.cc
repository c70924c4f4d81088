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

// A regular file, open for reading.
class InputFile {
 public:
  InputFile(const std::string& path, std::string* error)
      : path_(path),
        error_(error),
        // Does not wait for the writer of a pipe.
        file_(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {
    struct stat status = {};
    if (file_ < 0 || fstat(file_, &status) != 0) {
      is_good_ = Fail(Reason(errno));
    } else if (!S_ISREG(status.st_mode)) {
      is_good_ = Fail("not a regular file");
    }
    size_ = status.st_size;
  }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;
  ~InputFile() {
    if (file_ >= 0) close(file_);
  }

  bool is_good() const { return is_good_; }
  std::uint64_t size() const { return size_; }

  // Reads up to the end, but at most max_size bytes.
  bool Read(std::uint64_t max_size, std::string* bytes) const {
    bytes->reserve(std::min(size_, max_size));
    char buffer[1 << 16];
    while (bytes->size() < max_size) {
      const ssize_t count = read(
          file_,
          buffer,
          std::min<std::uint64_t>(sizeof(buffer), max_size - bytes->size()));
      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return Fail(Reason(errno));
      if (count == 0) break;
      bytes->append(buffer, count);
    }
    return true;
  }

  bool Fail(const std::string& reason) const {
    *error_ = fmt::format("cannot read {}: {}", path_, reason);
    return false;
  }

 private:
  const std::string& path_;
  std::string* error_;
  const int file_;
  bool is_good_ = true;
  std::uint64_t size_ = 0;
};

}  // namespace

bool WriteFile(const std::string& path,
               std::string_view bytes,
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
    check(std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size() &&
          std::fflush(file) == 0 && fsync(fileno(file)) == 0);
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
  InputFile file(path, error);
  if (!file.is_good()) return false;
  if (file.size() > max_size) {
    return file.Fail(fmt::format(
        "it has {} bytes; at most {} are allowed", file.size(), max_size));
  }
  if (!FitsInMemory(fmt::format("cannot read {}: it", path),
                    {{"its bytes", static_cast<double>(file.size())}},
                    /*limit=*/0.0,
                    error)) {
    return false;
  }
  // A file of the system may have no size, or no end.
  constexpr std::uint64_t kMinLimit = 1 << 20;
  const std::uint64_t limit =
      std::min(max_size, std::max(file.size(), kMinLimit));
  std::string all;
  if (!file.Read(limit + 1, &all)) return false;
  if (all.size() > limit) return file.Fail("it is longer than its size says");
  *bytes = std::move(all);
  return true;
}

bool ReadBeginning(const std::string& path,
                   std::uint64_t max_size,
                   std::string* bytes,
                   std::uint64_t* file_size,
                   std::string* error) {
  InputFile file(path, error);
  std::string beginning;
  if (!file.is_good() || !file.Read(max_size, &beginning)) return false;
  *bytes = std::move(beginning);
  *file_size = file.size();
  return true;
}

}  // namespace invgrad
