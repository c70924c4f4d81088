// Reads and writes the nonlinear regression files of NIST's Statistical
// Reference Datasets (StRD).
//
// A file says at its head on which lines the starting values, the certified
// values and the data are; a row of parameters is
//
//   b1 =    2           2.5          2.5906836021E+00  1.9149996413E-02
//           start 1     start 2      certified         standard deviation
//
// and a row of data is a response followed by its predictors (one, or two in
// Nelson.dat). The counts of parameters, predictors and observations, which the
// text states as well, must agree with the rows.
//
// Cost:    linear in the size of the text; memory is bounded by it, whatever
//          the numbers in it claim.
// Fails:   returns false with "FILE:LINE: what is wrong; expected ..." if the
//          text is empty, cut off, has other counts than it claims, or a number
//          that is not finite. *data is then unchanged.
//
// [1] https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml
#ifndef PROBLEMS_ESTIMATION_NIST_FILE_H_
#define PROBLEMS_ESTIMATION_NIST_FILE_H_

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

// `file` is what messages call the text.
bool ParseNist(const std::string& text,
               const std::string& file,
               NistData* data,
               std::string* error);

// The text that ParseNist reads back as `data`, bit for bit.
std::string NistText(const NistData& data);

// True if `data` is what ParseNist promises and what can be written: sizes
// agree, there are a parameter, a predictor and no fewer observations than
// parameters, numbers are finite, and the name is one word. Otherwise *error
// says what is not.
bool CheckNist(const NistData& data, std::string* error);

bool ReadNistFile(const std::string& path, NistData* data, std::string* error);

// Writes `data` in the same format, such that ParseNist reads it back.
bool WriteNistFile(const std::string& path,
                   const NistData& data,
                   std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_NIST_FILE_H_
