// The Kronecker factors of the curvature of a network's layers, for kfac_rule.cc.
//
//   J_l^T M J_l ~ A (x) D,   A = 1/N sum_s a_s a_s^T
//   D = sum_s sum_jk delta_{s,j} M_{sj,sk} delta_{s,k}^T
//
// a_s and delta_{s,j} are the factors of layer_jacobian.h, N the number of a_s. M
// is the metric of the outputs: the identity, or the Hessian of the loss. A
// Jacobian that is given by products (a network of libtorch, or a simulator of
// fields) has sampled factors for a random covector w (sampled_factors.h):
//
//   D = sum_t delta_t delta_t^T,   w ~ N(0, M),
//
// whose mean over w is the D above.
//
// Shapes:  A: fan_in x fan_in;  D: fan_out x fan_out;  w: m.
// Cost:    B sum (fan_in^2 + |y| fan_out^2) and O(sum fan_in^3 + fan_out^3); with
//          the Hessian, fan_out products with it a layer. Ranks share the B
//          samples and the eigenproblems, and send about 3 sum (fan_in^2 +
//          fan_out^2) numbers. Sampled: one product with J^T, and N (fan_in^2 +
//          fan_out^2) a layer, where N also counts the cells.
// Fails:   returns false, with *error, if J has no layers, if w or J^T w is not
//          finite, or if eigenvalues do not converge.
#ifndef INVGRAD_RULES_KFAC_FACTORS_H_
#define INVGRAD_RULES_KFAC_FACTORS_H_

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/core/layer_jacobian.h"
#include "invgrad/internal/sampled_factors.h"
#include "invgrad/jacobian_operator.h"
#include "invgrad/linearization.h"

namespace invgrad {

// unit^2 / count K,   K = U diag(values) U^T
struct KfacFactor {
  Eigen::MatrixXd U;  // before the decomposition the lower triangle of K
  Eigen::VectorXd values;
  double unit = 1.0;
  double count = 1.0;

  // Makes unit and count 1.
  void TakeUnits();
  double mean_value() const {
    return unit * (unit * values.sum() / count / values.size());
  }
};

struct KfacCurvature {
  // A and D of layer l are factors 2 l and 2 l + 1.
  std::vector<KfacFactor> factors;
  // Sampled: (J^T w)_i^2 in the columns that belong to no layer; else empty.
  Eigen::VectorXd others;

  // All zero, of the right sizes.
  KfacCurvature(const std::vector<LayerColumns>& layers,
                Eigen::Index num_others);
  KfacCurvature() = default;
};

// The column blocks of J as layers, which `blocks` own. Returns false, with
// *error, if there are none or others.
bool FindLayers(
    const std::vector<std::unique_ptr<const JacobianOperator>>& blocks,
    std::vector<const LayerJacobian*>* layers,
    std::string* error);

// The columns of J of layers side by side.
std::vector<LayerColumns> ColumnsOf(
    const std::vector<const LayerJacobian*>& layers);

// The linearization at this rank's samples, over whose layers the ranks sum, or
// all of it.
inline const Linearization& OwnPart(const Linearization& at_x) {
  return at_x.own != nullptr ? *at_x.own : at_x;
}

// M is the Hessian of the loss, with `of_loss`, or the identity.
void SumFactors(const Linearization& at_x,
                const std::vector<const LayerJacobian*>& layers,
                bool of_loss,
                KfacCurvature* curvature);
// w is drawn after np.random.seed(seed).
bool SampleFactors(const Linearization& at_x,
                   bool of_loss,
                   std::uint32_t seed,
                   KfacCurvature* curvature,
                   std::string* error);

// K = U diag(values) U^T of all factors, which the ranks decompose in turn.
bool DecomposeFactors(const Communicator* ranks,
                      KfacCurvature* curvature,
                      std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_RULES_KFAC_FACTORS_H_
