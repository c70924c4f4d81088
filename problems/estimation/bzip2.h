// Compresses bytes as bzip2 does, and decompresses them without trusting them.
//
// Cost:    of decompression: linear in the size of the result, which is never
//          allocated beyond twice of what has come out, nor beyond `max_size`.
// Fails:   returns false; *error says what is wrong with the bytes (cut off,
//          damaged, more than max_size), *result is unchanged.
#ifndef PROBLEMS_ESTIMATION_BZIP2_H_
#define PROBLEMS_ESTIMATION_BZIP2_H_

#include <cstddef>
#include <string>
#include <string_view>

namespace invgrad {

// At most 2^32 - 1 bytes.
bool CompressBzip2(std::string_view bytes,
                   std::string* result,
                   std::string* error);

// Takes several streams, one behind the other, as pbzip2 writes them.
bool DecompressBzip2(std::string_view bytes,
                     size_t max_size,
                     std::string* result,
                     std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_BZIP2_H_
