#include "problems/estimation/bal_file.h"

#include <cmath>
#include <limits>
#include <regex>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/compress_bzip2.h"
#include "tests/support/damaged_text.h"
#include "tests/support/published_data.h"
#include "tests/support/reader_check.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace bal_file_test {

constexpr TextFormat<BalData> kFormat = {ParseBal, BalText};

const char kText[] = R"(2 1 3
0 0     -3.859900e+02 3.871200e+02
1 0 1e-300 -0.0
1 0	+7 1
1.5741515942940262e-02
-1.2790936163850642e-02
-4.4008498081980789e-03
-3.4093839577186584e-02
-1.0751387104921525e-01
1.1202240291236032e+00
3.9975152639358436e+02
-3.1770643852803579e-07
5.8820490534594022e-13
1
2
3
4 5 6
7
8
9
-0.1
1e308
.5
)";

TEST(BalFile, ReadsASmallFile) {
  BalData data;
  std::string error;
  ASSERT_TRUE(ParseBal(kText, "f", &data, &error)) << error;
  ASSERT_EQ(data.observations.size(), 3);
  EXPECT_EQ(data.observations[0].camera, 0);
  EXPECT_EQ(data.observations[0].point, 0);
  EXPECT_EQ(data.observations[0].x, -385.99);
  EXPECT_EQ(data.observations[0].y, 387.12);
  EXPECT_EQ(data.observations[2].camera, 1);
  EXPECT_EQ(data.observations[2].x, 7.0);
  ASSERT_EQ(data.cameras.cols(), 2);
  EXPECT_EQ(data.cameras(0, 0), 1.5741515942940262e-02);
  EXPECT_EQ(data.cameras(8, 0), 5.8820490534594022e-13);
  EXPECT_EQ(data.cameras.col(1),
            (Eigen::VectorXd(9) << 1, 2, 3, 4, 5, 6, 7, 8, 9).finished());
  ASSERT_EQ(data.points.cols(), 1);
  EXPECT_EQ(data.points.col(0), Eigen::Vector3d(-0.1, 1e308, 0.5));
}

TEST(BalFile, ReadsEveryEndOfLinesAndOfTheText) {
  std::string without_end = kText;
  without_end.pop_back();
  for (const std::string& text :
       {WithCrLf(kText),
        without_end,
        std::string(kText) + "\n \t\r\n\n",
        // Blank lines after the header, among observations and values.
        std::regex_replace(std::string(kText), std::regex("\n"), "\n\n"),
        ReplaceLine(kText, 1, "2 1 3\n"),
        "\xEF\xBB\xBF" + std::string(kText)}) {
    BalData expected;
    BalData data;
    std::string error;
    ASSERT_TRUE(ParseBal(kText, "f", &expected, &error)) << error;
    ASSERT_TRUE(ParseBal(text, "f", &data, &error)) << error;
    EXPECT_EQ(BalText(data), BalText(expected));
  }
}

TEST(BalFile, ReadsWhatIsWritten) {
  const TemporaryFolder folder;
  BalData data;
  std::string error;
  ASSERT_TRUE(ParseBal(kText, "f", &data, &error)) << error;
  data.observations[0].x = std::numeric_limits<double>::denorm_min();
  data.observations[0].y = std::numeric_limits<double>::max();
  data.cameras(1, 1) = 1.0 / 3.0;
  ASSERT_TRUE(WriteBalFile(folder / "x.txt", data, &error)) << error;
  ASSERT_TRUE(
      WriteFile(folder / "x.txt.bz2", CompressBzip2(BalText(data)), &error))
      << error;
  for (const std::string name : {"x.txt", "x.txt.bz2"}) {
    BalData back;
    ASSERT_TRUE(ReadBalFile(folder / name, &back, &error)) << error;
    ASSERT_EQ(back.observations.size(), data.observations.size());
    for (size_t i = 0; i < data.observations.size(); ++i) {
      EXPECT_EQ(back.observations[i].camera, data.observations[i].camera);
      EXPECT_EQ(back.observations[i].point, data.observations[i].point);
      EXPECT_EQ(back.observations[i].x, data.observations[i].x);
      EXPECT_EQ(back.observations[i].y, data.observations[i].y);
    }
    EXPECT_TRUE(std::signbit(back.observations[1].y));
    EXPECT_EQ(back.cameras, data.cameras);
    EXPECT_EQ(back.points, data.points);
  }
  std::string text;
  ASSERT_TRUE(ReadFile(folder / "x.txt", &text, &error)) << error;
  EXPECT_EQ(text, BalText(data));
}

TEST(BalFile, WritesNoOtherData) {
  const TemporaryFolder folder;
  BalData good;
  std::string error;
  ASSERT_TRUE(ParseBal(kText, "f", &good, &error)) << error;
  std::vector<BalData> bad(6, good);
  bad[0] = {};
  bad[1].observations[1].camera = 2;
  bad[2].observations[1].point = -1;
  bad[3].observations[1].y = std::nan("");
  bad[4].cameras(8, 1) = HUGE_VAL;
  bad[5].points(2, 0) = -HUGE_VAL;
  for (const BalData& data : bad) {
    error.clear();
    EXPECT_FALSE(WriteBalFile(folder / "x.txt", data, &error));
    EXPECT_EQ(error.find("cannot write " + folder / "x.txt:"), 0) << error;
  }
  EXPECT_EQ(folder.NumFiles(), 0);
}

TEST(BalFile, SaysWhatIsWrongAndWhere) {
  struct Case {
    int line;
    const char* replacement;
    const char* message;
  };
  const std::vector<Case> cases = {
      {1,
       "",
       "1: the line ends; expected the number of cameras: an integer "
       "from 1 to 2147483647"},
      {1,
       "2 1",
       "1: the line ends; expected the number of observations: an "
       "integer from 1 to 2147483647"},
      {1, "2 1 3 4", "1: found '4'; expected the line's end"},
      {1,
       "-2 1 3",
       "1: found '-2'; expected the number of cameras: an integer "
       "from 1 to 2147483647"},
      {1,
       "2 0 3",
       "1: found '0'; expected the number of points: an integer "
       "from 1 to 2147483647"},
      {1,
       "2 1 2147483648",
       "1: found '2147483648'; expected the number of "
       "observations: an integer from 1 to 2147483647"},
      {1,
       "99999999999999999999 1 3",
       "1: found '99999999999999999999'; expected the number of cameras: an "
       "integer from 1 to 2147483647"},
      {1,
       "2 1 3.0",
       "1: found '3.0'; expected the number of observations: an "
       "integer from 1 to 2147483647"},
      // 8 * 3 + 2 * (9 * 2147483647 + 3 * 1) - 1 bytes.
      {1,
       "2147483647 1 3",
       "1: the text is too short for 2147483647 cameras, 1 points and 3 "
       "observations; expected at least 38654705675 bytes after this line, "
       "not 304"},
      {1,
       "2147483647 2147483647 2147483647",
       "1: the text is too short for 2147483647 cameras, 2147483647 points and "
       "2147483647 observations; expected at least 68719476703 bytes after "
       "this line, not 304"},
      {1,
       "3 1 3",
       "23: the text ends; expected a camera's value: a finite "
       "double"},
      {1,
       "2 2 3",
       "23: the text ends; expected a point's coordinate: a finite "
       "double"},
      {1, "1 1 3", "3: found '1'; expected an observation's camera: 0"},
      {1, "2 1 2", "20: found '9'; expected the text's end"},
      {2,
       "",
       "5: found '1.5741515942940262e-02'; expected an observation's camera: "
       "an integer from 0 to 1"},
      {2,
       "2 0 1 1",
       "2: found '2'; expected an observation's camera: an "
       "integer from 0 to 1"},
      {2, "0 1 1 1", "2: found '1'; expected an observation's point: 0"},
      {2,
       "0 0 1",
       "2: the line ends; expected an observation's y: a finite "
       "double"},
      {2, "0 0 1 1 1", "2: found '1'; expected the line's end"},
      {3,
       "0 0 nan 1",
       "3: found 'nan'; expected an observation's x: a finite "
       "double"},
      {3,
       "0 0 1 -infinity",
       "3: found '-infinity'; expected an observation's "
       "y: a finite double"},
      {8,
       "1e999",
       "8: found '1e999'; expected a camera's value: a finite "
       "double"},
      {8,
       "0x1p3",
       "8: found '0x1p3'; expected a camera's value: a finite "
       "double"},
      {8,
       "",
       "23: the text ends; expected a point's coordinate: a finite "
       "double"},
      {23,
       "+-1",
       "23: found '+-1'; expected a point's coordinate: a finite "
       "double"},
      {23, "1 2", "23: found '2'; expected the text's end"},
      {23, "1\n\n2", "25: found '2'; expected the text's end"},
  };
  BalData sentinel;
  sentinel.points.setConstant(3, 1, 7.0);
  for (const Case& bad : cases) {
    BalData data = sentinel;
    std::string error;
    EXPECT_FALSE(ParseBal(ReplaceLine(kText, bad.line, bad.replacement),
                          "d/f.txt",
                          &data,
                          &error));
    EXPECT_EQ(error, std::string("d/f.txt:") + bad.message);
    EXPECT_EQ(BalText(data), BalText(sentinel));
  }
  BalData data;
  std::string error;
  EXPECT_FALSE(ParseBal("", "f", &data, &error));
  EXPECT_EQ(error,
            "f:1: the text is empty; expected the number of cameras: an "
            "integer from 1 to 2147483647");
}

TEST(BalFile, SaysWhichFileCannotBeRead) {
  const TemporaryFolder folder;
  BalData data;
  std::string error;
  EXPECT_FALSE(ReadBalFile(folder / "none.bz2", &data, &error));
  EXPECT_EQ(error,
            "cannot read " + folder / "none.bz2: No such file or directory");
  EXPECT_FALSE(ReadBalFile(folder / "", &data, &error));
  EXPECT_EQ(error, "cannot read " + folder / ": not a regular file");

  const std::string path = folder / "x.bz2";
  ASSERT_TRUE(WriteFile(path, kText, &error)) << error;
  EXPECT_FALSE(ReadBalFile(path, &data, &error));
  EXPECT_EQ(error,
            path +
                ": the compressed text is damaged; expected what "
                "bzip2 writes");
  // What is compressed is checked like any text.
  ASSERT_TRUE(WriteFile(path, CompressBzip2("1 1\n"), &error)) << error;
  EXPECT_FALSE(ReadBalFile(path, &data, &error));
  EXPECT_EQ(error,
            path +
                ":1: the text ends; expected the number of "
                "observations: an integer from 1 to 2147483647");
}

// A few thousand bytes that become 65 MiB, in 65 streams.
TEST(BalFile, DoesNotDecompressABomb) {
  const TemporaryFolder folder;
  const std::string path = folder / "bomb.bz2";
  const std::string stream = CompressBzip2(std::string(1 << 20, ' '));
  std::string error;
  std::string bytes;
  for (int i = 0; i < 65; ++i) {
    bytes += stream;
  }
  EXPECT_LT(bytes.size(), 10000);
  ASSERT_TRUE(WriteFile(path, bytes, &error)) << error;
  BalData data;
  EXPECT_FALSE(ReadBalFile(path, &data, &error));
  EXPECT_EQ(error,
            path +
                ": the compressed text is too long; expected at most "
                "67108864 bytes");
}

TEST(BalFile, SurvivesDamage) {
  for (const std::string& text : DamagedTexts(kText)) {
    ASSERT_EQ(FindReaderFlaw(kFormat, text), "") << text;
  }
}

TEST(BalFile, SurvivesTheFuzzersCorpus) {
  for (const std::string& text : FuzzCorpus("bal_file")) {
    EXPECT_EQ(FindReaderFlaw(kFormat, text), "") << text;
  }
}

TEST(BalFile, ReadsAPublishedFile) {
  const std::string path = PublishedData("bal/problem-16-22106-pre.txt.bz2");
  if (path.empty()) {
    GTEST_SKIP() << "problem-16-22106-pre.txt.bz2 is not in bal/ of "
                    "$INVGRAD_DATA: see "
                    "https://grail.cs.washington.edu/projects/bal/ladybug.html";
  }
  BalData data;
  std::string error;
  ASSERT_TRUE(ReadBalFile(path, &data, &error)) << error;
  EXPECT_EQ(data.cameras.cols(), 16);
  EXPECT_EQ(data.points.cols(), 22106);
  EXPECT_EQ(data.observations.size(), 83718);
  EXPECT_EQ(FindReaderFlaw(kFormat, BalText(data)), "");
}

}  // namespace bal_file_test
}  // namespace invgrad
