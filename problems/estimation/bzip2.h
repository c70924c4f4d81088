// Decompresses what bzip2 wrote. The bytes need not be trusted.
//
// Cost:    linear in the size of the result. Never allocates more than twice
//          what has been decompressed, nor more than `max_size`.
// Fails:   returns false; *error says what is wrong with the bytes (cut off,
//          damaged, more than max_size), *result is unchanged.
#ifndef PROBLEMS_ESTIMATION_BZIP2_H_
#define PROBLEMS_ESTIMATION_BZIP2_H_

#include <cstddef>
#include <string>
#include <string_view>

namespace invgrad {

// Accepts several streams in succession, as pbzip2 writes them.
bool DecompressBzip2(std::string_view bytes,
                     size_t max_size,
                     std::string* result,
                     std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_BZIP2_H_
