// A stream of fresh samples: each step has new ones, which are made and not
// stored.
//
// The samples are a function of the step, so that all methods train on the same
// stream and a resumed run continues it.
#ifndef INVGRAD_CHAIN_DATA_SOURCE_H_
#define INVGRAD_CHAIN_DATA_SOURCE_H_

#include <string>

#include "invgrad/chain/data_set.h"

namespace invgrad {

class DataSource {
 public:
  virtual ~DataSource() = default;

  // The samples of step k = 0, 1, ...
  virtual DataSet Batch(long step, int batch_size) const = 0;

  // What determines the stream, to recognize a run: "heat, seed 0".
  virtual std::string Name() const = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_DATA_SOURCE_H_
