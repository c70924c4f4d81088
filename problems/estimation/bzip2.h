// Decompresses bzip2 data, also from untrusted sources.
//
// Cost:    linear in the size of the result. Allocates at most twice the size
//          of the decompressed data, and at most `max_size`.
// Fails:   returns false, with the reason in *error (truncated, damaged, larger
//          than max_size); *result is unchanged.
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
