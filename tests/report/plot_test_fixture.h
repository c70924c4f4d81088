// Draws, or looks at the script that would draw, for tests.
#ifndef INVGRAD_TESTS_REPORT_PLOT_TEST_FIXTURE_H_
#define INVGRAD_TESTS_REPORT_PLOT_TEST_FIXTURE_H_

#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "report/plot.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {

inline Series Line(std::vector<double> x, std::vector<double> y) {
  Series series;
  series.title = "line";
  series.x = std::move(x);
  series.y = std::move(y);
  return series;
}

class PlotTest : public testing::Test {
 protected:
  // What the environment says where programs are, changed until the destructor.
  class Path {
   public:
    explicit Path(const std::string& path) : before_(std::getenv("PATH")) {
      setenv("PATH", path.c_str(), 1);
    }
    Path(const Path&) = delete;
    Path& operator=(const Path&) = delete;
    ~Path() { setenv("PATH", before_.c_str(), 1); }

   private:
    std::string before_;
  };

  // A program called gnuplot that does what `commands` say.
  std::string FakeGnuplot(const std::string& commands) {
    std::string folder = folder_ / "bin";
    std::filesystem::create_directory(folder);
    std::string error;
    EXPECT_TRUE(
        WriteFile(folder + "/gnuplot", "#!/bin/sh\n" + commands + "\n", &error))
        << error;
    chmod((folder + "/gnuplot").c_str(), 0755);
    return folder;
  }

  std::string Read(const std::string& path) {
    std::string bytes;
    std::string error;
    EXPECT_TRUE(ReadFile(path, &bytes, &error)) << error;
    return bytes;
  }

  // Draws, and returns the picture's width and height.
  std::pair<int, int> Draw(const std::vector<Plot>& plots,
                           const std::string& name = "plot",
                           int num_columns = 0) {
    std::string error;
    EXPECT_TRUE(WritePlots(folder_ / (name + ".png"),
                           plots,
                           &error,
                           /*max_seconds=*/60.0,
                           num_columns))
        << error;
    const std::string png = Read(folder_ / (name + ".png"));
    if (png.size() < 24 || png.substr(1, 3) != "PNG") {
      ADD_FAILURE() << "not a PNG";
      return {};
    }
    // The header chunk begins with two big-endian numbers of 32 bits.
    const auto number = [&png](size_t i) {
      return static_cast<unsigned char>(png[i + 2]) * 256 +
             static_cast<unsigned char>(png[i + 3]);
    };
    return {number(16), number(20)};
  }

  // The script that would draw, without drawing, and its data.
  std::string Script(const std::vector<Plot>& plots) {
    const Path path(FakeGnuplot("exit 1"));
    std::string error;
    WritePlots(folder_ / "script.png", plots, &error);
    return Read(folder_ / "script.gp");
  }
  std::string Script(const Plot& plot) { return Script(std::vector{plot}); }
  std::string Data(const std::vector<Plot>& plots) {
    Script(plots);
    return Read(folder_ / "script.csv");
  }

  static bool Has(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  }

  const TemporaryFolder folder_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_REPORT_PLOT_TEST_FIXTURE_H_
