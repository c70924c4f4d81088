// The layers of a network's Jacobian, for the rules with Kronecker factors.
#ifndef INVGRAD_RULES_KFAC_LAYERS_H_
#define INVGRAD_RULES_KFAC_LAYERS_H_

#include <memory>
#include <string>
#include <vector>

#include "invgrad/core/jacobian_operator.h"
#include "invgrad/core/layer_jacobian.h"

namespace invgrad {

// The column blocks of J as layers, which `blocks` own. Returns false, with
// *error, if there are none or others.
bool FindLayers(
    const std::vector<std::unique_ptr<const JacobianOperator>>& blocks,
    std::vector<const LayerJacobian*>* layers,
    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_RULES_KFAC_LAYERS_H_
