#include "bin/support/run_directory.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>
#include <vector>

#include "bin/support/output_options.h"
#include "bin/support/program.h"
#include "bin/support/versions.h"
#include "fmt/core.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

namespace fs = std::filesystem;

constexpr char kFlagFile[] = "flags.txt";
constexpr char kVersionFile[] = "versions.txt";
constexpr char kFileList[] = "files.txt";

// A resumed run may be longer than the first one, look at other levels or
// values, and use other numbers of processes and threads.
constexpr std::string_view kBudgetFlags[] = {
    "epochs", "steps", "seconds", "max_iterations"};
constexpr std::string_view kFlagsThatMayChange[] = {"output",
                                                    "checkpoint_seconds",
                                                    "levels",
                                                    "value",
                                                    "tail",
                                                    "threads",
                                                    "progress",
                                                    "plots"};

template <size_t kSize>
bool Contains(const std::string_view (&names)[kSize], const std::string& name) {
  return std::count(std::begin(names), std::end(names), name) > 0;
}

// The run that this process writes.
struct RunDirectory {
  std::string path;
  std::set<std::string> files;  // as in files.txt
};

RunDirectory& ThisRun() {
  static auto& run = *new RunDirectory;
  return run;
}

// What is in a directory, folders before the files in them.
struct Contents {
  std::set<std::string> listed;  // by its files.txt
  std::vector<fs::path> of_run;
  std::vector<fs::path> temporary;  // files of killed writers
  std::vector<fs::path> foreign;
};

bool FindContents(const fs::path& directory,
                  Contents* contents,
                  std::string* error) {
  std::set<std::string> files = {kFlagFile, kVersionFile, kFileList};
  const std::string list = directory / kFileList;
  std::string names;
  std::error_code failure;
  constexpr std::uint64_t kMaxSize = 1 << 26;
  if (fs::exists(list, failure) && !ReadFile(list, &names, error, kMaxSize)) {
    return false;
  }
  std::istringstream lines(names);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) contents->listed.insert(line);
  }
  files.insert(contents->listed.begin(), contents->listed.end());
  std::set<std::string> folders;
  for (const std::string& file : files) {
    for (fs::path folder = fs::path(file).parent_path(); !folder.empty();
         folder = folder.parent_path()) {
      folders.insert(folder);
    }
  }
  fs::recursive_directory_iterator entry(directory, failure);
  for (; !failure && entry != fs::recursive_directory_iterator();
       entry.increment(failure)) {
    const bool is_folder =  // a link is none
        entry->symlink_status(failure).type() == fs::file_type::directory;
    const std::string name = entry->path().lexically_relative(directory);
    // An empty folder is of a run that was killed before the first file in it.
    const bool is_known = (is_folder ? folders : files).count(name) > 0 ||
                          (is_folder && fs::is_empty(*entry, failure));
    if (!is_known) entry.disable_recursion_pending();
    const bool is_temporary =
        !is_folder && files.count(TargetOfTemporary(name)) > 0;
    (is_known       ? contents->of_run
     : is_temporary ? contents->temporary
                    : contents->foreign)
        .push_back(entry->path());
  }
  if (failure) *error = directory.string() + ": " + failure.message();
  return !failure;
}

bool Remove(const std::vector<fs::path>& paths, std::string* error) {
  std::error_code failure;
  for (const fs::path& path : paths) {
    if (!failure) fs::remove(path, failure);
    if (failure && error->empty()) {
      *error = path.string() + ": " + failure.message();
    }
  }
  return !failure;
}

std::string FirstLine() {
  return std::string("# invgrad ") + gflags::ProgramInvocationShortName();
}

// The flags of a flag file, and the lines of its comments.
std::map<std::string, std::string> ParseFlagText(const std::string& text,
                                                 std::string* comments) {
  std::map<std::string, std::string> flags;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const size_t equals = line.find('=');
    if (line.rfind("# ", 0) == 0) {
      *comments += line.substr(2) + '\n';
    } else if (line.rfind("--", 0) == 0 && equals != std::string::npos) {
      flags[line.substr(2, equals - 2)] = line.substr(equals + 1);
    }
  }
  return flags;
}

std::string CommentText(const std::string& text) {
  std::string comments;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    comments += "# " + line + '\n';
  }
  return comments;
}

// Reads flags.txt. Returns false if this program has not written it.
bool ReadFlagFile(const std::string& path,
                  std::string* text,
                  std::string* error) {
  const std::string first = FirstLine();
  constexpr std::uint64_t kMaxSize = 1 << 20;
  if (!ReadFile(path, text, error, kMaxSize)) {
    *error += "; is this the directory of a run?";
  } else if (text->rfind(first + '\n', 0) != 0) {
    *error = fmt::format(
        "{} is not of a run of this program: it does not begin with '{}'",
        path,
        first);
  } else {
    return true;
  }
  return false;
}

// Whether a run with these flags and this identity may go on.
bool IsSameRun(const std::string& flag_file,
               const RunIdentity& identity,
               const std::string& flags,
               std::string* error) {
  std::string text, identity_before, ignored;
  if (!ReadFlagFile(flag_file, &text, error)) return false;
  std::map<std::string, std::string> before =
      ParseFlagText(text, &identity_before);
  const auto fail = [&](const std::string& difference) {
    *error = fmt::format(
        "{}: {}; give another --output, or --overwrite", flag_file, difference);
    return false;
  };
  const auto limit = [](const std::string& value) {  // 0: none
    const double number = std::strtod(value.c_str(), nullptr);
    return number > 0.0 ? number : std::numeric_limits<double>::infinity();
  };
  for (const auto& [name, value] : ParseFlagText(flags, &ignored)) {
    if (before[name] == value || Contains(kFlagsThatMayChange, name)) continue;
    const bool is_budget = Contains(kBudgetFlags, name);
    if (is_budget && limit(value) >= limit(before[name])) continue;
    return fail(fmt::format(
        "the run to resume had --{0}={1}, now it is --{0}={2}{3}",
        name,
        before[name],
        value,
        !is_budget                        ? ""
        : std::isinf(limit(before[name])) ? ", a smaller budget: 0 is none"
                                          : ", a smaller budget"));
  }
  const std::string difference = identity.Difference(
      identity_before.substr(identity_before.find('\n') + 1));
  return difference.empty() ||
         fail("the run to resume is another one: " + difference);
}

// Whether --overwrite may remove the files of the run in the directory.
bool MayOverwrite(const std::string& path,
                  const Contents& contents,
                  std::string* error) {
  std::error_code failure;
  const fs::path directory = fs::canonical(path, failure);
  const fs::path here = fs::current_path(failure);
  std::string ignored;
  const auto refuse = [error](const std::string& why) {
    *error = fmt::format("--overwrite: {}; nothing is removed", why);
    return false;
  };
  if (std::mismatch(
          directory.begin(), directory.end(), here.begin(), here.end())
          .first == directory.end()) {
    return refuse(path + " is or contains the current directory");
  }
  if (!ReadFlagFile(path + '/' + kFlagFile, &ignored, error)) {
    return refuse(*error);
  }
  if (!contents.foreign.empty()) {
    return refuse(contents.foreign[0].string() +
                  " is not a file of the run there");
  }
  return true;
}

// Removes the files of a run, but for flags.txt and files.txt, which --overwrite
// needs if it is killed.
bool RemoveRun(const Contents& contents, std::string* error) {
  std::vector<fs::path> paths = contents.temporary;
  for (auto path = contents.of_run.rbegin(); path != contents.of_run.rend();
       ++path) {
    if (path->filename() != kFlagFile && path->filename() != kFileList) {
      paths.push_back(*path);
    }
  }
  // Without this file the others count as parts of a run that can be resumed.
  std::stable_partition(paths.begin(), paths.end(), [](const fs::path& path) {
    return path.filename() == "result.txt";
  });
  return Remove(paths, error);
}

// Whether the directory may be used or reused; removes an earlier run if
// necessary.
bool MakeRoom(const std::string& path,
              ExistingDirectory existing,
              const RunIdentity& identity,
              const std::string& flags,
              std::string* error) {
  std::error_code failure;
  if (!fs::exists(path, failure)) return true;
  Contents contents;
  if (!NameFlag("output", FindContents(path, &contents, error), error)) {
    return false;
  }
  gflags::CommandLineFlagInfo info;
  const bool has_resume = gflags::GetCommandLineFlagInfo("resume", &info);
  const bool is_empty = contents.of_run.empty() && contents.foreign.empty();
  if (!is_empty && existing == ExistingDirectory::kRefuse) {
    *error = fmt::format(
        "--output={} exists; give another directory, or --overwrite{}",
        path,
        has_resume ? ", or --resume to go on with its run" : "");
    return false;
  }
  if (!is_empty && existing == ExistingDirectory::kOverwrite) {
    return MayOverwrite(path, contents, error) && RemoveRun(contents, error);
  }
  if (!is_empty &&
      !NameFlag(has_resume ? "resume" : "output",
                IsSameRun(path + '/' + kFlagFile, identity, flags, error),
                error)) {
    return false;
  }
  ThisRun().files = contents.listed;
  return Remove(contents.temporary, error);
}

// One line a flag, except those that say what to do with the directory.
std::string FlagsOfRun() {
  constexpr std::string_view kNotOfRun[] = {
      "overwrite", "resume", "list_jobs", "job", "collect"};
  std::string flags;
  for (const gflags::CommandLineFlagInfo& flag : ProgramFlags()) {
    if (Contains(kNotOfRun, flag.name)) continue;
    std::string value = flag.current_value;
    std::replace(value.begin(), value.end(), '\n', ' ');
    flags += fmt::format("--{}={}\n", flag.name, value);
  }
  return flags;
}

}  // namespace

bool PrepareRunDirectory(const std::string& path,
                         ExistingDirectory existing,
                         const RunIdentity& identity,
                         const std::string& flags,
                         std::string* error) {
  error->clear();
  ThisRun() = {path, {}};
  if (!MakeRoom(path, existing, identity, flags, error)) return false;
  if (!NameFlag("output", MakeDirectories(path, error), error)) return false;
  std::string files;
  for (const std::string& file : ThisRun().files) files += file + '\n';
  const std::string directory = path + '/';
  // In this order: with the flags, --overwrite accepts the directory.
  return WriteFile(directory + kFlagFile,
                   FirstLine() + '\n' + CommentText(identity.text()) + flags,
                   error) &&
         WriteFile(directory + kFileList, files, error) &&
         WriteFile(directory + kVersionFile, VersionsText(), error);
}

bool PrepareRunDirectory(ExistingDirectory existing,
                         const RunIdentity& identity,
                         std::string* error) {
  if (Output().overwrite) existing = ExistingDirectory::kOverwrite;
  return PrepareRunDirectory(
      Output().output, existing, identity, FlagsOfRun(), error);
}

bool CheckResume(bool resume, std::string* error) {
  if (!resume || !Output().overwrite) return true;
  *error = "--resume=true is not allowed with --overwrite";
  return false;
}

bool JoinRunDirectory(const RunIdentity& identity, std::string* error) {
  const std::string& output = Output().output;
  Contents contents;
  if (!NameFlag(
          "output",
          FindContents(output, &contents, error) &&
              IsSameRun(
                  output + '/' + kFlagFile, identity, FlagsOfRun(), error),
          error)) {
    return false;
  }
  ThisRun() = {output, contents.listed};
  return true;
}

std::string InOutput(const std::string& name) {
  return Output().output + '/' + name;
}

bool ListRunFile(const std::string& path, std::string* error) {
  RunDirectory& run = ThisRun();
  const std::string directory = run.path + '/';
  if (run.path.empty() || path.rfind(directory, 0) != 0) return true;
  const std::string name = path.substr(directory.size());
  if (run.files.count(name) > 0) return true;
  const std::string list = directory + kFileList;
  std::ofstream file(list, std::ios::app);
  if (!(file << name << '\n' << std::flush)) {
    *error = fmt::format("cannot write {}: it cannot be listed in {}: {}",
                         path,
                         list,
                         std::generic_category().message(errno));
    return false;
  }
  run.files.insert(name);
  return true;
}

bool WriteRunFile(const std::string& path,
                  std::string_view bytes,
                  std::string* error) {
  return ListRunFile(path, error) && WriteFile(path, bytes, error);
}

bool MakeDirectories(const std::string& path, std::string* error) {
  std::error_code failure;
  fs::create_directories(path, failure);
  if (failure) *error = path + ": " + failure.message();
  return !failure;
}

}  // namespace invgrad
