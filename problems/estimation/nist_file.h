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
// Cost:    linear in the size of the text, which bounds the memory too,
//          whatever counts the text claims.
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

// `file`: the name of the text in messages.
bool ParseNist(const std::string& text,
               const std::string& file,
               NistData* data,
               std::string* error);

// The text that ParseNist reads back as `data`, bit for bit.
std::string NistText(const NistData& data);

// What ParseNist guarantees and WriteNistFile needs: sizes agree, there are a
// parameter, a predictor and no fewer observations than parameters, numbers are
// finite, and the name is one word. If not, *error says which condition fails.
bool CheckNist(const NistData& data, std::string* error);

bool ReadNistFile(const std::string& path, NistData* data, std::string* error);

bool WriteNistFile(const std::string& path,
                   const NistData& data,
                   std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_NIST_FILE_H_
