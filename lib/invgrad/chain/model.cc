#include "invgrad/model.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "invgrad/chain/sample_error.h"
#include "invgrad/chain/scoped_pass.h"
#include "invgrad/chain/weights_network.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/parallel.h"
#include "invgrad/internal/scratch.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The number of samples predicted at a time, so that their activations stay in
// the cache.
constexpr int kPieceSize = 512;

constexpr char kNetworkFailed[] = "the network's output is not finite";
constexpr char kLoopFailed[] = "the closed loop has no finite derivative";
constexpr char kNoNextState[] =
    "the simulator has no finite value: there is no finite state after";

bool CheckOutputs(const Network::Pass& pass,
                  const DataSet& batch,
                  std::string* error) {
  const MatrixXd& outputs = pass.outputs;
  if (outputs.allFinite()) return true;
  int column = 0;
  while (outputs.col(column).allFinite()) ++column;
  return SampleError(batch, column / pass.num_channels, kNetworkFailed, error);
}

// Copies the activations of call t, one column per sample, into the activations
// of all calls.
void StoreCall(const DenseNetwork::Activations& call,
               int t,
               int num_calls,
               DenseNetwork::Activations* all) {
  const auto store = [t, num_calls](const MatrixXd& from, MatrixXd* to) {
    to->resize(from.rows(), from.cols() * num_calls);  // keeps memory of the
                                                       // right size
    Eigen::Map<MatrixXd, 0, Eigen::OuterStride<>>(
        to->data() + t * from.rows(),
        from.rows(),
        from.cols(),
        Eigen::OuterStride<>(num_calls * from.rows())) = from;
  };
  const auto store_layers = [&store](const std::vector<MatrixXd>& from,
                                     std::vector<MatrixXd>* to) {
    to->resize(from.size());
    for (std::size_t l = 0; l < from.size(); ++l) store(from[l], &(*to)[l]);
  };
  all->num_channels = call.num_channels;
  all->derivatives = call.derivatives;
  store_layers(call.inputs, &all->inputs);
  store_layers(call.slopes, &all->slopes);
  store_layers(call.curvatures, &all->curvatures);
  store(call.outputs, &all->outputs);
}

// Multiplies every column of x_bar (T nc x any number), covectors of one
// sample's x, by (I - K S)^-T (feedback.h). M: its step Jacobians. K: ns x T nc,
// column t nc + i is the derivative of u_{t,i} in s_t.
bool CloseSampleLoop(const Feedback& feedback,
                     const double* M,
                     const Eigen::Ref<const MatrixXd>& K,
                     Eigen::Ref<MatrixXd> x_bar) {
  const Index num_calls = feedback.num_calls();
  const Index ns = feedback.state_size();
  const Index nc = feedback.control_size();
  const Index size = ns + nc;
  Scratch<double> memory(2 * ns * x_bar.cols());
  // Covectors of s_{t+1} and of s_t, one per column.
  Eigen::Map<MatrixXd> p(memory.data(), ns, x_bar.cols());
  Eigen::Map<MatrixXd> pulled(memory.data() + p.size(), ns, x_bar.cols());
  p.setZero();
  for (Index t = num_calls - 1; t >= 0; --t) {
    // A row-major M_t, read by columns.
    const Eigen::Map<const MatrixXd> M_transposed(M + t * ns * size, size, ns);
    auto x_bar_t = x_bar.middleRows(t * nc, nc);
    x_bar_t.noalias() += M_transposed.bottomRows(nc) * p;
    pulled.noalias() = M_transposed.topRows(ns) * p;
    pulled.noalias() += K.middleCols(t * nc, nc) * x_bar_t;
    p = pulled;
  }
  return x_bar.allFinite();
}

void CheckSizes(const Model& model,
                const VectorXd& weights,
                const DataSet& batch) {
  CHECK_EQ(weights.size(), model.num_weights());
  CHECK_GT(batch.num_samples(), 0) << "The batch is empty.";
  CHECK_EQ(batch.inputs.rows(), model.num_inputs())
      << "DataSet::inputs needs a row for each input of the network.";
  CHECK_EQ(batch.contexts.rows(), model.simulator().num_context())
      << "DataSet::contexts needs a row for each of the simulator's "
         "num_context.";
  if (batch.contexts.rows() > 0) {
    CHECK_EQ(batch.contexts.cols(), batch.num_samples())
        << "DataSet::contexts needs a column for each sample.";
  }
}

}  // namespace

Model::Model(std::shared_ptr<const Network> network,
             std::shared_ptr<const Simulator> simulator,
             std::shared_ptr<const Loss> loss,
             Reduction reduction,
             std::shared_ptr<const Feedback> feedback,
             std::shared_ptr<const DerivativeSet> derivatives)
    : network_(std::move(network)),
      dense_network_(dynamic_cast<const DenseNetwork*>(network_.get())),
      is_point_(dynamic_cast<const WeightsNetwork*>(network_.get()) != nullptr),
      simulator_(std::move(simulator)),
      loss_(std::move(loss)),
      reduction_(reduction),
      feedback_(std::move(feedback)),
      derivatives_(std::move(derivatives)) {
  CHECK(network_ != nullptr);
  CHECK(simulator_ != nullptr);
  CHECK(loss_ != nullptr);
  CHECK(feedback_ == nullptr || derivatives_ == nullptr);
  CHECK(dense_network_ != nullptr ||
        (feedback_ == nullptr && derivatives_ == nullptr))
      << "Feedback and jets need a DenseNetwork.";
  CHECK_EQ(num_columns() * network_->num_outputs(), simulator_->num_inputs())
      << "The network's outputs are the simulator's inputs.";
  if (feedback_ != nullptr) {
    CHECK_EQ(feedback_->control_size(), network_->num_outputs())
        << "The network's outputs are the controls of a step.";
    CHECK_LE(feedback_->state_size(), network_->num_inputs())
        << "The state is the first part of the network's inputs.";
    CHECK_EQ(feedback_->state_size(), simulator_->num_context())
        << "The simulator's context is the state at the start.";
  }
  CHECK_EQ(simulator_->num_outputs(), loss_->size())
      << "The simulator's outputs are the loss's argument.";
}

int Model::num_inputs() const {
  return network_->num_inputs() *
         (derivatives_ != nullptr ? derivatives_->num_channels() : 1);
}

int Model::num_columns() const {
  return derivatives_ != nullptr ? derivatives_->num_channels() : num_calls();
}

Model Model::WithThreads(int num_threads) const {
  CHECK_GT(num_threads, 0) << "num_threads is at least 1.";
  Model model = *this;
  model.num_threads_ = num_threads;
  return model;
}

double Model::BatchScale(int num_samples) const {
  CHECK_GT(num_samples, 0);
  return reduction_ == Reduction::kMean ? 1.0 / num_samples : 1.0;
}

bool Model::Forward(const VectorXd& weights,
                    const DataSet& batch,
                    Network::Derivatives derivatives,
                    Network::Pass* pass,
                    std::string* error) const {
  CheckSizes(*this, weights, batch);
  if (feedback_ == nullptr && derivatives_ == nullptr) {
    return network_->Forward(weights, batch.inputs, derivatives, pass, error) &&
           CheckOutputs(*pass, batch, error);
  }
  const bool want_curvatures = derivatives == Network::Derivatives::kSecond;
  auto* activations = dynamic_cast<DenseNetwork::Activations*>(pass);
  CHECK(activations != nullptr) << "The pass is of another network.";
  if (feedback_ == nullptr) {
    const Index num_inputs = network_->num_inputs();
    dense_network_->ForwardJets(
        weights,
        derivatives_,
        batch.inputs.reshaped(num_inputs, batch.inputs.size() / num_inputs),
        want_curvatures,
        activations);
    return CheckOutputs(*activations, batch, error);
  }
  MatrixXd inputs = batch.inputs;
  MatrixXd states = batch.contexts;
  MatrixXd next(states.rows(), states.cols());
  DenseNetwork::Activations call;
  const auto advance = [&](int begin, int end) {
    return begin + feedback_->AdvanceBatch(end - begin,
                                           states.col(begin).data(),
                                           call.outputs.col(begin).data(),
                                           next.col(begin).data());
  };
  for (int t = 0; t < num_calls(); ++t) {
    if (t > 0) {
      const int s = ForShares(batch.num_samples(), num_threads_, advance);
      if (s < batch.num_samples()) {
        return SampleError(
            batch, s, AtTimeStep(kNoNextState, t - 1, num_calls()), error);
      }
      states.swap(next);
      inputs.topRows(states.rows()) = states;
    }
    dense_network_->Forward(weights, inputs, want_curvatures, &call);
    if (!CheckOutputs(call, batch, error)) return false;
    StoreCall(call, t, num_calls(), activations);
  }
  return true;
}

Eigen::Map<const MatrixXd> Model::SimulatorInputs(
    const Network::Pass& pass) const {
  const Index num_x = simulator_->num_inputs();
  return {pass.outputs.data(), num_x, pass.outputs.size() / num_x};
}

bool Model::CloseLoop(const VectorXd& weights,
                      const DataSet& batch,
                      const Network::Pass& pass,
                      Eigen::Ref<MatrixXd> x_bar,
                      std::string* error) const {
  if (num_calls() == 1) return true;  // there is no loop
  const int batch_size = batch.num_samples();
  const Index num_x = simulator_->num_inputs();
  CHECK_EQ(x_bar.cols() % batch_size, 0);
  const Index per_sample = x_bar.cols() / batch_size;
  const Eigen::Map<const MatrixXd> x = SimulatorInputs(pass);
  MatrixXd K;
  dense_network_->InputJacobians(
      weights, dynamic_cast<const DenseNetwork::Activations&>(pass), &K);
  const Index ns = feedback_->state_size();
  const Index M_size =
      num_x * ns * (ns + feedback_->control_size()) / feedback_->control_size();
  const auto close = [&](int begin, int end) {
    Scratch<double> M(Pack::kLanes * M_size);
    for (int first = begin; first < end; first += Pack::kLanes) {
      const int count = std::min(Pack::kLanes, end - first);
      const int num_done = feedback_->StepJacobiansBatch(
          count, x.col(first).data(), batch.Context(first).data(), M.data());
      for (int s = first; s < first + num_done; ++s) {
        if (!CloseSampleLoop(*feedback_,
                             M.data() + (s - first) * M_size,
                             K.topRows(ns).middleCols(s * num_x, num_x),
                             x_bar.middleCols(s * per_sample, per_sample))) {
          return s;
        }
      }
      if (num_done < count) return first + num_done;
    }
    return end;
  };
  const int s = ForShares(batch_size, num_threads_, close);
  if (s == batch_size) return true;
  // The open roll-out has succeeded; DescribeFailure may still name a step.
  const std::string where =
      simulator_->DescribeFailure(x.col(s).data(), batch.Context(s).data());
  return SampleError(
      batch, s, kLoopFailed + (where.empty() ? "" : ": " + where), error);
}

void Model::CheckTargets(const DataSet& batch) const {
  CHECK_EQ(batch.targets.rows(), loss_->size())
      << "DataSet::targets needs a row for each of the simulator's outputs.";
  CHECK_EQ(batch.targets.cols(), batch.num_samples())
      << "DataSet::targets needs a column for each sample.";
}

bool Model::Cost(const VectorXd& weights,
                 const DataSet& batch,
                 double* cost,
                 std::string* error) const {
  CheckTargets(batch);
  MatrixXd outputs;
  if (!Predict(weights, batch, &outputs, error)) return false;
  *cost = 0.0;
  const double scale = BatchScale(batch.batch_size());
  for (int s = 0; s < batch.num_samples(); ++s) {
    double loss = 0.0;
    if (!loss_->Evaluate(outputs.col(s).data(),
                         batch.targets.col(s).data(),
                         &loss,
                         nullptr,
                         nullptr)) {
      return SampleError(batch, s, kLossFailed, error);
    }
    *cost += scale * loss;
  }
  return CheckCost(*cost, error);
}

bool Model::Predict(const VectorXd& weights,
                    const DataSet& batch,
                    MatrixXd* outputs,
                    std::string* error) const {
  CheckSizes(*this, weights, batch);
  const int num_samples = batch.num_samples();
  outputs->resize(simulator_->num_outputs(), num_samples);
  const auto predict = [&](int begin, int count) {
    const DataSet piece = batch.Piece(begin, count);
    ScopedPass pass(*this);
    if (!Forward(
            weights, piece, Network::Derivatives::kNone, pass.get(), error)) {
      return false;
    }
    const Eigen::Map<const MatrixXd> x = SimulatorInputs(*pass);
    const int s = ForShares(count, num_threads_, [&](int first, int end) {
      return first +
             simulator_->EvaluateBatch(end - first,
                                       x.col(first).data(),
                                       piece.Context(first).data(),
                                       outputs->col(begin + first).data(),
                                       nullptr);
    });
    return s == count || SimulatorError(*simulator_, x, piece, s, error);
  };
  // The samples of other networks may depend on each other.
  const int piece_size = dense_network_ != nullptr ? kPieceSize : num_samples;
  for (int first = 0; first < num_samples; first += piece_size) {
    if (!predict(first, std::min(piece_size, num_samples - first))) {
      return false;
    }
  }
  return true;
}

}  // namespace invgrad
