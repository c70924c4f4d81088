// What a Jacobian also is if the ranks of a run share its rows, of which each
// rank knows its own (distributed/distributed_jacobian.h).
//
// All ranks must call the same functions. The Gram matrices in strips let each
// rank form and keep its own columns alone.
#ifndef INVGRAD_CORE_SHARED_JACOBIAN_H_
#define INVGRAD_CORE_SHARED_JACOBIAN_H_

#include "Eigen/Core"
#include "invgrad/core/column_strips.h"
#include "invgrad/internal/communicator.h"
#include "invgrad/jacobian_operator.h"

namespace invgrad {

class SharedJacobian {
 public:
  virtual ~SharedJacobian() = default;

  virtual const Communicator& communicator() const = 0;

  // JacobianOperator::Gram in this rank's columns alone: m x
  // strips.num_local().
  virtual void GramStrips(const ColumnStrips& strips,
                          Eigen::MatrixXd* JJt) const = 0;
  // ParameterGram likewise: n x strips.num_local().
  virtual void ParameterGramStrips(const ColumnStrips& strips,
                                   Eigen::MatrixXd* JtJ) const = 0;
};

// The interface of J; null: this process knows all rows.
inline const SharedJacobian* SharedRowsOf(const JacobianOperator& J) {
  return dynamic_cast<const SharedJacobian*>(&J);
}

// The ranks that share the rows of J, or null.
inline const Communicator* RanksOf(const JacobianOperator& J) {
  const SharedJacobian* const shared = SharedRowsOf(J);
  return shared == nullptr ? nullptr : &shared->communicator();
}

}  // namespace invgrad

#endif  // INVGRAD_CORE_SHARED_JACOBIAN_H_
