// The steps of a phase on all samples as proposals inside ceres::Solve: of
// ceres_lm+newton/inverse/gauss_newton, the part after the plus.
#ifndef INVGRAD_METHODS_BATCH_PROPOSAL_H_
#define INVGRAD_METHODS_BATCH_PROPOSAL_H_

#include <memory>
#include <string>

#include "invgrad/data.h"
#include "invgrad/inverse_simulator.h"
#include "invgrad/method.h"
#include "invgrad/model.h"
#include "invgrad/proposal.h"

namespace invgrad {

// The proposal of a phase with a pull-back, for a problem with the parameter
// blocks WeightBlocks(model.network(), weights). Empty, with *error, if the
// pull-back cannot train the model.
ProposalFunction MakeBatchProposal(
    const Phase& phase,
    const Model& model,
    const DataSet& data,
    const double* weights,
    std::shared_ptr<const InverseSimulator> inverse,
    std::string* error);

}  // namespace invgrad

#endif  // INVGRAD_METHODS_BATCH_PROPOSAL_H_
