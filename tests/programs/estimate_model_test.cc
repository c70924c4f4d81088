// The program estimate with a user's own model and data.

#include <cmath>
#include <string>
#include <vector>

#include "fmt/core.h"
#include "gtest/gtest.h"
#include "problems/estimation/data_table.h"
#include "problems/estimation/nist_file.h"
#include "tests/programs/estimate_program.h"
#include "tests/support/published_data.h"

namespace invgrad {
namespace estimate_model_test {

class EstimateModel : public EstimateProgram {
 protected:
  // Of a result file.
  double ParameterOf(const std::string& file, const std::string& name) const {
    const std::string text = ReadAll(Path("run") + "/" + file);
    const std::string begin = "# " + name + " = ";
    const std::size_t at = text.find(begin);
    EXPECT_NE(at, std::string::npos) << name << " in\n" << text;
    return at == std::string::npos ? 0.0
                                   : std::stod(text.substr(at + begin.size()));
  }
};

// a exp(-k t) + c, exactly, with a column of texts that is not used.
TEST_F(EstimateModel, FitsATable) {
  std::string text = "time,label,signal\n";
  for (int i = 0; i < 12; ++i) {
    text += fmt::format(
        "{},row {},{}\n", 0.5 * i, i, 3.0 * std::exp(-0.7 * 0.5 * i) + 0.25);
  }
  const Output output = RunQuietly(WriteText("decay.csv", text),
                                   "run",
                                   {"--model=signal = a*exp(-k*time) + c",
                                    "--start_values=a=1,k=1,c=0",
                                    "--methods=ceres_lm,ceres_dogleg",
                                    "--covariance"});
  ExpectSays(output,
             {"12 observations, 3 parameters",
              "signal = a*exp(-k*time) + c",
              "decay, ceres_lm: a = 3 +/- ",
              "k = 0.7 +/- ",
              "c = 0.25 +/- "});
  const std::string result = "decay/ceres_lm.fit.csv";
  EXPECT_NEAR(ParameterOf(result, "a"), 3.0, 1e-9);
  EXPECT_NEAR(ParameterOf(result, "k"), 0.7, 1e-9);
  EXPECT_NEAR(ParameterOf(result, "c"), 0.25, 1e-9);
  // The result is a table, too.
  DataTable table;
  std::string error;
  ASSERT_TRUE(
      ParseTable(ReadAll(Path("run") + "/" + result), "result", &table, &error))
      << error;
  EXPECT_EQ(
      table.names,
      (std::vector<std::string>{"time", "label", "signal", "fit", "residual"}));
  EXPECT_EQ(table.rows.size(), 12);
}

TEST_F(EstimateModel, FitsATableThatIsCalledDat) {
  RunQuietly(WriteText("line.dat", "# x y\n1 3\n2 5\n3 7\n"),
             "run",
             {"--model=c2 = a + b*c1",
              "--start_values=a=0,b=0",
              "--methods=ceres_lm"});
  EXPECT_NEAR(ParameterOf("line/ceres_lm.fit.csv", "a"), 1.0, 1e-9);
  EXPECT_NEAR(ParameterOf("line/ceres_lm.fit.csv", "b"), 2.0, 1e-9);
}

// A mean with weights, by hand: columns without names, and all three ways to
// weight.
TEST_F(EstimateModel, WeightsAreThoseOfTheSquares) {
  const std::string input = WriteText("mean.tsv", "1 0.5\n2 1\n4 2\n");
  struct Case {
    std::vector<std::string> arguments;
    double mean;
    double deviation;
  };
  // Weights 4, 1, 1/4.
  const double mean = (4.0 + 2.0 + 1.0) / 5.25;
  const double squares = 4.0 * std::pow(1.0 - mean, 2) +
                         std::pow(2.0 - mean, 2) +
                         0.25 * std::pow(4.0 - mean, 2);
  for (const Case& known :
       {Case{{}, 7.0 / 3.0, std::sqrt((16.0 + 1.0 + 25.0) / 9.0 / 2.0 / 3.0)},
        {{"--weights=1/c2^2"}, mean, std::sqrt(squares / 2.0 / 5.25)},
        {{"--deviations=c2"}, mean, std::sqrt(1.0 / 5.25)}}) {
    std::vector<std::string> arguments = {"--model=c1 = m",
                                          "--start_values=m=0",
                                          "--methods=ceres_lm",
                                          "--covariance",
                                          "--overwrite"};
    arguments.insert(
        arguments.end(), known.arguments.begin(), known.arguments.end());
    const Output output = RunQuietly(input, "run", arguments);
    ExpectSays(
        output,
        {fmt::format("m = {:.8g} +/- {:.3g}", known.mean, known.deviation)});
  }
}

// Rows of weight 0 change nothing, not even where the model has no value.
TEST_F(EstimateModel, RowsOfWeightZeroDoNotCount) {
  const std::vector<std::string> arguments = {"--model=a + b*log(x)",
                                              "--start_values=a=0,b=0",
                                              "--weights=w",
                                              "--methods=ceres_lm",
                                              "--covariance"};
  const std::string text = "x,y,w\n1,1,1\n2,3,2\n3,2,1\n";
  const auto estimate = [&](const std::string& name, const std::string& rows) {
    const std::string all =
        RunQuietly(
            WriteText(name + ".csv", text + rows), "run-" + name, arguments)
            .text;
    const std::size_t begin = all.find(": a = ");
    return all.substr(begin, all.find('\n', begin) - begin);
  };
  const std::string three = estimate("three", "");
  EXPECT_NE(three.find(" +/- "), std::string::npos) << three;
  EXPECT_EQ(estimate("more", "4,9,0\n5,1,0\n0,1,0\n"), three);
  std::vector<std::string> too_few = arguments;
  too_few.push_back("--input=" +
                    WriteText("few.csv", "x,y,w\n1,1,0\n2,3,0\n3,2,1\n"));
  ExpectRefused(too_few, {"1 rows (and 2 of weight 0)", "2 parameters"});
}

// Of b and d only the sum is determined.
TEST_F(EstimateModel, GivesNoErrorBarToWhatIsNotDetermined) {
  const Output output =
      RunQuietly(WriteText("line.csv", "x,y\n1,1\n2,3\n3,2\n4,5\n"),
                 "run",
                 {"--model=c + b*x + d*x",
                  "--start_values=b=1,c=0,d=0",
                  "--methods=ceres_lm",
                  "--covariance"});
  ExpectSays(output,
             {"line, ceres_lm: c = ",
              "(no error bar: 50 % not determined), d = ",
              "(no error bar: 50 % not determined)\n"});
  const std::size_t of_c = output.text.find(" +/- ");
  EXPECT_NE(of_c, std::string::npos);
  EXPECT_EQ(output.text.find(" +/- ", of_c + 1), std::string::npos);
}

TEST_F(EstimateModel, ReadsItsOwnResult) {
  const std::vector<std::string> arguments = {
      "--model=y = b*x", "--start_values=b=1", "--methods=ceres_lm"};
  RunQuietly(WriteText("line.csv", "\"x\",y,\"a,b\"\n1,2,\"p,q\"\n2,4,r\n"),
             "first",
             arguments);
  RunQuietly(Path("first") + "/line/ceres_lm.fit.csv", "second", arguments);
  RunQuietly(Path("second") + "/ceres_lm.fit/ceres_lm.fit.csv",
             "third",
             {"--model=fit_2 = b*x", "--start_values=b=1"});
}

// y = b x with b between bounds.
TEST_F(EstimateModel, StaysWithinBounds) {
  const std::string input = WriteText("line.csv", "x;y\n1;2\n2;4\n3;6\n");
  const std::vector<std::string> arguments = {
      "--model=b*x", "--start_values=b=1", "--methods=ceres_lm,ceres_dogleg"};
  RunQuietly(input, "run", arguments);
  EXPECT_NEAR(ParameterOf("line/ceres_lm.fit.csv", "b"), 2.0, 1e-9);
  std::vector<std::string> bounded = arguments;
  bounded.insert(bounded.end(), {"--bounds=b=0..1.5", "--overwrite"});
  RunQuietly(input, "run", bounded);
  EXPECT_NEAR(ParameterOf("line/ceres_lm.fit.csv", "b"), 1.5, 1e-9);
  EXPECT_NEAR(ParameterOf("line/ceres_dogleg.fit.csv", "b"), 1.5, 1e-9);
  // A rule alone would leave them.
  const Output refused = Run({"--input=" + input,
                              "--model=b*x",
                              "--start_values=b=1",
                              "--bounds=b=0..1.5",
                              "--methods=geodesic",
                              "--noplots",
                              "--noprogress",
                              "--output=" + Path("refused")});
  EXPECT_EQ(refused.exit_code, 3) << refused.text;
  ExpectSays(refused, {"not run: the problem has bounds"});
}

// y = a t + b with b at its bound, by hand: a = sum t y / sum t^2 = 22 / 14,
// with the deviation sqrt(sum r^2 / (4 - 1) / sum t^2).
TEST_F(EstimateModel, ParametersAtTheirBoundsCountAsConstant) {
  const Output output =
      RunQuietly(WriteText("line.csv", "t,y\n0,-1\n1,0\n2,5\n3,4\n"),
                 "run",
                 {"--model=y=a*t+b",
                  "--start_values=a=1,b=0",
                  "--bounds=b=0..5",
                  "--methods=ceres_lm,ceres_dogleg,ceres_lm+geodesic",
                  "--covariance"});
  const double a = 22.0 / 14.0;
  const double squares = 1.0 + 25.0 + 16.0 - 22.0 * a;
  for (const char* method : {"ceres_lm", "ceres_dogleg", "ceres_lm+geodesic"}) {
    ExpectSays(output,
               {fmt::format("line, {}: a = {:.8g} +/- {:.3g}, b = 0 (at its "
                            "bound)",
                            method,
                            a,
                            std::sqrt(squares / 3.0 / 14.0))});
  }
}

// From a cost of 1e34, where rounding errors exceed the minima.
TEST_F(EstimateModel, CountsTheLeastCostFromABadStart) {
  const Output output =
      RunQuietly(WriteText("decay.csv", "t,y\n0,3\n1,2\n2,1.4\n3,1.2\n4,1.1\n"),
                 "run",
                 {"--model=a*exp(-k*t)+c",
                  "--start_values=a=1,k=-10,c=0",
                  "--max_iterations=40",
                  "--methods=ceres_lm,ceres_bfgs"});
  ExpectSays(output, {"1 of 1", "0 of 1"});
}

// sqrt(x) and x^b have no derivative by x, which would be infinite at 0.
TEST_F(EstimateModel, TakesAPredictorOfZero) {
  std::string text = "x,y\n";
  for (int i = 0; i < 8; ++i) {
    const double x = 0.5 * i;
    text +=
        fmt::format("{},{:.17g}\n", x, 3.0 * std::sqrt(x) + std::pow(x, 1.5));
  }
  const std::string table = WriteText("roots.csv", text);
  RunQuietly(table,
             "run",
             {"--model=a*sqrt(x)+x^b*x^0.5",
              "--start_values=a=1,b=0.5",
              "--methods=ceres_lm"});
  EXPECT_NEAR(ParameterOf("roots/ceres_lm.fit.csv", "a"), 3.0, 1e-9);
  EXPECT_NEAR(ParameterOf("roots/ceres_lm.fit.csv", "b"), 1.0, 1e-9);
}

// In units in which a parameter is 1e-12 and its start is zero.
TEST_F(EstimateModel, UnitsOfParametersDoNotMatter) {
  std::string text = "x,y\n";
  for (int i = 1; i <= 8; ++i) {
    text += fmt::format("{:e},{}\n", 1e11 * i, std::exp(-1e-12 * 1e11 * i));
  }
  const Output output = RunQuietly(
      WriteText("slow.csv", text),
      "run",
      {"--model=exp(-k*x)", "--start_values=k=0", "--methods=ceres_lm"});
  EXPECT_NEAR(ParameterOf("slow/ceres_lm.fit.csv", "k"), 1e-12, 1e-20);
}

// A file of NIST's form of a model that is not NIST's.
TEST_F(EstimateModel, FitsAFileOfNistsForm) {
  NistData data;
  data.name = "Growth";
  data.predictors = Eigen::VectorXd::LinSpaced(8, 0.5, 4.0);
  data.responses =
      2.0 * data.predictors.array() / (0.5 + data.predictors.array());
  data.starts.resize(2, 2);
  data.starts << 1.5, 2.5, 0.6, 0.4;
  data.certified = Eigen::Vector2d(2.0, 0.5);
  data.standard_deviations = Eigen::Vector2d(1e-9, 1e-9);
  std::string error;
  ASSERT_TRUE(WriteNistFile(Path("growth.dat"), data, &error)) << error;
  ExpectRefused({"--input=" + Path("growth.dat")},
                {"'Growth' is not one of NIST's 27 data sets", "--model="});
  RunQuietly(Path("growth.dat"),
             "run",
             {"--model=b1*x/(b2 + x)", "--methods=ceres_lm"});
  const auto rows = Results("run");
  ASSERT_EQ(rows.size(), 2);
  for (const auto& row : rows) EXPECT_GT(std::stod(row[8]), 7.0);  // digits
  NistData result;
  ASSERT_TRUE(ReadNistFile(
      Path("run") + "/growth-start2/ceres_lm.dat", &result, &error))
      << error;
  EXPECT_NEAR(result.starts(0, 1), 2.0, 1e-7);
  EXPECT_NEAR(result.starts(1, 1), 0.5, 1e-7);
  // Other parameters, with start values: a table is the result.
  RunQuietly(Path("growth.dat"),
             "run",
             {"--model=top*x/(half + x)",
              "--start_values=top=1,half=1",
              "--methods=ceres_lm",
              "--overwrite"});
  EXPECT_NEAR(ParameterOf("growth/ceres_lm.fit.csv", "half"), 0.5, 1e-7);
}

// NIST's own files by formulas of a user.
TEST_F(EstimateModel, SolvesPublishedRegressions) {
  struct Case {
    const char* file;
    const char* model;
  };
  for (const Case& known :
       {Case{"Misra1a", "b1*(1 - exp(-b2*x))"},
        {"Nelson", "log(y) = b1 - b2*x1*exp(-b3*x2)"},
        {"MGH10", "b1*exp(b2/(x + b3))"},
        {"Roszman1", "b1 - b2*x - atan2(b3, x - b4)/pi"},
        {"Hahn1", "(b1 + b2*x + b3*x^2 + b4*x^3)/(1 + b5*x + b6*x^2 + b7*x^3)"},
        {"ENSO",
         "b1 + b2*cos(2*pi*x/12) + b3*sin(2*pi*x/12) + b5*cos(2*pi*x/b4) + "
         "b6*sin(2*pi*x/b4) + b8*cos(2*pi*x/b7) + b9*sin(2*pi*x/b7)"}}) {
    const std::string input =
        PublishedData(std::string("nist/") + known.file + ".dat");
    if (input.empty()) {
      GTEST_SKIP() << "https://www.itl.nist.gov/div898/strd/nls has the files";
    }
    RunQuietly(input,
               "run",
               {std::string("--model=") + known.model,
                "--methods=ceres_lm",
                "--covariance",
                "--overwrite"});
    const auto rows = Results("run");
    ASSERT_EQ(rows.size(), 2);
    for (const auto& row : rows) {
      EXPECT_GT(std::stod(row[8]), 6.0) << known.file;   // digits
      EXPECT_GT(std::stod(row[14]), 6.0) << known.file;  // of deviations
    }
  }
}

// A line through n alternating numbers explains 3 / (n^2 - 1) of their squares:
// 0.5 % of 24, 2 % of 12.
TEST_F(EstimateModel, SaysThatAConstantIsAsGood) {
  for (const int n : {12, 24}) {
    std::string text = "t,y\n";
    for (int i = 0; i < n; ++i) text += fmt::format("{},{}\n", i, i % 2);
    const std::string name = fmt::format("{}.csv", n);
    const Output output = RunQuietly(
        WriteText(name, text),
        fmt::format("run{}", n),
        {"--model=a + b*t", "--start_values=a=1,b=1", "--methods=ceres_lm"});
    EXPECT_EQ(
        output.text.find("no better than a constant") != std::string::npos,
        n == 24)
        << output.text;
  }
}

// The model has no value in a row of weight 0.
TEST_F(EstimateModel, SaysThatAConstantIsAsGoodAsWithoutRowsOfWeightZero) {
  std::string text = "t,y,w\n-1,5,0\n";
  for (int i = 1; i <= 40; ++i) text += fmt::format("{},{},1\n", i, i % 2);
  const Output output = RunQuietly(WriteText("log.csv", text),
                                   "run",
                                   {"--model=a + b*log(t)",
                                    "--start_values=a=1,b=1",
                                    "--weights=w",
                                    "--methods=ceres_lm"});
  ExpectSays(output, {"no better than a constant"});
}

TEST_F(EstimateModel, SaysWhatIsWrong) {
  const std::string input =
      "--input=" + WriteText("t.csv", "t,y,name\n1,2,a\n2,3,b\n3,-1,c\n");
  const std::string model = "--model=a*t + b";
  const std::string start = "--start_values=a=1,b=1";
  ExpectRefused({input}, {"t.csv: expected --model"});
  ExpectRefused({input, "--model=a*(t", start}, {"--model=", "character"});
  ExpectRefused({input, model}, {"no start value for a, b", "t, y, name"});
  ExpectRefused({input, model, "--start_values=a=1"}, {"no start value for b"});
  ExpectRefused({input, model, "--start_values=a=1,b=2,k=3"},
                {"no parameter 'k'; it has a, b"});
  ExpectRefused({input, "--model=z = a*t", "--start_values=a=1"},
                {"no column 'z'", "t, y, name"});
  ExpectRefused({"--input=" + WriteText("u.csv", "t,u\n1,2\n"), "--model=a*t"},
                {"no column y", "COLUMN = ", "t, u"});
  ExpectRefused({input, "--model=2*t"}, {"there is no parameter"});
  ExpectRefused({input, "--model=a*name", "--start_values=a=1"},
                {"t.csv:2", "'a'", "column name"});
  ExpectRefused({input, "--model=log(y) = a*t", "--start_values=a=1"},
                {"t.csv:4", "log(y)", "not finite"});
  ExpectRefused({input, model, start, "--weights=y"},
                {"t.csv:4", "--weights=y is -1", "0 or more"});
  ExpectRefused({input, model, start, "--deviations=y"},
                {"t.csv:4", "a positive number"});
  ExpectRefused({input, model, start, "--weights=y", "--deviations=y"},
                {"--weights and --deviations"});
  ExpectRefused({input, model, start, "--weights=w"}, {"no column 'w'"});
  ExpectRefused({input, model, start, "--bounds=a=2..3"},
                {"--bounds: a=2..3", "start value 1"});
  ExpectRefused(
      {input, "--model=a*t^3+b*t^2+c*t+d", "--start_values=a=1,b=1,c=1,d=1"},
      {"3 rows", "4 parameters"});
  ExpectRefused({input, "--start_values=a=1"}, {"only with --model"});
  ExpectRefused({"--input=" + WriteG2o2d(), model, start},
                {"--model: ", "square.g2o is no table"});
  ExpectRefused({"--input=" + WriteText("t.dat", "1 2\n2 3\n")},
                {"t.dat:2", "--model="});
  ExpectRefused({"--input=" + WriteMisra1a(), "--model=b1*x + b3"},
                {"no start value for b1, b3"});
}

}  // namespace estimate_model_test
}  // namespace invgrad
