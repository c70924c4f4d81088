// A network from a TorchScript file, which torch.jit.script or torch.jit.trace
// and save have written elsewhere.
//
// Its initial weights are those in the file, for every seed. Buffers must not
// change in a forward pass: export after eval(), or use batch normalization
// with track_running_stats=False.
#ifndef INVGRAD_TORCH_TORCH_SCRIPT_H_
#define INVGRAD_TORCH_TORCH_SCRIPT_H_

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "invgrad/network.h"

namespace invgrad {

// input_shape: of a sample, as the module takes it: {channels, rows, cols}.
// Returns null, with *error set ("file: ..."), if the file is no TorchScript,
// or the module does not fit.
std::shared_ptr<const Network> LoadTorchScript(
    const std::string& path,
    const std::vector<int64_t>& input_shape,
    bool double_precision,
    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_SCRIPT_H_
