#include "problems/estimation/bzip2.h"

#include <random>
#include <string>

#include "gtest/gtest.h"
#include "tests/support/compress_bzip2.h"

namespace invgrad {
namespace bzip2_test {

// A failure leaves the result unchanged.
std::string DecompressionError(const std::string& bytes, size_t max_size) {
  std::string result = "sentinel";
  std::string error;
  EXPECT_FALSE(DecompressBzip2(bytes, max_size, &result, &error));
  EXPECT_EQ(result, "sentinel");
  return error;
}

TEST(Bzip2, GivesBackWhatWasCompressed) {
  std::mt19937 random(1);
  std::string noise(300000, '\0');
  for (char& c : noise) {
    c = static_cast<char>(random() % 256);
  }
  for (const std::string& bytes :
       {std::string(), std::string("a"), std::string(1 << 22, 'z'), noise}) {
    const std::string compressed = CompressBzip2(bytes);
    std::string result;
    std::string error;
    // The limit is the size itself: all of it fits, and no byte less would.
    ASSERT_TRUE(DecompressBzip2(compressed, bytes.size(), &result, &error))
        << error;
    EXPECT_EQ(result, bytes);
    if (!bytes.empty()) {
      EXPECT_EQ(DecompressionError(compressed, bytes.size() - 1),
                "the compressed text is too long; expected at most " +
                    std::to_string(bytes.size() - 1) + " bytes");
    }
    ASSERT_TRUE(DecompressBzip2(
        CompressBzip2("ab") + compressed, bytes.size() + 2, &result, &error))
        << error;
    EXPECT_EQ(result, "ab" + bytes);
  }
}

TEST(Bzip2, RefusesWhatIsNotWhole) {
  const std::string compressed = CompressBzip2("some text, some more text");
  for (size_t size = 0; size < compressed.size(); ++size) {
    EXPECT_EQ(DecompressionError(compressed.substr(0, size), 1000),
              "the compressed text is cut off; expected what bzip2 writes");
  }
}

TEST(Bzip2, RefusesWhatIsDamaged) {
  const std::string compressed = CompressBzip2("some text, some more text");
  const std::string damaged =
      "the compressed text is damaged; expected what bzip2 writes";
  EXPECT_EQ(DecompressionError("no bzip2", 1000), damaged);
  EXPECT_EQ(DecompressionError(compressed + "garbage", 1000), damaged);
  // Checksums find every change that changes the text.
  for (size_t i = 0; i < compressed.size(); ++i) {
    std::string changed = compressed;
    changed[i] = static_cast<char>(changed[i] ^ 0x10);
    std::string result;
    std::string error;
    if (DecompressBzip2(changed, 1000, &result, &error)) {
      EXPECT_EQ(result, "some text, some more text") << i;
    } else {
      EXPECT_NE(error, "") << i;
    }
  }
}

}  // namespace bzip2_test
}  // namespace invgrad
