// The module that LoadTorchNetworks loads.
#include <malloc.h>

#include "problems/torch/torch_networks.h"

extern "C" const invgrad::TorchNetworks* InvgradTorchNetworks() {
  // By default glibc returns the memory of large tensors to the system, and
  // clears it again, at every step: half of the time of a U-net.
  mallopt(M_MMAP_MAX, 0);
  mallopt(M_TRIM_THRESHOLD, 0x7fffffff);
  static constexpr invgrad::TorchNetworks kNetworks = {
      &invgrad::MakeUNet, &invgrad::LoadTorchScript};
  return &kNetworks;
}
