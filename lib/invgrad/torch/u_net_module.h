// The U-net of u_net.h as a function of libtorch.
#ifndef INVGRAD_TORCH_U_NET_MODULE_H_
#define INVGRAD_TORCH_U_NET_MODULE_H_

#include "invgrad/torch/u_net.h"
#include "invgrad/torch_network.h"

namespace invgrad {

// With new initial weights. The options must fit (MakeUNet).
TorchFunction MakeUNetFunction(const UNetOptions& options);

}  // namespace invgrad

#endif  // INVGRAD_TORCH_U_NET_MODULE_H_
