// The networks of libtorch, for the programs.
//
// They are loaded as a module on first use: a program that needs none of them
// starts without libtorch, which takes half a second.
#ifndef PROBLEMS_TORCH_TORCH_NETWORKS_H_
#define PROBLEMS_TORCH_TORCH_NETWORKS_H_

#include <string>

#include "invgrad/torch/u_net.h"
#include "invgrad/torch_network.h"

namespace invgrad {

struct TorchNetworks {
  decltype(&MakeUNet) make_u_net;
  decltype(&LoadTorchScript) load_torch_script;
};

// Whether invgrad was built with libtorch.
bool HasTorch();

// Null, with *error set, without libtorch or if the module cannot be loaded.
const TorchNetworks* LoadTorchNetworks(std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_TORCH_TORCH_NETWORKS_H_
