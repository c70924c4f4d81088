// Reads and writes the nonlinear regression files of NIST's Statistical
// Reference Datasets (StRD).
//
// The head of a file states the lines of the starting values, of the certified
// values and of the data. A row of parameters is
//
//   b1 =    2           2.5          2.5906836021E+00  1.9149996413E-02
//           start 1     start 2      certified         standard deviation
//
// and a row of data is a response followed by its predictors (one, or two in
// Nelson.dat). The head also states the counts of parameters, predictors and
// observations, which must agree with the rows.
//
// Cost:    linear in the size of the text, which also bounds the memory, for
//          any counts in the text.
// Fails:   returns false with "FILE:LINE: what is wrong; expected ..." if the
//          text is empty or truncated, its counts are wrong, or a number is not
//          finite. *data is then unchanged.
//
// [1] https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml
#ifndef PROBLEMS_ESTIMATION_NIST_FILE_H_
#define PROBLEMS_ESTIMATION_NIST_FILE_H_

#include <functional>
#include <string>

#include "Eigen/Core"

namespace invgrad {

struct NistData {
  std::string name;                     // "Misra1a"
  Eigen::VectorXd responses;            // m
  Eigen::MatrixXd predictors;           // m x p
  Eigen::MatrixXd starts;               // n x 2
  Eigen::VectorXd certified;            // n
  Eigen::VectorXd standard_deviations;  // n, certified
  double certified_sum_of_squares = 0.0;

  int num_parameters() const { return static_cast<int>(certified.size()); }
};

// `file`: the name of the text in messages.
bool ParseNist(const std::string& text,
               const std::string& file,
               NistData* data,
               std::string* error);

// Formats `data` as text that ParseNist reads back bit for bit.
std::string NistText(const NistData& data);

bool ReadNistFile(const std::string& path, NistData* data, std::string* error);

// Writes plain text if ParseNist can read it back.
bool WriteNistFile(const std::string& path,
                   const NistData& data,
                   std::string* error);

// Writes `data` with estimates in place of both starts.
std::function<
    bool(const std::string& path, const Eigen::VectorXd& b, std::string* error)>
NistWriter(const NistData& data);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_NIST_FILE_H_
