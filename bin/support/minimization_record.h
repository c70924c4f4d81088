// A minimization that is over, in a file: a resumed program reads it, and the
// ranks of mpirun hand their runs to rank 0 by it.
//
//   NAME.run   a StateArchive (train/checkpoint.h), written when all other files
//              of the run are
//
// Minimizations take seconds, so that a run begins again that was interrupted.
//
// Fails:   reading, if the file is damaged or of another run; *error then names
//          it, and it stays as it is.
#ifndef BIN_SUPPORT_MINIMIZATION_RECORD_H_
#define BIN_SUPPORT_MINIMIZATION_RECORD_H_

#include <string>

#include "Eigen/Core"
#include "invgrad/minimize.h"
#include "invgrad/train/run_identity.h"

namespace invgrad {

struct MinimizationRecord {
  // Of an iteration: number, cost, seconds, and whether it was accepted.
  // Without proposals and without what lies outside of the domain.
  MinimizerSummary summary;
  std::string status;  // for tables
  bool has_failed = false;
  long num_evaluations = -1;  // of all residuals; -1: not counted
  // A column a point: the result, or all points with what is known of them.
  Eigen::MatrixXd points;
};

// Does nothing for a run that was interrupted. The options have its budget.
bool WriteRecord(const std::string& path,
                 const RunIdentity& identity,
                 const MinimizerOptions& budget,
                 MinimizationRecord record,
                 std::string* error);

// Whether the run is done. False with *error empty: it is not, or it ended by a
// budget that is now larger; *record is then unspecified.
bool ReadRecord(const std::string& path,
                const RunIdentity& identity,
                const MinimizerOptions& budget,
                MinimizationRecord* record,
                std::string* error);

}  // namespace invgrad

#endif  // BIN_SUPPORT_MINIMIZATION_RECORD_H_
