// Networks of libtorch from a list of layers, for tests.
#ifndef INVGRAD_TESTS_TORCH_SEQUENTIAL_NETWORK_H_
#define INVGRAD_TESTS_TORCH_SEQUENTIAL_NETWORK_H_

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "invgrad/torch_network.h"

namespace invgrad {

inline std::shared_ptr<const Network> MakeSequential(
    const torch::nn::Sequential& module,
    std::vector<int64_t> input_shape,
    bool double_precision = true) {
  TorchNetworkOptions options;
  options.name = "test";
  options.input_shape = std::move(input_shape);
  options.double_precision = double_precision;
  std::string error;
  auto network = MakeTorchNetwork(
      [module] {
        return FunctionOfModule(
            std::dynamic_pointer_cast<torch::nn::SequentialImpl>(
                module->clone()));
      },
      options,
      &error);
  EXPECT_NE(network, nullptr) << error;
  return network;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_TORCH_SEQUENTIAL_NETWORK_H_
