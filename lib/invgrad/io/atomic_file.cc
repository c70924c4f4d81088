#include "invgrad/io/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {
namespace {

std::string Reason(int error_number) {
  return std::generic_category().message(error_number);
}

// Opens a file with an unused name beside `path`: -1 and errno on failure.
// Unlike mkstemp, it gives the file the user's usual permissions.
int OpenTemporary(const std::string& path, std::string* temporary) {
  static std::atomic<unsigned> counter{0};
  constexpr int kMaxTries = 100;
  for (int i = 0; i < kMaxTries; ++i) {
    *temporary = fmt::format("{}.tmp{}-{}", path, getpid(), counter++);
    const int file = open(temporary->c_str(),
                          O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
                          S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP | S_IROTH |
                              S_IWOTH);  // less the umask
    // EEXIST: left by a killed program with the same process id.
    if (file >= 0 || errno != EEXIST) {
      return file;
    }
  }
  return -1;
}

bool WriteAll(int file, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(file, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) {
        continue;
      }
      return false;
    }
    bytes.remove_prefix(written);
  }
  return fsync(file) == 0;
}

// Returns an error message, or an empty string.
std::string ReadAll(int file, std::string* bytes) {
  struct stat status;
  if (fstat(file, &status) != 0) {
    return Reason(errno);
  }
  if (!S_ISREG(status.st_mode)) {
    return "not a regular file";
  }
  bytes->resize(status.st_size);
  size_t size = 0;
  while (size < bytes->size()) {
    const ssize_t count = read(file, &(*bytes)[size], bytes->size() - size);
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      return Reason(errno);
    }
    if (count == 0) {  // The file became shorter meanwhile.
      break;
    }
    size += count;
  }
  bytes->resize(size);
  return "";
}

}  // namespace

bool WriteFile(const std::string& path,
               std::string_view bytes,
               std::string* error) {
  CHECK(error != nullptr);
  std::string temporary;
  const int file = OpenTemporary(path, &temporary);
  if (file < 0) {
    *error = "cannot write " + path + ": " + Reason(errno);
    return false;
  }
  // Reports the first error; closes in any case.
  int error_number = WriteAll(file, bytes) ? 0 : errno;
  if (close(file) != 0 && error_number == 0) {
    error_number = errno;
  }
  if (error_number == 0 && rename(temporary.c_str(), path.c_str()) != 0) {
    error_number = errno;
  }
  if (error_number != 0) {
    unlink(temporary.c_str());
    *error = "cannot write " + path + ": " + Reason(error_number);
    return false;
  }
  return true;
}

bool ReadFile(const std::string& path, std::string* bytes, std::string* error) {
  CHECK(bytes != nullptr);
  CHECK(error != nullptr);
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) {
    *error = "cannot read " + path + ": " + Reason(errno);
    return false;
  }
  std::string all;
  const std::string problem = ReadAll(file, &all);
  close(file);
  if (!problem.empty()) {
    *error = "cannot read " + path + ": " + problem;
    return false;
  }
  *bytes = std::move(all);
  return true;
}

}  // namespace invgrad
