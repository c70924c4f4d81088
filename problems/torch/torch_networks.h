// The networks of libtorch, for the programs.
//
// They are loaded as a module on first use: a program that needs none of them
// starts without libtorch, which takes half a second.
#ifndef PROBLEMS_TORCH_TORCH_NETWORKS_H_
#define PROBLEMS_TORCH_TORCH_NETWORKS_H_

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "invgrad/network.h"
#include "invgrad/torch/u_net.h"

namespace invgrad {

struct TorchNetworks {
  decltype(&MakeUNet) make_u_net;
  // LoadTorchScript of torch_network.h, which includes libtorch.
  std::shared_ptr<const Network> (*load_torch_script)(
      const std::string& path,
      const std::vector<int64_t>& input_shape,
      bool double_precision,
      std::string* error);
};

// Whether invgrad was built with libtorch.
bool HasTorch();

// Null, with *error set, without libtorch or if the module cannot be loaded.
const TorchNetworks* LoadTorchNetworks(std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_TORCH_TORCH_NETWORKS_H_
