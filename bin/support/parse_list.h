// Comma-separated lists on a command line.
#ifndef BIN_SUPPORT_PARSE_LIST_H_
#define BIN_SUPPORT_PARSE_LIST_H_

#include <string>
#include <vector>

namespace invgrad {

// "1,2,5", "1..20" or "1,2,...,20": 1 to 10000 different integers from 0 to
// 2^31 - 1.
bool ParseSeeds(const std::string& text,
                std::vector<int>* seeds,
                std::string* error);

// "1e-3,1e-4": positive numbers; may be empty.
bool ParseNumbers(const std::string& text,
                  std::vector<double>* numbers,
                  std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_PARSE_LIST_H_
