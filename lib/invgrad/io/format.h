// Numbers as short text for people.
#ifndef INVGRAD_IO_FORMAT_H_
#define INVGRAD_IO_FORMAT_H_

#include <string>

namespace invgrad {

// With `digits` significant digits, as short as that allows: "0.25", "1234",
// "3.1e-07", "inf", "nan".
std::string FormatNumber(double value, int digits = 4);

}  // namespace invgrad

#endif  // INVGRAD_IO_FORMAT_H_
