// The module that LoadTorchNetworks loads.
#include "invgrad/torch_network.h"
#include "problems/torch/torch_networks.h"

extern "C" const invgrad::TorchNetworks* InvgradTorchNetworks() {
  static constexpr invgrad::TorchNetworks kNetworks = {
      &invgrad::MakeUNet, &invgrad::LoadTorchScript};
  return &kNetworks;
}
