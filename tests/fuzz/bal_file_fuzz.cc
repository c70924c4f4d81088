// Gives the reader of problems/estimation/bal_file.h any bytes, decompressed if
// they begin as bzip2's.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>

#include "problems/estimation/bal_file.h"
#include "problems/estimation/bzip2.h"
#include "tests/support/reader_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, size_t size) {
  constexpr invgrad::TextFormat<invgrad::BalData> kFormat = {invgrad::ParseBal,
                                                             invgrad::BalText};
  std::string text(reinterpret_cast<const char*>(bytes), size);
  if (text.compare(0, 3, "BZh") == 0) {
    constexpr size_t kMaxSize = 1 << 16;
    std::string error;
    invgrad::DecompressBzip2(text, kMaxSize, &text, &error);
  }
  const std::string flaw = invgrad::FindReaderFlaw(kFormat, text);
  if (!flaw.empty()) {
    std::fprintf(stderr, "%s\n", flaw.c_str());
    __builtin_trap();
  }
  return 0;
}
