// The version of invgrad, to compare or to print. CMakeLists.txt reads it from
// this file.
//
// Versions 0.x with the same x are compatible; from 1.0 on those with the same
// major version.
#ifndef INVGRAD_VERSION_H_
#define INVGRAD_VERSION_H_

#define INVGRAD_VERSION_MAJOR 0
#define INVGRAD_VERSION_MINOR 2
#define INVGRAD_VERSION_PATCH 0

// Two macros, so that the arguments are replaced by their numbers first.
#define INVGRAD_JOIN_AS_THEY_ARE(a, b, c) #a "." #b "." #c
#define INVGRAD_JOIN(a, b, c) INVGRAD_JOIN_AS_THEY_ARE(a, b, c)

// "0.2.0"
#define INVGRAD_VERSION \
  INVGRAD_JOIN(         \
      INVGRAD_VERSION_MAJOR, INVGRAD_VERSION_MINOR, INVGRAD_VERSION_PATCH)

#endif  // INVGRAD_VERSION_H_
