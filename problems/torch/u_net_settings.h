// The options of a problem of fields whose network may be a U-net.
#ifndef PROBLEMS_TORCH_U_NET_SETTINGS_H_
#define PROBLEMS_TORCH_U_NET_SETTINGS_H_

#include <memory>
#include <string>

#include "invgrad/option_set.h"
#include "problems/torch/torch_networks.h"

namespace invgrad {

struct UNetSettings {
  std::string network = "dense";
  int levels = 4;
  int filters = 16;
  std::string padding = "periodic";

  void Describe(OptionSet* set) {
    set->Add("network",
             &network,
             {"dense", "u_net"},
             HasTorch() ? "u_net needs libtorch (u_net.h)"
                        : "u_net is not built: install libtorch (on Debian "
                          "libtorch-dev), and build again in a new folder");
    set->Add("levels", &levels, {1.0, 8.0}, "resolutions of the U-net");
    set->Add("filters", &filters, {1.0, 256.0}, "channels of the U-net");
    set->Add("padding",
             &padding,
             {"periodic", "zeros"},
             "of the U-net's convolutions");
  }

  bool is_chosen() const { return network == "u_net"; }

  // Adds the settings to the options. Returns null, with *error set, without
  // libtorch or if the U-net does not fit the grid.
  std::shared_ptr<const Network> Make(UNetOptions options,
                                      std::string* error) const {
    const TorchNetworks* const networks = LoadTorchNetworks(error);
    if (networks == nullptr) return nullptr;
    options.levels = levels;
    options.filters = filters;
    options.periodic = padding == "periodic";
    return networks->make_u_net(options, error);
  }
};

}  // namespace invgrad

#endif  // PROBLEMS_TORCH_U_NET_SETTINGS_H_
