// A network's pass for the time of a function; a dense network's reuses the
// thread's memory.
#ifndef INVGRAD_CHAIN_SCOPED_PASS_H_
#define INVGRAD_CHAIN_SCOPED_PASS_H_

#include <memory>

#include "invgrad/internal/scratch.h"
#include "invgrad/model.h"

namespace invgrad {

class ScopedPass {
 public:
  explicit ScopedPass(const Model& model)
      : dense_(model.dense_network() == nullptr ? 0 : 1) {
    if (dense_.size() == 0) other_ = model.network().NewPass();
  }

  Network::Pass* get() { return other_ == nullptr ? &dense_[0] : other_.get(); }
  Network::Pass& operator*() { return *get(); }

 private:
  Scratch<DenseNetwork::Activations> dense_;
  std::unique_ptr<Network::Pass> other_;
};

}  // namespace invgrad

#endif  // INVGRAD_CHAIN_SCOPED_PASS_H_
