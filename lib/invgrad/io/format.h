// Numbers and durations as short text for people.
#ifndef INVGRAD_IO_FORMAT_H_
#define INVGRAD_IO_FORMAT_H_

#include <string>

namespace invgrad {

// "0.250 s", "12.3 s", "3 min 05 s", "2 h 03 min", "4 d 07 h"; "?" for values
// that are no duration.
std::string FormatDuration(double seconds);

// With `digits` significant digits, as short as that allows: "0.25", "1234",
// "3.1e-07", "inf", "nan".
std::string FormatNumber(double value, int digits = 4);

}  // namespace invgrad

#endif  // INVGRAD_IO_FORMAT_H_
