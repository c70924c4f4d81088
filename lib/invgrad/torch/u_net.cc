#include "invgrad/torch/u_net.h"

#include <algorithm>
#include <vector>

#include "invgrad/torch/u_net_module.h"

namespace invgrad {
namespace {

using torch::Tensor;
namespace nn = torch::nn;

class ConvolutionBlock : public nn::Module {
 public:
  ConvolutionBlock(int in, int out, bool periodic) {
    for (const int channels : {in, out}) {
      nn::Conv2dOptions convolution(channels, out, 3);
      convolution.padding(1);
      if (periodic) convolution.padding_mode(torch::kCircular);
      layers_->push_back(nn::Conv2d(convolution));
      layers_->push_back(nn::BatchNorm2d(
          nn::BatchNorm2dOptions(out).track_running_stats(false)));
      layers_->push_back(nn::ReLU());
    }
    register_module("layers", layers_);
  }

  Tensor forward(const Tensor& x) { return layers_->forward(x); }

 private:
  nn::Sequential layers_;
};

class UNet : public nn::Module {
 public:
  explicit UNet(const UNetOptions& options)
      : keeps_mean_(options.keeps_mean),
        out_(nn::Conv2dOptions(options.filters, options.out_channels, 1)) {
    const int filters = options.filters;
    const auto block = [&](const std::string& name, int level, int in) {
      return register_module(
          name + std::to_string(level),
          std::make_shared<ConvolutionBlock>(in, filters, options.periodic));
    };
    for (int level = 0; level < options.levels; ++level) {
      down_.push_back(
          block("down", level, level == 0 ? options.in_channels : filters));
    }
    for (int level = options.levels - 2; level >= 0; --level) {
      up_.push_back(block("up", level, 2 * filters));
    }
    register_module("out", out_);
  }

  Tensor forward(const Tensor& input) {
    std::vector<Tensor> skips;
    Tensor x = down_[0]->forward(input);
    for (size_t level = 1; level < down_.size(); ++level) {
      skips.push_back(x);
      x = down_[level]->forward(torch::max_pool2d(x, 2));
    }
    for (const auto& up : up_) {
      const Tensor& skip = skips.back();
      const Tensor upsampled =
          torch::upsample_bilinear2d(x,
                                     {skip.size(2), skip.size(3)},
                                     /*align_corners=*/false);
      x = up->forward(torch::cat({skip, upsampled}, 1));
      skips.pop_back();
    }
    x = out_->forward(x);
    if (!keeps_mean_) return x;
    const auto mean = [](const Tensor& t) { return t.mean({2, 3}, true); };
    return x - mean(x) + mean(input);
  }

 private:
  bool keeps_mean_;
  std::vector<std::shared_ptr<ConvolutionBlock>> down_;
  std::vector<std::shared_ptr<ConvolutionBlock>> up_;  // from the lowest
  nn::Conv2d out_;
};

}  // namespace

TorchFunction MakeUNetFunction(const UNetOptions& options) {
  return FunctionOfModule(std::make_shared<UNet>(options));
}

std::shared_ptr<const Network> MakeUNet(const UNetOptions& options,
                                        std::string* error) {
  if (options.levels < 1 || options.levels > 30) {
    *error =
        "a U-net has 1 to 30 levels, found " + std::to_string(options.levels);
    return nullptr;
  }
  const int smallest = 1 << (options.levels - 1);
  if (std::min(options.rows, options.cols) < smallest) {
    *error = "a U-net of " + std::to_string(options.levels) +
             " levels needs at least " + std::to_string(smallest) +
             " cells a side, found " + std::to_string(options.rows) + " x " +
             std::to_string(options.cols);
    return nullptr;
  }
  if (options.keeps_mean && options.in_channels != options.out_channels) {
    *error = "keeps_mean needs as many output channels as input channels";
    return nullptr;
  }
  TorchNetworkOptions network;
  network.name = "U-net of " + std::to_string(options.levels) + " levels, " +
                 std::to_string(options.filters) + " filters, " +
                 (options.periodic ? "periodic" : "zero") + " padding" +
                 (options.keeps_mean ? ", mean kept" : "");
  network.input_shape = {options.in_channels, options.rows, options.cols};
  network.double_precision = options.double_precision;
  return MakeTorchNetwork(
      [options] { return MakeUNetFunction(options); }, network, error);
}

}  // namespace invgrad
