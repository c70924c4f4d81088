#include <filesystem>
#include <fstream>
#include <sstream>

#include "invgrad/torch/torch_message.h"
#include "invgrad/torch_network.h"
#include "torch/csrc/jit/api/module.h"
#include "torch/csrc/jit/runtime/graph_executor.h"
#include "torch/script.h"

namespace invgrad {

std::shared_ptr<const Network> LoadTorchScript(
    const std::string& path,
    const std::vector<int64_t>& input_shape,
    bool double_precision,
    std::string* error) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) {
    *error = path + ": there is no such file";
    return nullptr;
  }
  std::ostringstream bytes;
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  const auto load = [bytes = bytes.str()] {
    std::istringstream file(bytes);
    return torch::jit::load(file, torch::kCPU);
  };
  try {
    load();
  } catch (const std::exception& exception) {
    *error = path + ": not a TorchScript file, as module.save() writes it (" +
             TorchMessage(exception) + ")";
    return nullptr;
  }
  const auto make = [load] {
    // Not a copy, whose parameters would not be leaves of the graph.
    torch::jit::Module module = load();
    TorchFunction function;
    for (const auto& item : module.named_parameters()) {
      function.parameters.emplace_back(item.name, item.value);
    }
    for (const auto& item : module.named_buffers()) {
      function.buffers.emplace_back(item.name, item.value);
    }
    function.forward = [module](const torch::Tensor& input) mutable {
      // Optimized graphs have no forward-mode derivatives.
      const torch::jit::GraphOptimizerEnabledGuard guard(false);
      return module.forward({input}).toTensor();
    };
    return function;
  };
  TorchNetworkOptions options;
  options.name = "TorchScript";
  options.input_shape = input_shape;
  options.double_precision = double_precision;
  std::string why;
  auto network = MakeTorchNetwork(make, options, &why);
  if (network == nullptr) *error = path + ": " + why;
  return network;
}

}  // namespace invgrad
