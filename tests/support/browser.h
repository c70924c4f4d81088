// Loads a page in headless Chromium (Debian: chromium) and runs a script in it.
#ifndef INVGRAD_TESTS_SUPPORT_BROWSER_H_
#define INVGRAD_TESTS_SUPPORT_BROWSER_H_

#include <array>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/temporary_folder.h"

// Skips the test, with a message, where Chromium is not installed.
#define INVGRAD_NEED_BROWSER()                                \
  if (std::system("command -v chromium > /dev/null") != 0) {  \
    GTEST_SKIP() << "Chromium is missing. Install chromium."; \
  }                                                           \
  static_assert(true, "")

namespace invgrad {

// Returns what the expression `script` gives, as a text, after the page is
// loaded; "ERRORS ..." if the page or the script reported any error.
inline std::string RunInBrowser(const std::string& html,
                                const std::string& script,
                                int width = 1400) {
  const TemporaryFolder folder;
  const std::string catcher =
      "<script>const errors = []; console.error = (e) => errors.push(e);"
      "window.addEventListener('error', (e) => errors.push(e.message));"
      "</script>";
  const std::string runner =
      "<script>let result = ''; try { result = String((() => { " + script +
      " })()); } catch (e) { errors.push(String(e)); }"
      "add(document.body, 'pre', {id: 'result'}, '@@' + "
      "(errors.length ? 'ERRORS ' + errors.join('; ') : result) + '@@');"
      "</script>";
  std::string error;
  const std::string page = folder / "page.html";
  EXPECT_TRUE(WriteFile(page, catcher + html + runner, &error)) << error;
  const std::string command =
      "timeout 120 chromium --headless --no-sandbox --disable-gpu "
      "--disable-dev-shm-usage --user-data-dir=" +
      folder / "profile" + " --window-size=" + std::to_string(width) +
      ",1000 --virtual-time-budget=2000 --dump-dom 'file://" + page +
      "' 2> /dev/null";
  std::string text;
  std::FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> buffer;
  while (const size_t size =
             std::fread(buffer.data(), 1, buffer.size(), pipe)) {
    text.append(buffer.data(), size);
  }
  ::pclose(pipe);
  const size_t begin = text.rfind("<pre id=\"result\">@@");
  const size_t end = text.rfind("@@</pre>");
  if (begin == std::string::npos) return "no result: " + text.substr(0, 500);
  const size_t skipped = begin + std::string("<pre id=\"result\">@@").size();
  return text.substr(skipped, end - skipped);
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_BROWSER_H_
