#include "problems/estimation/bzip2.h"

#include <bzlib.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "fmt/core.h"

namespace invgrad {
namespace {

// Appends one stream of *bytes to *result and removes it from *bytes.
bool DecompressStream(std::string_view* bytes,
                      size_t max_size,
                      std::string* result,
                      std::string* error) {
  constexpr int kQuiet = 0;
  constexpr int kFast = 0;
  constexpr size_t kMinRoom = 1 << 16;
  constexpr size_t kMaxUnsigned = std::numeric_limits<unsigned>::max();
  bz_stream stream = {};
  int code = BZ2_bzDecompressInit(&stream, kQuiet, kFast);
  bool has_advanced = true;
  while (code == BZ_OK && has_advanced && result->size() <= max_size) {
    const size_t old_size = result->size();
    // One byte more than allowed, to detect a text that is too long.
    const size_t room = std::min(
        {std::max(old_size, kMinRoom), max_size + 1 - old_size, kMaxUnsigned});
    const size_t size = std::min(bytes->size(), kMaxUnsigned);
    result->resize(old_size + room);
    stream.next_in = const_cast<char*>(bytes->data());  // is not written
    stream.avail_in = static_cast<unsigned>(size);
    stream.next_out = result->data() + old_size;
    stream.avail_out = static_cast<unsigned>(room);
    code = BZ2_bzDecompress(&stream);
    has_advanced = stream.avail_in < size || stream.avail_out < room;
    bytes->remove_prefix(size - stream.avail_in);
    result->resize(old_size + room - stream.avail_out);
  }
  BZ2_bzDecompressEnd(&stream);
  if (result->size() > max_size) {
    *error = fmt::format(
        "the compressed text is too long; expected at most {} bytes", max_size);
  } else if (code == BZ_STREAM_END) {
    return true;
  } else if (code == BZ_MEM_ERROR) {
    *error = "there is no memory to decompress the text";
  } else {
    *error =
        fmt::format("the compressed text is {}; expected what bzip2 writes",
                    code == BZ_OK ? "cut off" : "damaged");
  }
  return false;
}

}  // namespace

bool DecompressBzip2(std::string_view bytes,
                     size_t max_size,
                     std::string* result,
                     std::string* error) {
  std::string text;
  do {
    if (!DecompressStream(&bytes, max_size, &text, error)) return false;
  } while (!bytes.empty());
  *result = std::move(text);
  return true;
}

}  // namespace invgrad
