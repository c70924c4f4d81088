#include "invgrad/output_layer/reduced_objective.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "Eigen/QR"
#include "invgrad/core/dense_svd.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/internal/logging.h"
#include "invgrad/internal/network_layers.h"
#include "invgrad/output_layer/reduced_jacobian.h"
#include "invgrad/output_layer/share.h"

namespace invgrad {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The root of the ridge of a layer that is solved after each step, over the
// largest singular value. A smaller one lets directions that the features barely
// have grow to where rounding errors decide; a truncation in its place makes the
// loss jump as singular values cross it.
constexpr double kRidge = 1e-9;
// The largest share of a promised decrease that a change of a nonlinear loss may
// miss and need no further one.
constexpr double kMissed = 1e-3;
constexpr int kMaxNumChanges = 3;
constexpr int kMaxNumHalvings = 8;

std::vector<int> WeightsOutside(const LayerColumns& layer, int num_weights) {
  std::vector<char> is_inside(num_weights, 0);
  for (const int weight : layer.reshaped()) is_inside[weight] = 1;
  std::vector<int> others;
  for (int i = 0; i < num_weights; ++i) {
    if (is_inside[i] == 0) others.push_back(i);
  }
  return others;
}

// s^2 / (s^2 + (kRidge s_max)^2): the parts of U^T d that a solution with this
// ridge takes.
ArrayXd Shares(const VectorXd& s) {
  const ArrayXd squares = s.array().square();
  return (squares > 0.0)
      .select(squares / (squares + std::pow(kRidge * s[0], 2)), 0.0);
}

// W with J - W W^T J the part of J that a solution of the layer leaves.
MatrixXd SolvedDirections(MatrixXd J_C) {
  DenseSvd svd;
  *svd.mutable_matrix() = std::move(J_C);
  if (!svd.Compute()) return {};
  return svd.U() * Shares(svd.s()).sqrt().matrix().asDiagonal();
}

bool SolveWithSmallRidge(const OutputLayerProblem& problem,
                         NormalEquations::Solution* solution) {
  DenseSvd svd;
  *svd.mutable_matrix() = problem.H.transpose();
  solution->squared_norm = problem.D.squaredNorm();
  if (!std::isfinite(solution->squared_norm) || !svd.Compute()) return false;
  const ArrayXd shares = Shares(svd.s());
  const MatrixXd coefficients = svd.UTransposeTimes(problem.D.transpose());
  const VectorXd factors =
      (svd.s().array() > 0.0).select(shares / svd.s().array(), 0.0);
  solution->Z = svd.Vt().transpose() * (factors.asDiagonal() * coefficients);
  const ArrayXd left = 1.0 - (1.0 - shares).square();
  solution->squared_residual =
      solution->squared_norm -
      (left * coefficients.rowwise().squaredNorm().array()).sum();
  return true;
}

}  // namespace

ReducedObjective::ReducedObjective(std::unique_ptr<BatchObjective> whole,
                                   const Model* model,
                                   const DataSet* train)
    : whole_(std::move(whole)),
      model_(*model),
      train_(train),
      layer_(OutputLayerOf(model->network())),
      others_(WeightsOutside(layer_, model->num_weights())) {
  CHECK_GT(layer_.size(), 0) << "the network has no affine output layer";
  CHECK(!others_.empty()) << "all weights are in the output layer";
}

bool ReducedObjective::Linearize(const VectorXd& weights,
                                 const DataSet& batch,
                                 const LinearizationParts& parts,
                                 Linearization* linearization,
                                 std::string* error) {
  return Reduce(whole_->Linearize(weights, batch, parts, linearization, error),
                parts,
                linearization);
}

bool ReducedObjective::LinearizeAgain(const VectorXd& weights,
                                      const DataSet& batch,
                                      const LinearizationParts& parts,
                                      Linearization* linearization,
                                      std::string* error) {
  return Reduce(
      whole_->LinearizeAgain(weights, batch, parts, linearization, error),
      parts,
      linearization);
}

bool ReducedObjective::Reduce(bool ok,
                              const LinearizationParts& parts,
                              Linearization* linearization) const {
  if (!ok) return false;
  if (parts.gradient) {
    linearization->gradient = VectorXd(linearization->gradient(others_));
  }
  if (parts.hessian) {
    linearization->hessian = ReducedHessian(linearization->hessian);
  }
  if (linearization->jacobian == nullptr) return true;
  MatrixXd Q;
  if (of_batch()) {
    const auto layers = ColumnBlocksOf(*linearization->jacobian);
    CHECK(!layers.empty())
        << "the projection needs the layers of a DenseNetwork";
    MatrixXd J_C;
    layers.back()->ToDense(&J_C);
    Q = SolvedDirections(std::move(J_C));
  }
  linearization->jacobian = std::make_shared<ReducedJacobian>(
      linearization->jacobian, others_, std::move(Q));
  return true;
}

MatrixXd ReducedObjective::ReducedHessian(const MatrixXd& H) const {
  MatrixXd reduced = H(others_, others_);
  if (!of_batch()) return reduced;
  const Eigen::VectorXi in_layer = layer_.reshaped();
  const MatrixXd H_Cu = H(in_layer, others_);
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> H_CC(
      H(in_layer, in_layer));
  reduced -= H_Cu.transpose() * H_CC.solve(H_Cu);
  return reduced;
}

VectorXd ReducedObjective::Unknowns(const VectorXd& weights) const {
  return weights(others_);
}

void ReducedObjective::AddStep(const VectorXd& step, VectorXd* weights) const {
  (*weights)(others_) += step;
}

bool ReducedObjective::Plus(const VectorXd& step,
                            const DataSet& batch,
                            VectorXd* weights,
                            std::string* error) {
  AddStep(step, weights);
  return !of_batch() || SolveOutputLayer(batch, weights, error);
}

bool ReducedObjective::Split(const DataSet& samples,
                             Blocks* blocks,
                             std::string* error) const {
  blocks->clear();
  const long N = samples.num_samples();
  const long size = of_batch() ? N : SamplesOfBlock(model_, whole_->is_proxy());
  const long count = (N + size - 1) / size;
  for (long k = 0; k < count; ++k) {
    const long first = N * k / count;
    blocks->push_back(
        samples.Range(static_cast<int>(first),
                      static_cast<int>(N * (k + 1) / count - first)));
    if (!whole_->is_proxy() && IsSolvedInX(model_) &&
        !SetLeastSquaresSolutions(model_, &blocks->back(), error)) {
      return false;
    }
  }
  return true;
}

bool ReducedObjective::SetTrainingBlocks(std::string* error) {
  return !blocks_.empty() || Split(*train_, &blocks_, error);
}

double ReducedObjective::SquaredNorm(const VectorXd& weights,
                                     const Blocks& blocks) {
  double sum = 0.0;
  for (const DataSet& block : blocks) {
    Linearization at_weights;
    std::string ignored;
    if (!whole_->Linearize(
            weights, block, LinearizationParts(), &at_weights, &ignored)) {
      return std::numeric_limits<double>::infinity();
    }
    sum += at_weights.cost / (*model_.loss().SquaredNormFactor() *
                              model_.BatchScale(block.num_samples()));
  }
  return sum;
}

bool ReducedObjective::FindChange(const VectorXd& weights,
                                  const Blocks& blocks,
                                  DriftRidge* drift,
                                  NormalEquations::Solution* change,
                                  std::string* error) {
  std::optional<NormalEquations> equations;
  OutputLayerProblem problem;
  for (const DataSet& block : blocks) {
    if (!whole_->LinearizeOutputLayer(weights, block, &problem, error)) {
      return false;
    }
    if (of_batch()) break;
    if (!equations.has_value()) {
      equations.emplace(static_cast<int>(problem.H.rows()),
                        static_cast<int>(problem.D.rows()));
    }
    equations->Add(problem.H, problem.D);
  }
  const bool is_solved =
      of_batch() ? SolveWithSmallRidge(problem, change)
                 : SolveTowardsZero(weights, drift, &*equations, change);
  if (is_solved && change->Z.allFinite()) return true;
  *error =
      "output_layer: the features of the last hidden layer or the "
      "targets of the output layer are not finite";
  return false;
}

bool ReducedObjective::SolveTowardsZero(const VectorXd& weights,
                                        DriftRidge* drift,
                                        NormalEquations* equations,
                                        NormalEquations::Solution* change) {
  const double least_ridge = drift == nullptr
                                 ? 0.0
                                 : drift->RidgeFor(equations->squared_norm() /
                                                   equations->num_equations());
  const VectorXd layer = weights(layer_.reshaped());
  const MatrixXd C =
      layer.reshaped(equations->num_features(), equations->num_targets());
  const double squared_norm = equations->squared_norm();
  equations->MoveOrigin(C);
  if (!equations->Solve(least_ridge, change)) return false;
  change->Z -= C;
  change->squared_norm = squared_norm;
  return true;
}

bool ReducedObjective::SolveOutputLayer(const DataSet& batch,
                                        VectorXd* weights,
                                        std::string* error) {
  if (!of_batch()) {
    return SetTrainingBlocks(error) && Solve(blocks_, nullptr, weights, error);
  }
  Blocks blocks;
  return Split(batch, &blocks, error) && Solve(blocks, nullptr, weights, error);
}

bool ReducedObjective::TrainingShare(long k,
                                     Blocks* share,
                                     std::string* error) {
  CHECK(!of_batch());
  if (!SetTrainingBlocks(error)) return false;
  const bool is_proxy = whole_->is_proxy();
  const int block = SamplesOfBlock(model_, is_proxy);
  const size_t count = std::min<size_t>(
      (SamplesOfShare(model_, is_proxy) + block - 1) / block, blocks_.size());
  share->clear();
  for (size_t j = 0; j < count; ++j) {
    share->push_back(blocks_[(k * count + j) % blocks_.size()]);
  }
  return true;
}

bool ReducedObjective::Solve(const Blocks& blocks,
                             DriftRidge* drift,
                             VectorXd* weights,
                             std::string* error) {
  const int max_num_changes = IsInX() || drift != nullptr ? 1 : kMaxNumChanges;
  VectorXd at = *weights;
  for (int k = 0; k < max_num_changes; ++k) {
    NormalEquations::Solution change;
    if (!FindChange(at, blocks, drift, &change, error)) return false;
    double after = change.squared_residual;
    if (IsInX()) {
      AddChange(change.Z, 1.0, &at);
    } else {
      after = change.squared_norm;
      if (!LowerSquaredNorm(change.Z, blocks, &at, &after)) break;
    }
    if (drift != nullptr) drift->SetResidual(after / change.num_equations);
    const double promised = change.squared_norm - change.squared_residual;
    if (after - change.squared_residual <= kMissed * promised) break;
  }
  *weights = at;
  return true;
}

bool ReducedObjective::LowerSquaredNorm(const MatrixXd& Z,
                                        const Blocks& blocks,
                                        VectorXd* weights,
                                        double* squared_norm) {
  double factor = 1.0;
  for (int k = 0; k < kMaxNumHalvings; ++k, factor /= 2.0) {
    VectorXd trial = *weights;
    AddChange(Z, factor, &trial);
    const double after = SquaredNorm(trial, blocks);
    if (!(after < *squared_norm)) continue;
    *weights = trial;
    *squared_norm = after;
    return true;
  }
  return false;
}

void ReducedObjective::AddChange(const MatrixXd& Z,
                                 double factor,
                                 VectorXd* weights) const {
  const auto change = Z.reshaped(layer_.rows(), layer_.cols());
  for (Index j = 0; j < layer_.cols(); ++j) {
    for (Index i = 0; i < layer_.rows(); ++i) {
      (*weights)[layer_(i, j)] += factor * change(i, j);
    }
  }
}

}  // namespace invgrad
