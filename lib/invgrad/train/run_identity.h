// What determines a run, part by part: a run is resumed only by itself.
//
//   version: 0.2.0
//   BLAS kernels: Haswell
//   training data: 8c2f0e5d1a4b7733
//   method: adam
//   ...
//
// Arrays are digests (io/digest.h). The simulator and the loss are identified by
// their values at the initial weights, on the first samples. The budget is a
// part only if a rule of the method reads the progress of the run (a schedule).
//
// Cost:    about 1 ns a byte of the data, and an evaluation of four samples.
#ifndef INVGRAD_TRAIN_RUN_IDENTITY_H_
#define INVGRAD_TRAIN_RUN_IDENTITY_H_

#include <string>

#include "invgrad/data.h"
#include "invgrad/method.h"
#include "invgrad/model.h"

namespace invgrad {

struct TrainOptions;

class RunIdentity {
 public:
  // The version, the kernels and the threads of BLAS in this process.
  RunIdentity();

  // `value`: any text. Line breaks become spaces, a long text its digest.
  void Add(const std::string& name, const std::string& value);
  // source: null, or of the training samples.
  void AddData(const DataSet& train,
               const DataSet& test,
               const DataSource* source);
  // Call it for a method that depends on its budget.
  void AddBudget(const TrainOptions& options);

  // A line "name: value" a part.
  const std::string& text() const { return text_; }

  // The first part in which the run with this text differs, "method: adam, now
  // method: newton"; empty if there is none.
  std::string Difference(const std::string& text) const;

 private:
  std::string text_;
};

// The options must have initial weights, a batch size >= 0 and a budget.
RunIdentity IdentityOfRun(const Model& model,
                          const DataSet& train,
                          const DataSet& test,
                          const DataSource* source,
                          const Method& method,
                          const TrainOptions& options);

}  // namespace invgrad

#endif  // INVGRAD_TRAIN_RUN_IDENTITY_H_
