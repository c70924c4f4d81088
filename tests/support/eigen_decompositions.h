// Eigen's decompositions of MatrixXd, which tests compare with. They are compiled
// once, in eigen_decompositions.cc: each takes seconds.
//
// A part of the tests' precompiled header: tests include Eigen's own headers.
#ifndef INVGRAD_TESTS_SUPPORT_EIGEN_DECOMPOSITIONS_H_
#define INVGRAD_TESTS_SUPPORT_EIGEN_DECOMPOSITIONS_H_

#include "Eigen/Core"
#include "Eigen/Eigenvalues"
#include "Eigen/LU"
#include "Eigen/QR"
#include "Eigen/SVD"

extern template class Eigen::ColPivHouseholderQR<Eigen::MatrixXd>;
extern template class Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>;
extern template class Eigen::HouseholderQR<Eigen::MatrixXd>;
extern template class Eigen::JacobiSVD<Eigen::MatrixXd>;
extern template class Eigen::PartialPivLU<Eigen::MatrixXd>;
extern template class Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>;

#endif  // INVGRAD_TESTS_SUPPORT_EIGEN_DECOMPOSITIONS_H_
