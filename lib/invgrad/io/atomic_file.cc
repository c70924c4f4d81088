#include "invgrad/io/atomic_file.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "fmt/core.h"

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

bool ReadFile(const std::string& path, std::string* bytes, std::string* error) {
  const auto fail = [&](const std::string& reason) {
    *error = fmt::format("cannot read {}: {}", path, reason);
    return false;
  };
  namespace fs = std::filesystem;
  std::error_code ignored;
  if (fs::exists(path, ignored) && !fs::is_regular_file(path, ignored)) {
    return fail("not a regular file");
  }
  std::FILE* const file = std::fopen(path.c_str(), "rbe");
  if (file == nullptr) return fail(Reason(errno));
  std::string all;
  char buffer[1 << 16];
  for (size_t count = 1; count > 0;) {
    count = std::fread(buffer, 1, sizeof(buffer), file);
    all.append(buffer, count);
  }
  const int error_number = std::ferror(file) != 0 ? errno : 0;
  std::fclose(file);
  if (error_number != 0) return fail(Reason(error_number));
  *bytes = std::move(all);
  return true;
}

}  // namespace invgrad
