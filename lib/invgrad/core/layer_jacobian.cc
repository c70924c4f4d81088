#include "invgrad/core/layer_jacobian.h"

#include <algorithm>

#include "invgrad/internal/blas.h"
#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

LayerJacobian::LayerJacobian(const MatrixXd* inputs,
                             const MatrixXd* deltas,
                             int num_calls)
    : inputs_(inputs), deltas_(deltas), num_calls_(num_calls) {
  CHECK_GT(num_calls, 0);
  CHECK_GT(inputs->cols(), 0) << "The batch is empty.";
  CHECK_EQ(inputs->cols() % num_calls, 0)
      << "Every sample has the same number of calls.";
  CHECK_EQ(deltas->cols() % inputs->cols(), 0)
      << "Every sample has the same number of outputs.";
}

Eigen::Map<const MatrixXd> LayerJacobian::DeltasOfRows() const {
  return {deltas_->data(), deltas_->rows() * num_calls_, rows()};
}

void LayerJacobian::Times(const VectorXd& v, VectorXd* Jv) const {
  CHECK_EQ(v.size(), cols());
  const Index r = outputs_per_sample();
  // The tangents of z: fan_out x B T.
  MatrixXd dz(deltas_->rows(), inputs_->cols());
  Gemm(Op::kTranspose,
       Op::kNone,
       1.0,
       Eigen::Map<const MatrixXd>(v.data(), inputs_->rows(), deltas_->rows()),
       *inputs_,
       0.0,
       dz);
  dz.resize(dz.rows() * num_calls_, dz.cols() / num_calls_);  // keeps the data
  Jv->resize(rows());
  for (Index s = 0; s < dz.cols(); ++s) {
    Jv->segment(s * r, r).noalias() =
        DeltasOfRows().middleCols(s * r, r).transpose() * dz.col(s);
  }
}

void LayerJacobian::TransposeTimes(const VectorXd& w, VectorXd* Jtw) const {
  CHECK_EQ(w.size(), rows());
  const Index r = outputs_per_sample();
  // The covectors of z: first one column a sample, then fan_out x B T.
  MatrixXd z_bar(deltas_->rows() * num_calls_, inputs_->cols() / num_calls_);
  for (Index s = 0; s < z_bar.cols(); ++s) {
    z_bar.col(s).noalias() =
        DeltasOfRows().middleCols(s * r, r) * w.segment(s * r, r);
  }
  z_bar.resize(deltas_->rows(), inputs_->cols());
  Jtw->resize(cols());
  Gemm(Op::kNone,
       Op::kTranspose,
       1.0,
       *inputs_,
       z_bar,
       0.0,
       Eigen::Map<MatrixXd>(Jtw->data(), inputs_->rows(), deltas_->rows()));
}

void LayerJacobian::ToDense(MatrixXd* J) const {
  J->resize(rows(), cols());
  WriteTo(*J);
}

void LayerJacobian::WriteTo(Eigen::Ref<MatrixXd> J) const {
  CHECK_EQ(J.rows(), rows());
  CHECK_EQ(J.cols(), cols());
  if (num_calls_ > 1) {
    J = Transposed().transpose();
    return;
  }
  const Index fan_in = inputs_->rows();
  const Index r = outputs_per_sample();
  MatrixXd inputs(rows(), fan_in);  // row (s, j) is a_s
  for (Index s = 0; s < inputs_->cols(); ++s) {
    inputs.middleRows(s * r, r) = inputs_->col(s).transpose().replicate(r, 1);
  }
  const MatrixXd deltas = deltas_->transpose();
  for (Index unit = 0; unit < deltas.cols(); ++unit) {
    J.middleCols(unit * fan_in, fan_in).array() =
        inputs.array().colwise() * deltas.col(unit).array();
  }
}

MatrixXd LayerJacobian::Transposed() const {
  const Index fan_out = deltas_->rows();
  const Index r = outputs_per_sample();
  MatrixXd Jt(cols(), rows());
  // Column (j, unit): the deltas of row (s, j) of all calls. A product with the
  // inputs of these calls gives all rows of a sample.
  MatrixXd deltas(num_calls_, r * fan_out);
  for (Index s = 0; s < rows() / r; ++s) {
    for (Index j = 0; j < r; ++j) {
      deltas.middleCols(j * fan_out, fan_out) =
          deltas_->middleCols((s * r + j) * num_calls_, num_calls_).transpose();
    }
    Gemm(Op::kNone,
         Op::kNone,
         1.0,
         inputs_->middleCols(s * num_calls_, num_calls_),
         deltas,
         0.0,
         Eigen::Map<MatrixXd>(
             Jt.col(s * r).data(), inputs_->rows(), deltas.cols()));
  }
  return Jt;
}

void LayerJacobian::ParameterGram(MatrixXd* JtJ) const {
  if (num_calls_ > 1) {
    JacobianOperator::ParameterGram(JtJ);
    return;
  }
  const Index batch_size = inputs_->cols();
  const Index fan_in = inputs_->rows();
  const Index fan_out = deltas_->rows();
  const Index r = outputs_per_sample();
  // Column s: a_s a_s^T, and sum_j delta_{s,j} delta_{s,j}^T for pairs
  // unit >= other.
  MatrixXd of_inputs(fan_in * fan_in, batch_size);
  MatrixXd of_deltas(fan_out * (fan_out + 1) / 2, batch_size);
  MatrixXd delta_gram(fan_out, fan_out);
  for (Index s = 0; s < batch_size; ++s) {
    Eigen::Map<MatrixXd>(of_inputs.col(s).data(), fan_in, fan_in).noalias() =
        inputs_->col(s) * inputs_->col(s).transpose();
    Syrk(Op::kNone, 1.0, deltas_->middleCols(s * r, r), 0.0, delta_gram);
    Index pair = 0;
    for (Index other = 0; other < fan_out; ++other) {
      const Index height = fan_out - other;
      of_deltas.col(s).segment(pair, height) =
          delta_gram.col(other).tail(height);
      pair += height;
    }
  }
  // Column (unit, other): the block of J^T J of the two units' weights.
  MatrixXd blocks(of_inputs.rows(), of_deltas.rows());
  Gemm(Op::kNone, Op::kTranspose, 1.0, of_inputs, of_deltas, 0.0, blocks);
  JtJ->resize(cols(), cols());
  Index pair = 0;
  for (Index other = 0; other < fan_out; ++other) {
    for (Index unit = other; unit < fan_out; ++unit, ++pair) {
      const Eigen::Map<const MatrixXd> block(
          blocks.col(pair).data(), fan_in, fan_in);
      JtJ->block(unit * fan_in, other * fan_in, fan_in, fan_in) = block;
    }
  }
}

void LayerJacobian::Gram(MatrixXd* JJt) const {
  GramOfLayers({*this}, ColumnStrips(rows(), nullptr), JJt);
}

namespace {

// The Gram matrix of layers that a sample calls several times.
void GramOfCalls(const std::vector<LayerJacobian>& layers,
                 const ColumnStrips& strips,
                 MatrixXd* JJt) {
  const Index rows = JJt->rows();
  for (std::size_t l = 0; l < layers.size(); ++l) {
    CHECK_EQ(layers[l].rows(), rows);
    CHECK_EQ(layers[l].num_calls(), layers[0].num_calls());
    const double beta = l == 0 ? 0.0 : 1.0;
    const MatrixXd Jt = layers[l].Transposed();
    if (strips.num_ranks() == 1) {
      Syrk(Op::kTranspose, 1.0, Jt, beta, *JJt);
      continue;
    }
    strips.ForOwn([&](Index first, Index count) {
      Gemm(Op::kTranspose,
           Op::kNone,
           1.0,
           Jt.rightCols(rows - first),
           Jt.middleCols(first, count),
           beta,
           JJt->block(first, strips.Local(first), rows - first, count));
    });
  }
}

// B x B: a_s . a_t, both triangles, because tiles on the diagonal read both.
MatrixXd GramOfInputs(const LayerJacobian& layer) {
  const Index batch_size = layer.inputs().cols();
  MatrixXd gram(batch_size, batch_size);
  Syrk(Op::kTranspose, 1.0, layer.inputs(), 0.0, gram);
  gram.triangularView<Eigen::StrictlyUpper>() = gram.transpose();
  return gram;
}

}  // namespace

void GramOfLayers(const std::vector<LayerJacobian>& layers,
                  const ColumnStrips& strips,
                  MatrixXd* JJt) {
  CHECK(!layers.empty());
  const Index rows = layers[0].rows();
  const Index r = layers[0].outputs_per_sample();
  const Index batch_size = layers[0].inputs().cols();
  CHECK_EQ(strips.size(), rows);
  JJt->resize(rows, strips.num_local());
  if (layers[0].num_calls() > 1) return GramOfCalls(layers, strips, JJt);

  std::vector<MatrixXd> input_grams;
  for (const LayerJacobian& layer : layers) {
    CHECK_EQ(layer.rows(), rows);
    CHECK_EQ(layer.outputs_per_sample(), r);
    CHECK_EQ(layer.num_calls(), 1);
    input_grams.push_back(GramOfInputs(layer));
  }

  // Tiles of whole samples, small enough that a layer's products stay in the
  // cache until they are scaled and added, large enough for Gemm to be fast.
  // Measured: 64 is best for r = 4, 128 by a tenth for r = 28 and 64. A strip may
  // begin and end within a sample.
  const Index samples_per_tile = std::max<Index>(1, (r < 16 ? 64 : 128) / r);
  const Index tile = samples_per_tile * r;
  MatrixXd delta_gram(tile, tile);
  VectorXd scale(tile);  // a_s . a_t for the rows (s, j) of the tile
  const auto fill_tile = [&](Index s0, Index first, Index width) {
    const Index num_s = std::min(samples_per_tile, batch_size - s0);
    const Index height = num_s * r;
    for (std::size_t l = 0; l < layers.size(); ++l) {
      const MatrixXd& delta = layers[l].deltas();
      Gemm(Op::kTranspose,
           Op::kNone,
           1.0,
           delta.middleCols(s0 * r, height),
           delta.middleCols(first, width),
           0.0,
           delta_gram.topLeftCorner(height, width));
      for (Index col = first; col < first + width; ++col) {
        if (col == first || col % r == 0) {
          const double* inputs = &input_grams[l](s0, col / r);
          for (Index s = 0; s < num_s; ++s) {
            std::fill_n(scale.data() + s * r, r, inputs[s]);
          }
        }
        const auto product = scale.head(height).cwiseProduct(
            delta_gram.col(col - first).head(height));
        auto sum = JJt->col(strips.Local(col)).segment(s0 * r, height);
        if (l == 0) {
          sum = product;
        } else {
          sum += product;
        }
      }
    }
  };
  strips.ForOwn([&](Index begin, Index count) {
    const Index end = begin + count;
    for (Index first = begin; first < end; first += tile) {
      const Index width = std::min(tile, end - first);
      for (Index s0 = first / r; s0 < batch_size; s0 += samples_per_tile) {
        fill_tile(s0, first, width);
      }
    }
  });
}

}  // namespace invgrad
