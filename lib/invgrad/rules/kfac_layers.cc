#include "invgrad/rules/kfac_layers.h"

namespace invgrad {

bool FindLayers(
    const std::vector<std::unique_ptr<const JacobianOperator>>& blocks,
    std::vector<const LayerJacobian*>* layers,
    std::string* error) {
  layers->clear();
  for (const auto& block : blocks) {
    layers->push_back(dynamic_cast<const LayerJacobian*>(block.get()));
    if (layers->back() == nullptr) break;
  }
  if (!layers->empty() && layers->back() != nullptr) return true;
  *error =
      "K-FAC needs the Jacobian of a network's layers, which this problem "
      "does not have; half_inverse and layer_half_inverse work with any "
      "Jacobian";
  return false;
}

}  // namespace invgrad
