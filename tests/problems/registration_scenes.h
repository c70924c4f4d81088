// What the tests of scans and of alignments share.
#ifndef INVGRAD_TESTS_PROBLEMS_REGISTRATION_SCENES_H_
#define INVGRAD_TESTS_PROBLEMS_REGISTRATION_SCENES_H_

#include <string>

#include "gtest/gtest.h"
#include "problems/registration/scan.h"

namespace invgrad {

inline const Scene& SceneOf(const char* name) {
  for (const Scene& scene : Scenes()) {
    if (scene.name == name) return scene;
  }
  ADD_FAILURE() << name;
  return Scenes()[0];
}

// Without noise and outliers.
inline ScanOptions Exact() {
  ScanOptions options;
  options.noise = 0.0;
  options.outliers = 0.0;
  return options;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_PROBLEMS_REGISTRATION_SCENES_H_
