// Values and bounds of named parameters, as options give them.
//
//   b1=1,b2=0.5          values
//   b1=0..10,b2=0..      bounds; a side may be left out
//
// Fails:   returns false, with *error set, if an item has another form, a name
//          is unknown or twice there, or a number is not finite; for values also
//          if a parameter has none, for bounds if they are not in order, or a
//          start is not between them.
#ifndef PROBLEMS_ESTIMATION_NAMED_VALUES_H_
#define PROBLEMS_ESTIMATION_NAMED_VALUES_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

// `columns`: their names, for the message that a name may be a misspelled one.
bool ReadStartValues(const std::string& text,
                     const std::vector<std::string>& names,
                     const std::string& columns,
                     double* values,
                     std::string* error);

// `starts`: one a column.
bool ReadBounds(const std::string& text,
                const std::vector<std::string>& names,
                const Eigen::MatrixXd& starts,
                Eigen::VectorXd* lower,
                Eigen::VectorXd* upper,
                std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_NAMED_VALUES_H_
