// Writes files atomically, and reads them.
//
// The bytes go to a temporary name in the same folder, are flushed to the disk
// and renamed to `path`: after a crash, and for any reader, the file has either
// its old or its new content. A symbolic link at `path` is replaced, not
// followed.
//
// Cost:    one write, one fsync.
// Fails:   returns false; *error names the file and the system's reason, the
//          temporary file is removed, and `path` is unchanged.
#ifndef INVGRAD_IO_ATOMIC_FILE_H_
#define INVGRAD_IO_ATOMIC_FILE_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace invgrad {

bool WriteFile(const std::string& path,
               std::string_view bytes,
               std::string* error);
// One part after the other.
bool WriteFile(const std::string& path,
               const std::vector<std::string_view>& parts,
               std::string* error);

// The path that a file was to be renamed to, if its name is that of a temporary
// file of WriteFile: a killed program leaves one. Empty for other names.
std::string TargetOfTemporary(const std::string& temporary);

// Regular files only: a folder, a pipe or a device is an error, and so is a file
// of more than `max_size` bytes or of more than the available memory
// (core/memory_limit.h), before it is read. *bytes is unchanged on failure.
bool ReadFile(const std::string& path,
              std::string* bytes,
              std::string* error,
              std::uint64_t max_size = UINT64_MAX);

// Reads only the beginning, at most `max_size` bytes. *file_size: of the file.
bool ReadBeginning(const std::string& path,
                   std::uint64_t max_size,
                   std::string* bytes,
                   std::uint64_t* file_size,
                   std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_IO_ATOMIC_FILE_H_
