#include "problems/estimation/bzip2.h"

#include <bzlib.h>

#include <algorithm>
#include <limits>
#include <utility>

namespace invgrad {
namespace {

constexpr size_t kMaxUnsigned = std::numeric_limits<unsigned>::max();
constexpr int kQuiet = 0;

// Ends the stream whatever happens.
class Decompressor {
 public:
  Decompressor() {
    constexpr int kFast = 0;
    is_open_ = BZ2_bzDecompressInit(&stream_, kQuiet, kFast) == BZ_OK;
  }
  Decompressor(const Decompressor&) = delete;
  Decompressor& operator=(const Decompressor&) = delete;
  ~Decompressor() {
    if (is_open_) {
      BZ2_bzDecompressEnd(&stream_);
    }
  }

  // Takes from *bytes, appends to *result (to at most max_size) and returns
  // libbz2's code.
  int Advance(std::string_view* bytes, size_t max_size, std::string* result) {
    if (!is_open_) {
      return BZ_MEM_ERROR;
    }
    constexpr size_t kMinRoom = 1 << 16;
    const size_t old_size = result->size();
    const size_t room = std::min(
        {std::max(old_size, kMinRoom), max_size - old_size, kMaxUnsigned});
    result->resize(old_size + room);
    const size_t size = std::min(bytes->size(), kMaxUnsigned);
    stream_.next_in = const_cast<char*>(bytes->data());  // libbz2 only reads
    stream_.avail_in = static_cast<unsigned>(size);
    stream_.next_out = result->data() + old_size;
    stream_.avail_out = static_cast<unsigned>(room);
    const int code = BZ2_bzDecompress(&stream_);
    bytes->remove_prefix(size - stream_.avail_in);
    result->resize(old_size + room - stream_.avail_out);
    return code;
  }

 private:
  bz_stream stream_ = {};
  bool is_open_ = false;
};

// Appends one stream of *bytes to *result.
bool DecompressStream(std::string_view* bytes,
                      size_t max_size,
                      std::string* result,
                      std::string* error) {
  Decompressor decompressor;
  while (true) {
    const size_t old_size = result->size();
    const size_t old_left = bytes->size();
    // One byte more tells a text that is too long from one that just fits.
    const int code = decompressor.Advance(bytes, max_size + 1, result);
    if (result->size() > max_size) {
      *error = "the compressed text is too long; expected at most " +
               std::to_string(max_size) + " bytes";
      return false;
    }
    if (code == BZ_STREAM_END) {
      return true;
    }
    if (code == BZ_MEM_ERROR) {
      *error = "there is no memory to decompress the text";
      return false;
    }
    if (code != BZ_OK) {
      *error = "the compressed text is damaged; expected what bzip2 writes";
      return false;
    }
    if (result->size() == old_size && bytes->size() == old_left) {
      *error = "the compressed text is cut off; expected what bzip2 writes";
      return false;
    }
  }
}

}  // namespace

bool CompressBzip2(std::string_view bytes,
                   std::string* result,
                   std::string* error) {
  // What libbz2 says suffices for bytes that cannot be compressed.
  const size_t room = bytes.size() + bytes.size() / 100 + 601;
  if (room > kMaxUnsigned) {
    *error = "the text is too long to be compressed";
    return false;
  }
  std::string compressed(room, '\0');
  unsigned size = static_cast<unsigned>(room);
  constexpr int kLargestBlocks = 9;
  constexpr int kDefaultWork = 0;
  const int code = BZ2_bzBuffToBuffCompress(compressed.data(),
                                            &size,
                                            const_cast<char*>(bytes.data()),
                                            static_cast<unsigned>(bytes.size()),
                                            kLargestBlocks,
                                            kQuiet,
                                            kDefaultWork);
  if (code != BZ_OK) {
    *error = "there is no memory to compress the text";
    return false;
  }
  compressed.resize(size);
  *result = std::move(compressed);
  return true;
}

bool DecompressBzip2(std::string_view bytes,
                     size_t max_size,
                     std::string* result,
                     std::string* error) {
  std::string text;
  do {
    if (!DecompressStream(&bytes, max_size, &text, error)) {
      return false;
    }
  } while (!bytes.empty());
  *result = std::move(text);
  return true;
}

}  // namespace invgrad
