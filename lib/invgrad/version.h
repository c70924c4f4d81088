// The version of invgrad. CMakeLists.txt reads it from here.
#ifndef INVGRAD_VERSION_H_
#define INVGRAD_VERSION_H_

#define INVGRAD_VERSION "0.1.0"

#endif  // INVGRAD_VERSION_H_
