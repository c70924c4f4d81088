// A U-net: convolutions on several resolutions with skip connections.
//
//   block(in, out): twice convolution 3x3, batch normalization, ReLU
//   down: block(in, F), then levels - 1 times 2x2 max pooling, block(F, F)
//   up:   levels - 1 times bilinear upsampling to the size of the skip,
//         (skip, upsampled), block(2 F, F)
//   out:  convolution 1x1, F -> out_channels
//
// Batch normalization uses the statistics of the batch at hand, always: a
// sample's output depends on the others of its batch.
//
// Shapes:  input: in_channels x rows x cols; output: out_channels x rows x
//          cols; each channel row by row. 37,697 weights for one channel, 4
//          levels and F = 16; 49,570 for two channels and 5 levels.
// Fails:   returns null, with *error set, if the grid is too small: each level
//          halves it, and the lowest must have a cell.
//
// Source: Holl, Koltun, Thuerey, NeurIPS 2022, arXiv 2109.15048, and its code:
//         u_net of PhiFlow 2 (phi/torch/nets.py). Versions of 2022 pad
//         periodically, later ones with zeros.
#ifndef INVGRAD_TORCH_U_NET_H_
#define INVGRAD_TORCH_U_NET_H_

#include <memory>
#include <string>

#include "invgrad/network.h"

namespace invgrad {

struct UNetOptions {
  int rows = 64;
  int cols = 64;
  int in_channels = 1;
  int out_channels = 1;
  int levels = 4;
  int filters = 16;  // F
  bool periodic = false;
  // Adds a constant to each channel of the output, so that its mean is that of
  // the input's channel; the numbers of channels must be equal.
  bool keeps_mean = false;
  bool double_precision = false;
};

std::shared_ptr<const Network> MakeUNet(const UNetOptions& options,
                                        std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_U_NET_H_
