// Gives the reader of problems/estimation/g2o_file.h any bytes.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>

#include "problems/estimation/g2o_file.h"
#include "tests/support/reader_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, size_t size) {
  constexpr invgrad::TextFormat<invgrad::PoseGraph> kFormat = {
      invgrad::ParseG2o, invgrad::G2oText};
  const std::string text(reinterpret_cast<const char*>(bytes), size);
  const std::string flaw = invgrad::FindReaderFlaw(kFormat, text);
  if (!flaw.empty()) {
    std::fprintf(stderr, "%s\n", flaw.c_str());
    __builtin_trap();
  }
  return 0;
}
