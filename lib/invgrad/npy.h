// Reads and writes numpy's .npy files: float64 arrays of one or two dimensions.
//
// Written as version 1.0, '<f8', and atomically (atomic_file.h). Reading
// accepts versions 1.0 to 3.0, '<f8' and '<f4', C and Fortran order.
//
// Memory:  the file and three copies of the array, after the header was compared
//          with the size of the file, the wanted shape and the available memory
//          (core/memory_limit.h).
// Fails:   returns false with a message that names the file and the found and
//          expected format; the output is then unchanged. Infinities and NaN
//          are valid values; CheckFinite (finite.h) finds them.
//
// Source: numpy/lib/format.py, "Format Version 1.0".
#ifndef INVGRAD_NPY_H_
#define INVGRAD_NPY_H_

#include <string>

#include "Eigen/Core"

namespace invgrad {

// A vector is written with one dimension, a matrix with two in C order.
bool WriteNpy(const std::string& path,
              const Eigen::VectorXd& vector,
              std::string* error);
bool WriteNpy(const std::string& path,
              const Eigen::MatrixXd& matrix,
              std::string* error);

// wanted_rows, wanted_cols: -1 accepts any size. A one-dimensional array is a
// column.
bool ReadNpy(const std::string& path,
             int wanted_rows,
             int wanted_cols,
             Eigen::MatrixXd* matrix,
             std::string* error);
// Accepts the shapes (n,) and (n, 1).
bool ReadNpy(const std::string& path,
             int wanted_size,
             Eigen::VectorXd* vector,
             std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_NPY_H_
