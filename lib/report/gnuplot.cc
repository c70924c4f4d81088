#include "report/gnuplot.h"

#include <sys/wait.h>

#include <cerrno>
#include <cstdio>
#include <system_error>

#include "fmt/core.h"

namespace invgrad {
namespace {

std::string QuoteForShell(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

// Special characters of gnuplot's double quotes become octal numbers. (gnuplot
// 5.4 misreads a single-quoted string that begins with a quote.)
std::string QuoteForGnuplot(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (code < 0x20 || code == 0x7f) {
      quoted += ' ';
    } else if (std::string_view("\"'`\\@$").find(c) != std::string_view::npos) {
      quoted += fmt::format("\\{:03o}", code);
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string RunGnuplot(const std::string& folder, const std::string& script) {
  // Without the settings of the user's ~/.gnuplot.
  const std::string command = fmt::format(
      "cd -- {} && exec gnuplot --default-settings {} 2>&1 < /dev/null",
      QuoteForShell(folder),
      QuoteForShell("./" + script));
  std::fflush(nullptr);
  std::FILE* const pipe = popen(command.c_str(), "re");
  if (pipe == nullptr) {
    return "cannot run gnuplot: " + std::generic_category().message(errno);
  }
  std::string output;
  for (int c = 0; (c = std::fgetc(pipe)) != EOF;)
    output += static_cast<char>(c);
  const int status = pclose(pipe);
  constexpr int kNotFound = 127;  // of the shell
  if (WIFSIGNALED(status)) {
    return fmt::format("gnuplot was ended by signal {}", WTERMSIG(status));
  }
  if (WEXITSTATUS(status) == kNotFound) {
    return "gnuplot is not installed (apt install gnuplot-nox)";
  }
  return WEXITSTATUS(status) == 0 ? "" : "gnuplot failed: " + output;
}

}  // namespace invgrad
