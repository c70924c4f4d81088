#include "invgrad/rules/kfac_factors.h"

#include <lapacke.h>

#include <limits>

#include "Eigen/Eigenvalues"
#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/shared_jacobian.h"
#include "invgrad/internal/blas.h"
#include "invgrad/internal/layered_jacobian.h"
#include "invgrad/internal/logging.h"
#include "invgrad/random.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::Map;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Eigen::VectorXi;

// The largest entry of X, of all ranks; 1 if they are all zero.
double LargestEntry(const MatrixXd& X, const Communicator* ranks) {
  const double own = X.cwiseAbs().maxCoeff();
  double largest = own;
  if (ranks != nullptr) {
    VectorXd all(ranks->size());
    ranks->Gather(&own, ranks->SharedSizes(ranks->size(), 1), all.data());
    largest = all.maxCoeff();
  }
  return largest > 0.0 ? largest : 1.0;
}

// X Y^T of matrices whose columns the ranks share. Y null: X X^T.
void SetGram(const MatrixXd& X,
             const MatrixXd* Y,
             const Communicator* ranks,
             KfacFactor* factor) {
  // Scaled by the largest entry, because its square may over- or underflow.
  factor->unit = LargestEntry(X, ranks);
  if (Y == nullptr) {
    Syrk(Op::kNone, 1.0, X / factor->unit, 0.0, factor->U);
  } else {
    Gemm(Op::kNone,
         Op::kTranspose,
         1.0,
         X / factor->unit,
         *Y / factor->unit,
         0.0,
         factor->U);
  }
  if (ranks != nullptr) ranks->Sum(factor->U.data(), factor->U.size());
}

// The deltas times H_L, row by row.
MatrixXd CurvedDeltas(const LayerJacobian& layer, const Linearization& own) {
  MatrixXd curved = layer.deltas();
  const Index num_calls = layer.num_calls();
  const Index fan_out = curved.rows();
  for (Index unit = 0; unit < fan_out; ++unit) {
    for (Index call = 0; call < num_calls; ++call) {
      Map<VectorXd, 0, Eigen::InnerStride<>> row(
          curved.data() + call * fan_out + unit,
          layer.rows(),
          Eigen::InnerStride<>(fan_out * num_calls));
      row = own.loss_hessian_times(VectorXd(row));
    }
  }
  return curved;
}

// H_L^(1/2) z. The root is Lanczos' [1], exact if H_L has few distinct
// eigenvalues, which the squared norm has; negative eigenvalues count as zero.
//
// [1] Higham. Functions of Matrices. SIAM 2008, section 13.2.2.
VectorXd RootOfHessianTimes(const Linearization& at_x, const VectorXd& z) {
  constexpr int kIterations = 30;
  constexpr double kRounding = 1e-10;
  const double length = z.norm();
  std::vector<VectorXd> basis = {z / length};
  // H_L in the basis is tridiagonal.
  VectorXd diagonal(kIterations);
  VectorXd beside(kIterations);
  int k = 0;
  while (true) {
    VectorXd next = at_x.loss_hessian_times(basis[k]);
    diagonal[k] = next.dot(basis[k]);
    next -= diagonal[k] * basis[k];
    if (k > 0) next -= beside[k - 1] * basis[k - 1];
    beside[k] = next.norm();
    ++k;
    // Written so that NaN ends the loop.
    const double scale = diagonal.head(k).cwiseAbs().maxCoeff();
    if (k == kIterations || !(beside[k - 1] > kRounding * scale)) break;
    basis.push_back(next / beside[k - 1]);
  }
  VectorXd w = VectorXd::Zero(z.size());
  if (!diagonal.head(k).allFinite() || !beside.head(k - 1).allFinite()) {
    return w.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  Eigen::SelfAdjointEigenSolver<MatrixXd> eigen;
  eigen.computeFromTridiagonal(diagonal.head(k), beside.head(k - 1));
  const VectorXd root =
      eigen.eigenvectors() *
      eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseProduct(
          eigen.eigenvectors().row(0).transpose());
  for (int i = 0; i < k; ++i) w += length * root[i] * basis[i];
  return w;
}

}  // namespace

void KfacFactor::TakeUnits() {
  U *= unit * unit / count;
  unit = 1.0;
  count = 1.0;
}

KfacCurvature::KfacCurvature(const std::vector<LayerColumns>& layers,
                             Index num_others)
    : others(VectorXd::Zero(num_others)) {
  for (const LayerColumns& layer : layers) {
    for (const Index size : {layer.rows(), layer.cols()}) {
      factors.emplace_back();
      factors.back().U.setZero(size, size);
      factors.back().values.setZero(size);
    }
  }
}

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

std::vector<LayerColumns> ColumnsOf(
    const std::vector<const LayerJacobian*>& layers) {
  std::vector<LayerColumns> columns;
  int first = 0;
  for (const LayerJacobian* layer : layers) {
    const int size = layer->cols();
    columns.push_back(
        VectorXi::LinSpaced(size, first, first + size - 1)
            .reshaped(layer->inputs().rows(), layer->deltas().rows()));
    first += size;
  }
  return columns;
}

void SumFactors(const Linearization& at_x,
                const std::vector<const LayerJacobian*>& layers,
                bool of_loss,
                KfacCurvature* curvature) {
  const JacobianOperator& J = *at_x.jacobian;
  const Linearization& own = OwnPart(at_x);
  for (std::size_t l = 0; l < layers.size(); ++l) {
    const LayerJacobian& layer = *layers[l];
    KfacFactor* const of_layer = &curvature->factors[2 * l];
    SetGram(layer.inputs(), nullptr, RanksOf(J), &of_layer[0]);
    of_layer[0].count =
        static_cast<double>(layer.inputs().cols()) * J.rows() / layer.rows();
    if (of_loss && own.loss_hessian_times) {
      const MatrixXd curved = CurvedDeltas(layer, own);
      SetGram(layer.deltas(), &curved, RanksOf(J), &of_layer[1]);
    } else {
      SetGram(layer.deltas(), nullptr, RanksOf(J), &of_layer[1]);
    }
  }
}

bool SampleFactors(const Linearization& at_x,
                   bool of_loss,
                   std::uint32_t seed,
                   KfacCurvature* curvature,
                   std::string* error) {
  VectorXd w = NumpyRandom(seed).Normal(at_x.jacobian->rows());
  if (of_loss && at_x.loss_hessian_times) w = RootOfHessianTimes(at_x, w);
  if (!CheckFinite("a random covector", w, error)) return false;
  SampledFactors sampled;
  LayersOf(*at_x.jacobian)->FactorsAlong(w, &sampled);
  if (!CheckFinite("J^T w", sampled.others, error)) return false;
  CHECK_EQ(2 * sampled.layers.size(), curvature->factors.size());
  curvature->others = sampled.others.cwiseAbs2();
  for (std::size_t l = 0; l < sampled.layers.size(); ++l) {
    curvature->factors[2 * l].U = std::move(sampled.layers[l].A);
    curvature->factors[2 * l + 1].U = std::move(sampled.layers[l].D);
  }
  return true;
}

bool DecomposeFactors(const Communicator* ranks,
                      KfacCurvature* curvature,
                      std::string* error) {
  std::vector<KfacFactor>& factors = curvature->factors;
  const auto owner = [&](std::size_t i) {
    return ranks == nullptr ? 0 : static_cast<int>(i) % ranks->size();
  };
  bool is_done = true;
  for (std::size_t i = 0; i < factors.size() && is_done; ++i) {
    if (ranks != nullptr && owner(i) != ranks->rank()) continue;
    const Index size = factors[i].U.rows();
    is_done = LAPACKE_dsyevd(LAPACK_COL_MAJOR,
                             'V',
                             'L',
                             size,
                             factors[i].U.data(),
                             size,
                             factors[i].values.data()) == 0;
    if (!is_done) {
      *error = fmt::format(
          "layer {}: the eigenvalues of a factor (dsyevd) did not converge",
          i / 2);
    }
  }
  if (ranks == nullptr || !ranks->Agree(is_done, error)) return is_done;
  for (std::size_t i = 0; i < factors.size(); ++i) {
    KfacFactor& factor = factors[i];
    ranks->Broadcast(owner(i), factor.U.data(), factor.U.size());
    ranks->Broadcast(owner(i), factor.values.data(), factor.values.size());
  }
  return true;
}

}  // namespace invgrad
