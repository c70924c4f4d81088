#include "bin/support/program.h"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <functional>
#include <iostream>
#include <limits>
#include <new>
#include <sstream>

#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/blas_threads.h"
#include "invgrad/core/blas_kernels.h"
#include "invgrad/core/specification.h"
#include "invgrad/io/atomic_file.h"
#include "invgrad/version.h"
#include "report/interrupt.h"

DECLARE_bool(helpshort);  // of gflags

namespace invgrad {
namespace {

bool is_silent = false;

// Whether bin/ or a folder in it defines the flag. The path is what the compiler
// was called with: absolute, relative or mapped.
bool IsOurs(const gflags::CommandLineFlagInfo& flag) {
  const std::filesystem::path folder =
      std::filesystem::path(flag.filename).parent_path();
  return folder.filename() == "bin" || folder.parent_path().filename() == "bin";
}

// An OptionSet has the number's syntax, range and messages.
template <typename Number>
bool ParseNumber(const char* name,
                 const std::string& text,
                 const Range& range,
                 Number* number,
                 std::string* error) {
  OptionSet set;
  set.Add(name, number, range, "");
  return set.Set(name, text, error);
}

// Defaults are allowed, whatever they are.
bool SetByFlag(const char* name, OptionSet* set, std::string* error) {
  const gflags::CommandLineFlagInfo flag =
      gflags::GetCommandLineFlagInfoOrDie(name);
  if (flag.current_value == flag.default_value ||
      set->Set(name, flag.current_value, error)) {
    return true;
  }
  *error = "--" + *error;
  return false;
}

constexpr int kBadInput = 1;

// gflags reads a flag file to its end.
bool CheckFlagFiles(const std::string& files, std::string* error) {
  constexpr std::uint64_t kMaxSize = 1 << 20;
  for (const std::string& file : SplitList(files)) {
    std::string text;
    if (!NameFlag("flagfile", ReadFile(file, &text, error, kMaxSize), error)) {
      return false;
    }
  }
  return true;
}

// Rejects what gflags would print as it is.
bool CheckArguments(int argc, char** argv, std::string* error) {
  constexpr size_t kMaxSize = 200;
  bool is_value = false;  // of the argument before, a flag without text
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool has_control_character =
        std::any_of(argument.begin(), argument.end(), [](unsigned char c) {
          return std::iscntrl(c) != 0 && c != '\n' && c != '\t';
        });
    const size_t begin = argument.find_first_not_of('-');
    const bool is_flag = begin == 1 || begin == 2;
    const size_t equals = std::min(argument.find('='), argument.size());
    const std::string name =
        is_flag ? argument.substr(begin, equals - begin) : "";
    gflags::CommandLineFlagInfo flag;
    const bool is_known = gflags::GetCommandLineFlagInfo(name.c_str(), &flag);
    const bool is_text = is_known && flag.type == "string";
    const bool is_short = argument.size() <= kMaxSize;
    if (name == "flagfile" &&
        !CheckFlagFiles(equals < argument.size() ? argument.substr(equals + 1)
                        : i + 1 < argc           ? argv[i + 1]
                                                 : "",
                        error)) {
      return false;
    }
    if (has_control_character) {
      *error = "has a control character";
    } else if (!is_short && (is_value || (is_flag && !is_text))) {
      *error = "is too long for a flag without text";
    } else {
      is_value = is_known && !is_text && flag.type != "bool" &&
                 equals == argument.size();
      continue;
    }
    *error = fmt::format("the argument '{}' {}", Printable(argument), *error);
    return false;
  }
  return true;
}

// Runs at the exit of the program, also at that of gflags' --help: output that
// is lost, as on a full device, is an error. (A reader that ends, as in
// "| head", ends the program by SIGPIPE, quietly.)
void CheckOutput() {
  std::cout.flush();
  if (std::cout.good() && std::fflush(stdout) == 0 &&
      std::ferror(stdout) == 0) {
    return;
  }
  const int reason = errno;
  if (reason != EPIPE) Warn("cannot write the output");
  _exit(kBadInput);
}

// Of a program whose results are written.
int ExitCode(const RunCounts& counts) {
  constexpr int kSomeFailed = 2, kNoneWorked = 3, kSignal = 128;
  if (Interrupt::IsRequested()) return kSignal + Interrupt::Signal();
  if (counts.num_failed == 0) return 0;
  if (counts.num_worked > 0) return kSomeFailed;
  Warn("no run worked");
  return kNoneWorked;
}

}  // namespace

void UseProcessorsKernels(char** argv) {
  const std::string old_kernels = OldBlasKernelsMessage();
  if (old_kernels.empty()) return;
  const std::string name = std::filesystem::path(argv[0]).filename();
  constexpr char kVariable[] = "OPENBLAS_CORETYPE";
  // Set by the user, or by UseProcessorsKernels before it restarted the
  // program.
  if (std::getenv(kVariable) != nullptr) {
    if (!is_silent) std::cerr << name << ": " << old_kernels << "\n";
    return;
  }
  const std::string better =
      BetterBlasKernels(ProcessorVectorUnits(), BlasKernels());
  const std::string notice = fmt::format(
      "{}: OpenBLAS chose its {} kernels, which are too old for this "
      "processor; starting again with {}={}\n",
      name,
      BlasKernels(),
      kVariable,
      better);
  if (!is_silent) std::cerr << notice;
  setenv(kVariable, better.c_str(), /*overwrite=*/1);
  execv("/proc/self/exe", argv);
  std::cerr << name << ": cannot start again. " << old_kernels << "\n";
}

int RunProgram(int argc,
               char** argv,
               const std::string& usage,
               bool (*run)(RunCounts* counts, std::string* error)) {
  UseProcessorsKernels(argv);
  SetBlasThreads(1);
  // By default glibc returns the memory of large arrays to the system, and
  // clears it again, at every step: a fifth of the time of a physics-informed
  // network, half of that of a U-net.
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, std::numeric_limits<int>::max());
  std::atexit(CheckOutput);
  FLAGS_logtostderr = true;
  // Ceres warns of every restart of nonlinear conjugate gradients.
  FLAGS_minloglevel = google::GLOG_ERROR;
  std::string error;
  gflags::SetArgv(argc, const_cast<const char**>(argv));  // for Warn
  if (!CheckArguments(argc, argv, &error)) {
    Warn(error);
    return kBadInput;
  }
  gflags::SetUsageMessage(
      usage +
      "\n\nExit codes: 0 all runs worked; 1 bad flags or input; 2 some runs "
      "failed; 3 none worked; 128 + n after signal n");
  gflags::SetVersionString(INVGRAD_VERSION);
  gflags::ParseCommandLineNonHelpFlags(&argc, &argv, true);
  if (FLAGS_helpshort) {
    // gflags' own help omits the flags of bin/support.
    fmt::print("{}: {}\n\n",
               gflags::ProgramInvocationShortName(),
               gflags::ProgramUsage());
    for (const gflags::CommandLineFlagInfo& flag : ProgramFlags()) {
      fmt::print("{}", gflags::DescribeOneFlag(flag));
    }
    return 1;  // as for gflags' other help
  }
  gflags::HandleCommandLineHelpFlags();
  google::InitGoogleLogging(argv[0]);
  RunCounts counts;
  if (argc > 1) {
    error = fmt::format("unexpected argument '{}'; every argument is a --flag",
                        Printable(argv[1]));
  } else {
    try {
      if (run(&counts, &error)) return ExitCode(counts);
    } catch (const std::bad_alloc&) {
      error = "there is not enough memory";
    } catch (const std::exception& exception) {
      error = exception.what();
    }
  }
  Warn(error);
  return kBadInput;
}

std::vector<gflags::CommandLineFlagInfo> ProgramFlags() {
  std::vector<gflags::CommandLineFlagInfo> flags;
  gflags::GetAllFlags(&flags);
  flags.erase(std::remove_if(flags.begin(), flags.end(), std::not_fn(IsOurs)),
              flags.end());
  return flags;
}

bool CheckFlags(const std::vector<std::pair<const char*, Range>>& ranges,
                std::string* error) {
  for (const auto& [name, range] : ranges) {
    double value = range.low;
    OptionSet set;
    set.Add(name, &value, range, "");
    if (!SetByFlag(name, &set, error)) return false;
  }
  return true;
}

bool CheckFlag(const char* name,
               const std::vector<std::string>& choices,
               std::string* error) {
  std::string choice = choices[0];
  OptionSet set;
  set.Add(name, &choice, choices, "");
  return SetByFlag(name, &set, error);
}

bool CheckNotGiven(const std::vector<std::string>& names,
                   const std::string& why,
                   std::string* error) {
  for (const std::string& name : names) {
    gflags::CommandLineFlagInfo flag;
    if (!gflags::GetCommandLineFlagInfo(name.c_str(), &flag) ||
        flag.current_value == flag.default_value) {
      continue;
    }
    *error =
        fmt::format("--{}={} {}", name, Printable(flag.current_value), why);
    return false;
  }
  return true;
}

bool NameFlag(const char* name, bool is_valid, std::string* error) {
  if (!is_valid) *error = fmt::format("--{}: {}", name, *error);
  return is_valid;
}

std::vector<std::string> SplitList(const std::string& list) {
  std::vector<std::string> items;
  std::istringstream stream(list);
  for (std::string item; std::getline(stream, item, ',');) {
    items.push_back(item);
  }
  return items;
}

bool ParseSeeds(const std::string& text,
                std::vector<int>* seeds,
                std::string* error) {
  constexpr long kMaxNumSeeds = 10000;
  const auto parse = [error](const std::string& item, int* seed) {
    const Range range{0.0, std::numeric_limits<int>::max()};
    *seed = 0;
    return ParseNumber("seed", item, range, seed, error);
  };
  seeds->clear();
  const std::vector<std::string> items = SplitList(text);
  for (size_t i = 0; i < items.size(); ++i) {
    std::string last_item = items[i];
    long step = 1;
    int last = 0;
    const size_t dots = items[i].find("..");
    const bool is_list =
        items[i] == "..." && i > 0 && i + 1 < items.size();  // "1,2,...,20"
    const bool is_range = dots != std::string::npos;
    if (is_list) {
      const size_t size = seeds->size();
      if (size > 1) step = long{seeds->back()} - (*seeds)[size - 2];
      last_item = items[++i];
    } else if (is_range) {
      if (!parse(items[i].substr(0, dots), &last)) return false;
      seeds->push_back(last);
      last_item = items[i].substr(dots + 2);
    }
    if (!parse(last_item, &last)) return false;
    if (!is_range) {
      seeds->push_back(last);
      continue;
    }
    const long length = long{last} - seeds->back();
    if (step <= 0 || length <= 0 || length % step != 0 ||
        length / step >= kMaxNumSeeds) {
      *error = fmt::format(
          "{} is no list; expected 1..20 or 1,2,...,20: ascending to the last "
          "one, at most {} seeds",
          Printable(text),
          kMaxNumSeeds);
      return false;
    }
    while (seeds->back() != last) {
      seeds->push_back(static_cast<int>(seeds->back() + step));
    }
  }
  std::vector<int> sorted = *seeds;
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end()) {
    *error = fmt::format("seed {} is given twice", *twice);
  } else if (seeds->empty()) {
    *error = "no seed is given";
  }
  return twice == sorted.end() && !seeds->empty();
}

bool ParseNumbers(const std::string& text,
                  std::vector<double>* numbers,
                  std::string* error) {
  numbers->clear();
  for (const std::string& item : SplitList(text)) {
    const Range range{0.0, std::numeric_limits<double>::infinity(), true};
    if (!ParseNumber(
            "number", item, range, &numbers->emplace_back(1.0), error)) {
      return false;
    }
  }
  return true;
}

std::string QuoteForShell(const std::string& word) {
  const bool is_plain =
      !word.empty() && std::all_of(word.begin(), word.end(), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
               std::string_view("_./:=,+-@%^").find(c) != std::string::npos;
      });
  if (is_plain) return word;
  std::string quoted = "'";
  for (const char c : word) {
    quoted += c == '\'' ? "'\\''" : c == '\n' ? " " : std::string(1, c);
  }
  return quoted + "'";
}

void SilenceMessages() { is_silent = true; }

void Warn(const std::string& message) {
  if (is_silent) return;
  // A message may have several lines; what it quotes may be anything, and long.
  constexpr size_t kMaxWord = 300;
  size_t word = 0;
  std::string shown;
  for (const char c : message) {
    const bool is_control = std::iscntrl(static_cast<unsigned char>(c)) != 0;
    word = c == ' ' || c == '\n' ? 0 : word + 1;
    if (word == kMaxWord) shown += "...";
    if (word >= kMaxWord) continue;
    shown += is_control && c != '\n' ? Printable({&c, 1}) : std::string(1, c);
  }
  // In one piece: mpirun may put what a rank prints between two pieces.
  std::cerr << fmt::format(
      "{}: {}\n", gflags::ProgramInvocationShortName(), shown);
}

}  // namespace invgrad
