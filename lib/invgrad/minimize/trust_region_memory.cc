#include "invgrad/minimize/trust_region_memory.h"

namespace invgrad {

std::vector<MemoryPart> TrustRegionMemory(ceres::LinearSolverType solver,
                                          double rows,
                                          double cols) {
  // Ours, Ceres' own, and the one from which that is assembled or in which it
  // is factorized.
  std::vector<MemoryPart> parts = {{"J", sizeof(double) * 3.0 * rows * cols}};
  if (solver != ceres::CGNR) {
    parts.push_back({"normal equations", sizeof(double) * cols * cols});
  }
  return parts;
}

}  // namespace invgrad
