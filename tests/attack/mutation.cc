#include "tests/attack/mutation.h"

#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>

#include "glog/logging.h"

namespace invgrad {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string>& Tokens() {
  static const auto& tokens = *new std::vector<std::string>{
      "nan",
      "-inf",
      "1e999",
      "5e-324",
      "-0.0",
      "-1",
      "0",
      "2147483647",
      "2147483648",
      "999999999",
      "1000000000",
      "9223372036854775807",
      "18446744073709551615",
      "",
      "\n",
      "\r\n",
      ",",
      "\x1b[31m",
      "\xff",
      std::string(1, '\0'),
      std::string(5000, '9'),
      "{'shape': (",
  };
  return tokens;
}

void Mutate(std::string* bytes, Dice* dice) {
  const auto size = static_cast<int>(bytes->size());
  const int at = size > 0 ? dice->Below(size) : 0;
  switch (size > 0 ? dice->Below(7) : 6) {
    case 0:
      (*bytes)[at] = static_cast<char>((*bytes)[at] ^ (1 << dice->Below(8)));
      break;
    case 1:
      bytes->resize(at);
      break;
    case 2:
      bytes->erase(at, 1 + dice->Below(16));
      break;
    case 3:
      bytes->insert(at, bytes->substr(dice->Below(size), 1 + dice->Below(64)));
      break;
    case 4: {  // a number
      constexpr char kDigits[] = "0123456789+-.e";
      const size_t begin =
          std::min(bytes->find_first_of(kDigits, at), bytes->size());
      const size_t end =
          std::min(bytes->find_first_not_of(kDigits, begin), bytes->size());
      bytes->replace(begin, end - begin, dice->Pick(Tokens()));
      break;
    }
    case 5:
      (*bytes)[at] = static_cast<char>(dice->Below(256));
      break;
    default:
      bytes->insert(at, dice->Pick(Tokens()));
  }
}

}  // namespace

std::string Mutated(const std::string& bytes, Dice* dice) {
  std::string mutated = bytes;
  const int num_changes = 1 + dice->Below(4);
  for (int i = 0; i < num_changes || mutated == bytes; ++i) {
    Mutate(&mutated, dice);
  }
  return mutated;
}

std::string MakeStrange(const std::string& path, Dice* dice) {
  fs::remove_all(path);
  switch (dice->Below(5)) {
    case 0:
      CHECK_EQ(mkfifo(path.c_str(), 0600), 0);
      return "pipe";
    case 1:
      fs::create_directories(path + "/keep");
      return "folder";
    case 2:
      fs::create_symlink(fs::path(path).filename(), path);
      return "loop of links";
    case 3:
      fs::create_symlink("/dev/zero", path);
      return "link to /dev/zero";
    default: {
      std::ofstream file(path);
      file.close();
      constexpr std::uintmax_t kHuge = 6000000000;
      fs::resize_file(path, kHuge);
      return "6 GB of zeros";
    }
  }
}

}  // namespace invgrad
