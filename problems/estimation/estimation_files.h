// Files as inputs of the program `estimate`: NIST's regressions, a user's
// formula on a table, bundle adjustments and pose graphs (estimation.h).
#ifndef PROBLEMS_ESTIMATION_ESTIMATION_FILES_H_
#define PROBLEMS_ESTIMATION_ESTIMATION_FILES_H_

namespace invgrad {

// At the beginning of main: EstimateMain then has flags for files, --input and
// others, and the method `chordal`.
void RegisterEstimationFiles();

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_ESTIMATION_FILES_H_
