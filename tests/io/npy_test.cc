#include "invgrad/npy.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/io/atomic_file.h"
#include "tests/support/temporary_folder.h"

namespace invgrad {
namespace npy_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

template <typename T>
std::string Bytes(const std::vector<T>& values) {
  return std::string(reinterpret_cast<const char*>(values.data()),
                     values.size() * sizeof(T));
}

// A file as numpy.lib.format.write_array(file, x, version=(version, 0)) lays it
// out; the tests' headers are those that numpy 2.4.6 wrote.
std::string Npy(int version, std::string header, const std::string& payload) {
  const size_t preamble = version == 1 ? 10 : 12;
  while ((preamble + header.size() + 1) % 64 != 0) {
    header += ' ';
  }
  header += '\n';
  std::string bytes("\x93NUMPY", 6);
  bytes += static_cast<char>(version);
  bytes += '\0';
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  if (version > 1) {
    bytes += std::string(2, '\0');
  }
  return bytes + header + payload;
}

class NpyTest : public testing::Test {
 protected:
  MatrixXd Read(const std::string& bytes) {
    Put(bytes);
    MatrixXd matrix;
    std::string error;
    EXPECT_TRUE(ReadNpy(path_, -1, -1, &matrix, &error)) << error;
    return matrix;
  }

  // The message without "file <path>: ".
  std::string ReadError(const std::string& bytes,
                        int rows = -1,
                        int cols = -1) {
    Put(bytes);
    MatrixXd matrix = MatrixXd::Constant(1, 1, 7.0);
    std::string error;
    EXPECT_FALSE(ReadNpy(path_, rows, cols, &matrix, &error));
    EXPECT_EQ(matrix, MatrixXd::Constant(1, 1, 7.0)) << "output was changed";
    return WithoutPath(error);
  }

  std::string WithoutPath(const std::string& error) const {
    const std::string start = "file " + path_ + ": ";
    EXPECT_EQ(error.substr(0, start.size()), start);
    return error.substr(std::min(start.size(), error.size()));
  }

  void Put(const std::string& bytes) {
    std::string error;
    ASSERT_TRUE(WriteFile(path_, bytes, &error)) << error;
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "x.npy";
  // np.array([[1.5, -2, 3], [4, 5, 6.25]])
  const MatrixXd matrix_ =
      (MatrixXd(2, 3) << 1.5, -2.0, 3.0, 4.0, 5.0, 6.25).finished();
  const std::string by_rows_ =
      Bytes(std::vector<double>{1.5, -2.0, 3.0, 4.0, 5.0, 6.25});
  const std::string header_ =
      "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
};

TEST_F(NpyTest, ReadsWhatNumpyWrites) {
  for (const int version : {1, 2, 3}) {
    EXPECT_EQ(Read(Npy(version, header_, by_rows_)), matrix_);
  }
  EXPECT_EQ(
      Read(Npy(1,
               "{'descr': '<f8', 'fortran_order': True, 'shape': (2, 3), }",
               Bytes(std::vector<double>{1.5, 4.0, -2.0, 5.0, 3.0, 6.25}))),
      matrix_);
  const std::string single = "{'descr': '<f4', 'fortran_order': ";
  EXPECT_EQ(Read(Npy(1,
                     single + "False, 'shape': (2, 3), }",
                     Bytes(std::vector<float>{
                         1.5f, -2.0f, 3.0f, 4.0f, 5.0f, 6.25f}))),
            matrix_);
  EXPECT_EQ(Read(Npy(1,
                     single + "True, 'shape': (2, 3), }",
                     Bytes(std::vector<float>{
                         1.5f, 4.0f, -2.0f, 5.0f, 3.0f, 6.25f}))),
            matrix_);
  EXPECT_EQ(
      Read(Npy(1,
               "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }",
               Bytes(std::vector<double>{1.5, -2.0, 3.0}))),
      matrix_.row(0).transpose());
  const MatrixXd empty = Read(Npy(
      1, "{'descr': '<f8', 'fortran_order': False, 'shape': (0, 5), }", ""));
  EXPECT_EQ(empty.rows(), 0);
  EXPECT_EQ(empty.cols(), 5);
}

TEST_F(NpyTest, ReadsOtherSpellingsOfTheHeader) {
  // Python 2's long integers, double quotes, no spaces, another order of keys.
  EXPECT_EQ(Read(Npy(1,
                     "{\"shape\":(2L,3L),\"descr\":\"<f8\","
                     "\"fortran_order\":False}",
                     by_rows_)),
            matrix_);
}

TEST_F(NpyTest, WritesTheBytesOfNumpy) {
  std::string error;
  std::string bytes;
  ASSERT_TRUE(WriteNpy(path_, matrix_, &error)) << error;
  ASSERT_TRUE(ReadFile(path_, &bytes, &error)) << error;
  EXPECT_EQ(bytes, Npy(1, header_, by_rows_));
  EXPECT_EQ(bytes.size(), 128u + 6 * 8);  // as numpy's own file has

  ASSERT_TRUE(WriteNpy(path_, VectorXd(matrix_.col(2)), &error)) << error;
  ASSERT_TRUE(ReadFile(path_, &bytes, &error)) << error;
  EXPECT_EQ(bytes,
            Npy(1,
                "{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }",
                Bytes(std::vector<double>{3.0, 6.25})));
}

TEST_F(NpyTest, RoundTripIsExact) {
  MatrixXd matrix(2, 4);
  matrix << 0.1, -0.0, 5e-324, 1.7976931348623157e308,  //
      1.0 / 3.0, std::numeric_limits<double>::infinity(), -1e-300, 2.0;
  std::string error;
  MatrixXd back;
  ASSERT_TRUE(WriteNpy(path_, matrix, &error)) << error;
  ASSERT_TRUE(ReadNpy(path_, 2, 4, &back, &error)) << error;
  EXPECT_EQ(back, matrix);
  EXPECT_TRUE(std::signbit(back(0, 1)));

  for (const int size : {0, 1, 100}) {
    const VectorXd vector = VectorXd::LinSpaced(size, 0.1, 7.7);
    VectorXd vector_back;
    ASSERT_TRUE(WriteNpy(path_, vector, &error)) << error;
    ASSERT_TRUE(ReadNpy(path_, size, &vector_back, &error)) << error;
    EXPECT_EQ(vector_back, vector);
  }
}

TEST_F(NpyTest, WrongShapesAreReported) {
  const std::string file = Npy(1, header_, by_rows_);
  EXPECT_EQ(ReadError(file, -1, 5), "found shape (2, 3), wanted (*, 5)");
  EXPECT_EQ(ReadError(file, 3, 3), "found shape (2, 3), wanted (3, 3)");
  const std::string flat =
      Npy(1,
          "{'descr': '<f8', 'fortran_order': False, 'shape': (1,), }",
          Bytes<double>({1.0}));
  EXPECT_EQ(ReadError(flat, 2, -1), "found shape (1,), wanted (2, *)");
  EXPECT_EQ(
      ReadError(Npy(1,
                    "{'descr': '<f8', 'fortran_order': False, 'shape': (), }",
                    Bytes<double>({1.0}))),
      "found shape (), wanted (*, *)");
  EXPECT_EQ(
      ReadError(
          Npy(1,
              "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 1, 1), }",
              Bytes<double>({1.0}))),
      "found shape (1, 1, 1), wanted (*, *)");

  Put(file);
  VectorXd vector;
  std::string error;
  EXPECT_FALSE(ReadNpy(path_, -1, &vector, &error));
  EXPECT_EQ(WithoutPath(error), "found shape (2, 3), wanted (*, 1)");
  Put(flat);
  EXPECT_FALSE(ReadNpy(path_, 4, &vector, &error));
  EXPECT_EQ(WithoutPath(error), "found shape (1,), wanted (4, 1)");
}

TEST_F(NpyTest, AColumnIsAVector) {
  Put(Npy(1,
          "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 1), }",
          Bytes<double>({1.0, 2.0})));
  VectorXd vector;
  std::string error;
  ASSERT_TRUE(ReadNpy(path_, 2, &vector, &error)) << error;
  EXPECT_EQ(vector, VectorXd::LinSpaced(2, 1.0, 2.0));
}

TEST_F(NpyTest, MissingAndForeignFilesAreReported) {
  MatrixXd matrix;
  std::string error;
  EXPECT_FALSE(ReadNpy(folder_ / "none.npy", -1, -1, &matrix, &error));
  EXPECT_EQ(
      error,
      "cannot read " + (folder_ / "none.npy") + ": No such file or directory");
  const std::string foreign =
      "not a .npy file (it does not begin with \\x93NUMPY)";
  EXPECT_EQ(ReadError(""), foreign);
  EXPECT_EQ(ReadError("1.0,2.0\n3.0,4.0\n"), foreign);
  std::string newer = Npy(1, header_, by_rows_);
  newer[6] = 4;
  EXPECT_EQ(ReadError(newer), "found .npy version 4.0, wanted 1.0, 2.0 or 3.0");
}

TEST_F(NpyTest, EveryTruncationIsReported) {
  for (const int version : {1, 2}) {
    const std::string file = Npy(version, header_, by_rows_);
    for (size_t size = 6; size < file.size(); ++size) {
      const std::string problem = ReadError(file.substr(0, size));
      EXPECT_NE(problem.find("truncated"), std::string::npos) << problem;
    }
    EXPECT_EQ(
        ReadError(file + "x"),
        "shape (2, 3) of '<f8' does not fit the 49 bytes after the header "
        "(truncated?)");
  }
}

TEST_F(NpyTest, OtherTypesAreReported) {
  for (const std::string type : {">f8", "<i8", "<f2", "<c16", "|b1", "|O"}) {
    EXPECT_EQ(ReadError(Npy(1,
                            "{'descr': '" + type +
                                "', 'fortran_order': False, 'shape': (2, 3), }",
                            by_rows_)),
              "found type '" + type +
                  "', wanted '<f8' or '<f4' (in Python: x.astype('<f8'))");
  }
  const std::string problem = ReadError(
      Npy(1,
          "{'descr': [('a', '<f8'), ('b', '<f4')], 'fortran_order': False, "
          "'shape': (2,), }",
          std::string(24, '\0')));
  EXPECT_NE(problem.find("found type [('a','<f8'),('b','<f4')], wanted"),
            std::string::npos)
      << problem;
}

TEST_F(NpyTest, LyingHeadersDoNotAllocate) {
  // Sizes whose bytes, or whose product, overflow 32 or 64 bits. The last of
  // them is 2^64 values: a product modulo 2^64 would be an empty file.
  for (const std::string shape : {"(2000000000, 2000000000)",
                                  "(1000000000,)",
                                  "(2147483647, 2147483647)",
                                  "(536870912, 4)",
                                  "(4294967298, 3)",
                                  "(4294967296, 4294967296)"}) {
    for (const std::string& payload : {by_rows_, std::string()}) {
      const std::string problem = ReadError(Npy(
          1,
          "{'descr': '<f8', 'fortran_order': False, 'shape': " + shape + ", }",
          payload));
      EXPECT_NE(problem.find("shape " + shape), std::string::npos) << problem;
    }
  }
  // A header that claims to be 4 GB long.
  std::string file = Npy(2, header_, by_rows_);
  file.replace(8, 4, "\xff\xff\xff\xff");
  EXPECT_EQ(ReadError(file), "truncated in the header, at 176 bytes");
}

// Sparse files of some 8 TB.
TEST_F(NpyTest, LargeFilesAreJudgedByTheirHeader) {
  constexpr std::uintmax_t kSize = std::uintmax_t{1} << 43;
  const std::string array = Npy(
      1,
      "{'descr': '<f8', 'fortran_order': False, 'shape': (1073741824, 1023), }",
      "");
  const auto read_error =
      [&](const std::string& beginning, std::uintmax_t size, int rows) {
        Put(beginning);
        std::filesystem::resize_file(path_, size);
        MatrixXd matrix;
        std::string error;
        EXPECT_FALSE(ReadNpy(path_, rows, -1, &matrix, &error));
        return WithoutPath(error);
      };
  EXPECT_EQ(read_error("", kSize, -1),
            "not a .npy file (it does not begin with \\x93NUMPY)");
  EXPECT_EQ(read_error(array, kSize, 7),
            "found shape (1073741824, 1023), wanted (7, *)");
  EXPECT_NE(read_error(array, kSize, -1).find("does not fit the 87960930220"),
            std::string::npos);
  const std::string problem =
      read_error(array, array.size() + 1073741824ull * 1023 * 8, -1);
  EXPECT_EQ(problem.find("it needs 35.2 TB (copies of the array 26.4 TB, "
                         "its bytes 8.79 TB); the limit is "),
            0u)
      << problem;
  std::string long_header = Npy(2, header_, by_rows_);
  long_header.replace(8, 4, std::string("\0\0\1\1", 4));
  EXPECT_EQ(read_error(long_header, kSize, -1),
            "its header has 16842752 bytes; at most 65536 are allowed");
}

TEST_F(NpyTest, MalformedHeadersAreShown) {
  const std::string shape =
      "{'descr': '<f8', 'fortran_order': False, 'shape': ";
  for (const std::string& header :
       {shape + "(-2, 3), }",
        shape + "(2.0, 3), }",
        shape + "(2; 3), }",
        shape + "(99999999999999999999, 3), }",
        shape + "(2, 3)",
        shape + "(2,",
        shape + "(2, 3), 'x': 1, }",
        shape + "(2, 3), 'descr': '<f8', }",
        shape + "(2, 3), } + 1",
        std::string("{'descr': '<f8', 'fortran_order': no, 'shape': (2, 3)}"),
        std::string("{'descr': '<f8, 'fortran_order': False, 'shape': (2,)}"),
        std::string("{'descr': '<f8', 'shape': (2, 3), }"),
        std::string("[1, 2]"),
        std::string()}) {
    const std::string problem = ReadError(Npy(1, header, by_rows_));
    EXPECT_EQ(problem, "cannot read its header: " + header.substr(0, 120));
  }
}

TEST_F(NpyTest, FailedWriteIsReported) {
  std::string error;
  EXPECT_FALSE(WriteNpy(folder_ / "none/x.npy", matrix_, &error));
  EXPECT_EQ(error,
            "cannot write " + (folder_ / "none/x.npy") +
                ": No such file or directory");
}

}  // namespace npy_test
}  // namespace invgrad
