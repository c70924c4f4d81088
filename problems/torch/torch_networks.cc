#include "problems/torch/torch_networks.h"

#include <dlfcn.h>

namespace invgrad {

#ifdef INVGRAD_TORCH_MODULE

bool HasTorch() { return true; }

const TorchNetworks* LoadTorchNetworks(std::string* error) {
  // Never unloaded: networks refer to its code.
  static void* const module =
      dlopen(INVGRAD_TORCH_MODULE, RTLD_NOW | RTLD_LOCAL);
  using Function = const TorchNetworks* (*)();
  const auto function =
      module == nullptr
          ? nullptr
          : reinterpret_cast<Function>(dlsym(module, "InvgradTorchNetworks"));
  if (function == nullptr) {
    const char* const why = dlerror();
    *error = std::string("cannot load the networks of libtorch: ") +
             (why == nullptr ? INVGRAD_TORCH_MODULE : why);
    return nullptr;
  }
  return function();
}

#else

bool HasTorch() { return false; }

const TorchNetworks* LoadTorchNetworks(std::string* error) {
  *error =
      "this network needs libtorch, which was not found when invgrad was "
      "built: install it (on Debian: apt-get install libtorch-dev) and build "
      "again in a new folder";
  return nullptr;
}

#endif

}  // namespace invgrad
