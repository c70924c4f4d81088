// Compressed texts for tests of readers.
#ifndef INVGRAD_TESTS_COMPRESS_BZIP2_H_
#define INVGRAD_TESTS_COMPRESS_BZIP2_H_

#include <bzlib.h>

#include <string>

#include "glog/logging.h"

namespace invgrad {

// What the program bzip2 writes.
inline std::string CompressBzip2(std::string bytes) {
  // A size that libbz2 guarantees to suffice.
  auto size = static_cast<unsigned>(bytes.size() + bytes.size() / 100 + 601);
  std::string result(size, '\0');
  CHECK_EQ(BZ2_bzBuffToBuffCompress(result.data(),
                                    &size,
                                    bytes.data(),
                                    static_cast<unsigned>(bytes.size()),
                                    /*blockSize100k=*/9,
                                    /*verbosity=*/0,
                                    /*workFactor=*/0),
           BZ_OK);
  result.resize(size);
  return result;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_COMPRESS_BZIP2_H_
