// The layers of a network's Jacobian, for the rules with Kronecker factors, and
// random covectors for the factors of a Jacobian that is given by products.
#ifndef INVGRAD_RULES_KFAC_LAYERS_H_
#define INVGRAD_RULES_KFAC_LAYERS_H_

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/jacobian_operator.h"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/core/linearization.h"

namespace invgrad {

// The column blocks of J as layers, which `blocks` own. Returns false, with
// *error, if there are none or others.
bool FindLayers(
    const std::vector<std::unique_ptr<const JacobianOperator>>& blocks,
    std::vector<const LayerJacobian*>* layers,
    std::string* error);

// The linearization at this rank's samples, over whose layers the ranks sum, or
// all of it.
inline const Linearization& OwnPart(const Linearization& at_x) {
  return at_x.own != nullptr ? *at_x.own : at_x;
}

// *w = H_L^(1/2) z (m) for standard normal z, after np.random.seed(seed): a
// gradient of the loss at targets that are drawn from its Gauss-Newton model. The
// root is Lanczos' [1], exact if H_L has few distinct eigenvalues, which the
// squared norm has; negative eigenvalues count as zero.
//
// [1] Higham. Functions of Matrices. SIAM 2008, section 13.2.2.
void DrawCovector(const Linearization& at_x,
                  std::uint32_t seed,
                  Eigen::VectorXd* w);

}  // namespace invgrad

#endif  // INVGRAD_RULES_KFAC_LAYERS_H_
