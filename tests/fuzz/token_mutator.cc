// Half of what the fuzzers try is a text with one token changed. Bytes that
// libFuzzer changes anywhere rarely leave a text that is a file but for one
// number.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <random>
#include <string>

extern "C" size_t LLVMFuzzerMutate(std::uint8_t* bytes,
                                   size_t size,
                                   size_t max_size);

namespace {

constexpr const char* kTokens[] = {"-0.0",
                                   "nan",
                                   "-inf",
                                   "1e999",
                                   "-1e308",
                                   "5e-324",
                                   "+",
                                   "0",
                                   "1",
                                   "-1",
                                   "3",
                                   "2147483647",
                                   "2147483648",
                                   "9223372036854775807",
                                   "\n",
                                   "\r\n",
                                   "#",
                                   ""};
constexpr char kSpace[] = " \t\r\n";

struct Span {
  size_t begin;
  size_t size;
};

// Some token, or the text's end.
Span AnyToken(const std::string& text, std::mt19937* random) {
  const size_t begin = std::min(
      text.find_first_not_of(kSpace, (*random)() % text.size()), text.size());
  const size_t end = std::min(text.find_first_of(kSpace, begin), text.size());
  // The position may have been amid the token.
  const size_t space = text.find_last_of(kSpace, begin);
  const size_t first = space == std::string::npos ? 0 : space + 1;
  return {std::min(first, end), end - std::min(first, end)};
}

}  // namespace

extern "C" size_t LLVMFuzzerCustomMutator(std::uint8_t* bytes,
                                          size_t size,
                                          size_t max_size,
                                          unsigned seed) {
  std::mt19937 random(seed);
  if (size == 0 || random() % 2 == 0) {
    return LLVMFuzzerMutate(bytes, size, max_size);
  }
  std::string text(reinterpret_cast<const char*>(bytes), size);
  const Span token = AnyToken(text, &random);
  std::string replacement;
  switch (random() % 3) {
    case 0:
      replacement = kTokens[random() % std::size(kTokens)];
      break;
    case 1: {
      const Span other = AnyToken(text, &random);
      replacement = text.substr(other.begin, other.size);
      break;
    }
    default:
      replacement = "-" + text.substr(token.begin, token.size);
  }
  text.replace(token.begin, token.size, replacement);
  text.resize(std::min(text.size(), max_size));
  if (text.empty()) {
    return LLVMFuzzerMutate(bytes, size, max_size);
  }
  std::copy(text.begin(), text.end(), bytes);
  return text.size();
}
