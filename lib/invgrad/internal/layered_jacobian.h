// What a Jacobian also is if its columns fall into groups: the layers of a
// network, the parameter blocks of a ceres::Problem.
//
//   J = [J_1 J_2 .. J_L]
//
// Few rules use it: the layer rules, K-FAC, and the rule `determined`. They call
// the free functions below, which work with any Jacobian. A class that stands for
// another Jacobian (of fewer columns, of all ranks) implements the interface even
// if that one may have no groups.
#ifndef INVGRAD_INTERNAL_LAYERED_JACOBIAN_H_
#define INVGRAD_INTERNAL_LAYERED_JACOBIAN_H_

#include <memory>
#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/sampled_factors.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

class LayeredJacobian {
 public:
  virtual ~LayeredJacobian() = default;

  // The groups from the first to the last column; may be empty. The blocks may
  // refer to this operator, which must outlive them.
  virtual std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocks()
      const {
    return {};
  }

  // The layers of a network that FactorsAlong knows; may be empty.
  virtual std::vector<LayerColumns> FactorLayers() const { return {}; }
  // Their factors for the covector w (m). Only with FactorLayers.
  virtual void FactorsAlong(const Eigen::VectorXd& /*w*/,
                            SampledFactors* /*factors*/) const {}
};

// The interface of J; null: J has no groups of columns.
inline const LayeredJacobian* LayersOf(const JacobianOperator& J) {
  return dynamic_cast<const LayeredJacobian*>(&J);
}

// The groups of J's columns, or none.
inline std::vector<std::unique_ptr<const JacobianOperator>> ColumnBlocksOf(
    const JacobianOperator& J) {
  const LayeredJacobian* const layers = LayersOf(J);
  if (layers == nullptr) return {};
  return layers->ColumnBlocks();
}

// The layers whose factors FactorsAlong gives, or none.
inline std::vector<LayerColumns> FactorLayersOf(const JacobianOperator& J) {
  const LayeredJacobian* const layers = LayersOf(J);
  if (layers == nullptr) return {};
  return layers->FactorLayers();
}

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_LAYERED_JACOBIAN_H_
