#include "problems/estimation/nist_file.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/damaged_text.h"
#include "tests/support/published_data.h"
#include "tests/support/reader_check.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace nist_file_test {

constexpr TextFormat<NistData> kFormat = {ParseNist, NistText};

// Line 10 begins like a count, but is prose.
const char kText[] = R"(NIST/ITL StRD
Dataset Name:  Plane             (Plane.dat)

File Format:   ASCII
               Starting Values   (lines 18 to  19)
               Certified Values  (lines 18 to 24)
               Data              (lines 26 to 28)

Description:   These data are made up; no more than
               9 Predictors would be too many.

Data:          1 Response  (y)
               2 Predictors (x1 = time; x2 = height)
               3 Observations
Model:         Linear Class
               2 Parameters (b1 and b2)
        Start 1     Start 2           Parameter     Standard Deviation
  b1 =    2           2.5          2.5906836021E+00  1.9149996413E-02
  b2 =   -0.0001     +.5          -5.6177717026E-09  6.1124096540E-09

Residual Sum of Squares:                    1.4307867721E-25
Residual Standard Deviation:                3.7825768E-13
Degrees of Freedom:                                1
Number of Observations:                            3
Data:   y              x1            x2
      15.00E0         1E0         180E0
      17.25E0         2E0        -180E0
      1.1E-308        0           1E308
)";

TEST(NistFile, ReadsASmallFile) {
  NistData data;
  std::string error;
  ASSERT_TRUE(ParseNist(kText, "f", &data, &error)) << error;
  EXPECT_EQ(data.name, "Plane");
  EXPECT_EQ(data.num_parameters(), 2);
  EXPECT_EQ(data.starts,
            (Eigen::Matrix2d() << 2.0, 2.5, -0.0001, 0.5).finished());
  EXPECT_EQ(data.certified, Eigen::Vector2d(2.5906836021, -5.6177717026e-9));
  EXPECT_EQ(data.standard_deviations,
            Eigen::Vector2d(1.9149996413e-2, 6.112409654e-9));
  EXPECT_EQ(data.certified_sum_of_squares, 1.4307867721e-25);
  EXPECT_EQ(data.responses, Eigen::Vector3d(15.0, 17.25, 1.1e-308));
  EXPECT_EQ(data.predictors,
            (Eigen::MatrixXd(3, 2) << 1.0, 180.0, 2.0, -180.0, 0.0, 1e308)
                .finished());
}

TEST(NistFile, ReadsEveryEndOfLinesAndOfTheText) {
  std::string without_end = kText;
  without_end.pop_back();
  for (const std::string& text :
       {WithCrLf(kText), without_end, std::string(kText) + "\n \t\r\n\n"}) {
    NistData expected;
    NistData data;
    std::string error;
    ASSERT_TRUE(ParseNist(kText, "f", &expected, &error)) << error;
    ASSERT_TRUE(ParseNist(text, "f", &data, &error)) << error;
    EXPECT_EQ(NistText(data), NistText(expected));
  }
}

TEST(NistFile, WritesWhatItReads) {
  const TemporaryFolder folder;
  NistData data;
  data.name = "Many-parameters";  // which reach below line 61
  constexpr int n = 30;
  data.certified = Eigen::VectorXd::LinSpaced(n, -1.0 / 3.0, 1e300);
  data.standard_deviations = data.certified.cwiseAbs() / 7.0;
  data.starts = Eigen::MatrixXd::Constant(n, 2, -0.0);
  data.starts(3, 1) = std::numeric_limits<double>::denorm_min();
  data.responses = Eigen::VectorXd::LinSpaced(n, 0.1, 0.2);
  data.predictors = data.responses * Eigen::RowVector3d(1.0, M_PI, 1e-7);
  data.certified_sum_of_squares = std::numeric_limits<double>::max();
  EXPECT_EQ(FindReaderFlaw(kFormat, NistText(data)), "");

  NistData back;
  std::string error;
  ASSERT_TRUE(WriteNistFile(folder / "x.dat", data, &error)) << error;
  ASSERT_TRUE(ReadNistFile(folder / "x.dat", &back, &error)) << error;
  EXPECT_EQ(back.name, data.name);
  EXPECT_EQ(back.certified, data.certified);
  EXPECT_EQ(back.standard_deviations, data.standard_deviations);
  EXPECT_EQ(back.starts, data.starts);
  EXPECT_TRUE(std::signbit(back.starts(0, 0)));
  EXPECT_EQ(back.responses, data.responses);
  EXPECT_EQ(back.predictors, data.predictors);
  EXPECT_EQ(back.certified_sum_of_squares, data.certified_sum_of_squares);
}

TEST(NistFile, WritesNoOtherData) {
  const TemporaryFolder folder;
  NistData good;
  std::string error;
  ASSERT_TRUE(ParseNist(kText, "f", &good, &error)) << error;
  std::vector<NistData> bad(6, good);
  bad[0] = {};
  bad[1].name = "two words";
  bad[2].predictors(2, 1) = std::nan("");
  bad[3].standard_deviations(0) = -1.0;
  bad[4].responses.conservativeResize(1);
  bad[5].certified_sum_of_squares = HUGE_VAL;
  for (const NistData& data : bad) {
    error.clear();
    EXPECT_FALSE(WriteNistFile(folder / "x.dat", data, &error));
    EXPECT_EQ(error.find("cannot write " + folder / "x.dat:"), 0) << error;
  }
  EXPECT_EQ(folder.NumFiles(), 0);
}

TEST(NistFile, SaysWhatIsWrongAndWhere) {
  struct Case {
    int line;
    const char* replacement;
    const char* message;
  };
  const std::vector<Case> cases = {
      {2, "Dataset Name: ", "2: the line ends; expected the data set's name"},
      {2, "", "17: the head ends; expected 'Dataset Name: NAME'"},
      {5,
       "",
       "28: the text ends; expected 'Starting Values (lines A to B)' "
       "and the starting values on these lines"},
      {5,
       "Starting Values (lines 18 to 19",
       "5: found '19'; expected the last "
       "line's number and ')'"},
      {5, "Starting Values 18 to 19", "5: found '18'; expected '(lines'"},
      {5,
       "Starting Values (lines 3 to 19)",
       "5: found '3'; expected the first line's number: an integer from 6 to "
       "2147483647"},
      {5,
       "Starting Values (lines 18 to 20)",
       "16: 2 parameters are claimed; expected 3, as many as lines of starting "
       "values"},
      {6, "", "17: the head ends; expected 'Certified Values (lines A to B)'"},
      {6,
       "Certified Values (lines 17 to 24)",
       "6: the certified values are on other lines; expected lines that begin "
       "with the starting values'"},
      {6,
       "Certified Values (lines 18 to 23)",
       "23: the certified values end; expected 'Number of Observations:'"},
      {7, "", "17: the head ends; expected 'Data (lines A to B)'"},
      {7,
       "Data (lines 26 to 9223372036854775807)",
       "7: lines 26 to 9223372036854775807 are claimed; expected lines in "
       "order, up to line 28, where the text ends"},
      {7,
       "Data (lines 26 to 9223372036854775808)",
       "7: found '9223372036854775808)'; expected the last line's number and "
       "')'"},
      {7,
       "Data (lines 26 to 25)",
       "7: lines 26 to 25 are claimed; expected lines in order, up to line 28, "
       "where the text ends"},
      {7,
       "Data (lines 24 to 26)",
       "7: the data are not below the certified values; expected line 25 at "
       "the earliest"},
      {7,
       "Data (lines 27 to 28)",
       "14: 3 observations are claimed; expected 2, as many as lines of data"},
      {7,
       "Data (lines 25 to 27)",
       "25: found 'Data:'; expected a response: a finite double"},
      {13, "", "17: the head ends; expected 'P Predictors'"},
      {13, "0 Predictors", "13: 0 predictors are claimed; expected 1 or more"},
      {13,
       "2147483647 Predictors",
       "13: 2147483647 predictors are claimed; expected as many as there are "
       "in the lines of data"},
      {13, "1 Predictor", "26: found '180E0'; expected the line's end"},
      {13,
       "3 Predictors",
       "26: the line ends; expected a predictor: a finite double"},
      {14, "", "17: the head ends; expected 'M Observations'"},
      {14,
       "-3 Observations",
       "14: -3 observations are claimed; expected 3, as many as lines of data"},
      {16, "", "17: the head ends; expected 'N Parameters'"},
      {18, "  b2 = 1 2 3 4", "18: found 'b2'; expected 'b1'"},
      {18, "  b1 : 1 2 3 4", "18: found ':'; expected '='"},
      {18,
       "  b1 = 1 2 3",
       "18: the line ends; expected the standard "
       "deviation: a finite double"},
      {18, "  b1 = 1 2 3 4 5", "18: found '5'; expected the line's end"},
      {18,
       "  b1 = 1 2 3 -4",
       "18: a negative number; expected the standard deviation: 0 or more"},
      {19,
       "  b2 = 1 nan 3 4",
       "19: found 'nan'; expected starting value 2: a finite double"},
      {19,
       "  b2 = -inf 2 3 4",
       "19: found '-inf'; expected starting value 1: a finite double"},
      {19,
       "  b2 = 1 2 1e999 4",
       "19: found '1e999'; expected the certified value: a finite double"},
      {20,
       "Residue",
       "20: found 'Residue'; expected one each of 'Residual Sum "
       "of Squares:', 'Residual Standard Deviation:', 'Degrees "
       "of Freedom:' and 'Number of Observations:'"},
      {21,
       "",
       "24: the certified values end; expected 'Residual Sum of "
       "Squares:'"},
      {21,
       "Residual Sum of Squares: -1",
       "21: a negative number; expected the residual sum of squares: 0 or "
       "more"},
      {24,
       "Number of Observations: 4",
       "24: found '4'; expected the number of observations: 3"},
      {27, "", "27: the line ends; expected a response: a finite double"},
      {27, "1,5 2 3", "27: found '1,5'; expected a response: a finite double"},
      {28, "1 2 3\n\n4", "30: found '4'; expected the text's end"},
      {28, "1 2", "28: the text ends; expected a predictor: a finite double"},
      {28,
       "1 2 \x01"
       "23456789012345678901234567890123456789012345",
       "28: found '\\x01234567890123456789012345678901234567890...'; expected "
       "a "
       "predictor: a finite double"},
  };
  NistData sentinel;
  sentinel.name = "sentinel";
  for (const Case& bad : cases) {
    NistData data = sentinel;
    std::string error;
    EXPECT_FALSE(ParseNist(ReplaceLine(kText, bad.line, bad.replacement),
                           "d/f.dat",
                           &data,
                           &error));
    EXPECT_EQ(error, std::string("d/f.dat:") + bad.message);
    EXPECT_EQ(NistText(data), NistText(sentinel));
  }
  NistData data;
  std::string error;
  EXPECT_FALSE(ParseNist("", "f", &data, &error));
  EXPECT_EQ(error,
            "f:1: the text is empty; expected 'Starting Values (lines A to B)' "
            "and the starting values on these lines");
}

TEST(NistFile, SaysWhichFileCannotBeRead) {
  const TemporaryFolder folder;
  NistData data;
  std::string error;
  EXPECT_FALSE(ReadNistFile(folder / "none", &data, &error));
  EXPECT_EQ(error, "cannot read " + folder / "none: No such file or directory");
  EXPECT_FALSE(ReadNistFile(folder / "", &data, &error));
  EXPECT_EQ(error, "cannot read " + folder / ": not a regular file");
}

TEST(NistFile, SurvivesDamage) {
  for (const std::string& text : DamagedTexts(kText)) {
    ASSERT_EQ(FindReaderFlaw(kFormat, text), "") << text;
  }
}

TEST(NistFile, SurvivesTheFuzzersCorpus) {
  for (const std::string& text : FuzzCorpus("nist_file")) {
    EXPECT_EQ(FindReaderFlaw(kFormat, text), "") << text;
  }
}

TEST(NistFile, ReadsAllPublishedFiles) {
  struct Case {
    const char* name;
    int num_observations;
    int num_parameters;
    double sum_of_squares;
  };
  const std::vector<Case> cases = {
      {"Bennett5", 154, 3, 5.2404744073E-04},
      {"BoxBOD", 6, 2, 1.1680088766E+03},
      {"Chwirut1", 214, 3, 2.3844771393E+03},
      {"Chwirut2", 54, 3, 5.1304802941E+02},
      {"DanWood", 6, 2, 4.3173084083E-03},
      {"ENSO", 168, 9, 7.8853978668E+02},
      {"Eckerle4", 35, 3, 1.4635887487E-03},
      {"Gauss1", 250, 8, 1.3158222432E+03},
      {"Gauss2", 250, 8, 1.2475282092E+03},
      {"Gauss3", 250, 8, 1.2444846360E+03},
      {"Hahn1", 236, 7, 1.5324382854E+00},
      {"Kirby2", 151, 5, 3.9050739624E+00},
      {"Lanczos1", 24, 6, 1.4307867721E-25},
      {"Lanczos2", 24, 6, 2.2299428125E-11},
      {"Lanczos3", 24, 6, 1.6117193594E-08},
      {"MGH09", 11, 4, 3.0750560385E-04},
      {"MGH10", 16, 3, 8.7945855171E+01},
      {"MGH17", 33, 5, 5.4648946975E-05},
      {"Misra1a", 14, 2, 1.2455138894E-01},
      {"Misra1b", 14, 2, 7.5464681533E-02},
      {"Misra1c", 14, 2, 4.0966836971E-02},
      {"Misra1d", 14, 2, 5.6419295283E-02},
      {"Nelson", 128, 3, 3.7976833176E+00},
      {"Rat42", 9, 3, 8.0565229338E+00},
      {"Rat43", 15, 4, 8.7864049080E+03},
      {"Roszman1", 25, 4, 4.9484847331E-04},
      {"Thurber", 37, 7, 5.6427082397E+03},
  };
  for (const Case& published : cases) {
    const std::string name = published.name;
    const std::string path = PublishedData("nist/" + name + ".dat");
    if (path.empty()) {
      GTEST_SKIP() << name << ".dat is not in nist/ of $INVGRAD_DATA: see "
                   << "https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml";
    }
    NistData data;
    std::string error;
    ASSERT_TRUE(ReadNistFile(path, &data, &error)) << error;
    EXPECT_EQ(data.name, name);
    EXPECT_EQ(data.responses.size(), published.num_observations) << name;
    EXPECT_EQ(data.num_parameters(), published.num_parameters) << name;
    EXPECT_EQ(data.predictors.cols(), name == "Nelson" ? 2 : 1) << name;
    EXPECT_EQ(data.certified_sum_of_squares, published.sum_of_squares) << name;
    EXPECT_EQ(FindReaderFlaw(kFormat, NistText(data)), "") << name;
  }
}

}  // namespace nist_file_test
}  // namespace invgrad
