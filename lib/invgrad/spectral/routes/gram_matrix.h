// The Gram matrix of J's smaller side, in a unit that keeps its entries of order
// one.
//
//   K = J J^T / unit for m <= n,   K = J^T J / unit for n < m
//
// Shapes:  K: the lower triangle, min(m, n) x min(m, n), or this rank's columns
//          of it (column_strips.h);  diagonal: that of J J^T or J^T J.
// Units:   unit: a power of two, those of J squared; 1 for entries of ordinary
//          size.
// Cost:    that of JacobianOperator::Gram or ParameterGram.
// Fails:   returns false, with a message, if J or the square of an entry is not
//          finite. unit = 0 if all squares underflow, or J = 0: K is then
//          useless.
#ifndef INVGRAD_SPECTRAL_ROUTES_GRAM_MATRIX_H_
#define INVGRAD_SPECTRAL_ROUTES_GRAM_MATRIX_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/core/column_strips.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

bool SmallerGram(const JacobianOperator& J,
                 const ColumnStrips& strips,
                 Eigen::MatrixXd* K,
                 Eigen::VectorXd* diagonal,
                 double* unit,
                 std::string* message);

// Values of s^2 below this share of s_max^2 are not resolved from zero.
double GramResolution(Eigen::Index m, Eigen::Index n);

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_GRAM_MATRIX_H_
