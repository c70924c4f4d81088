// Writes files atomically, and reads them.
//
// The bytes go to a temporary name in the same folder, are flushed to the disk
// and renamed to `path`: a reader, or a program that was killed, finds the old
// file or the new one. A symbolic link at `path` is replaced, not followed.
//
// Cost:    one write, one fsync.
// Fails:   returns false; *error names the file and the system's reason, the
//          temporary is removed and what was at `path` is untouched.
#ifndef INVGRAD_IO_ATOMIC_FILE_H_
#define INVGRAD_IO_ATOMIC_FILE_H_

#include <string>
#include <string_view>

namespace invgrad {

bool WriteFile(const std::string& path,
               std::string_view bytes,
               std::string* error);

// Regular files only: a folder or a device is an error. *bytes is unchanged on
// failure.
bool ReadFile(const std::string& path, std::string* bytes, std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_IO_ATOMIC_FILE_H_
