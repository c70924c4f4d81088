#include "invgrad/output_layer/share.h"

#include <algorithm>
#include <cmath>

#include "invgrad/internal/network_layers.h"
#include "invgrad/inverse/output_layer_problem.h"

namespace invgrad {
namespace {

constexpr double kEquationsPerUnknown = 16.0;
// A network takes less time for a sample if it has some at a time.
constexpr int kLeastSamplesOfBlock = 32;
// The cost of the solutions, over that of the steps.
constexpr double kCostOfSolutions = 0.5;

struct ProblemSizes {
  ProblemSizes(const Model& model, bool is_proxy) {
    const LayerColumns layer = OutputLayerOf(model.network());
    const bool in_x = is_proxy || IsSolvedInX(model);
    p = static_cast<double>(in_x ? layer.rows() : layer.size());
    q = in_x ? static_cast<double>(layer.cols()) : 1.0;
    equations_of_sample =
        in_x ? model.num_columns() * model.network().num_outputs() / q
             : model.loss().size();
    unlike_equations =
        in_x ? static_cast<double>(model.num_columns()) : equations_of_sample;
  }
  double p;
  double q;
  double equations_of_sample;
  double unlike_equations;  // those of a convolution's positions are one
};

int SamplesFor(double p, double equations_of_sample) {
  return static_cast<int>(std::clamp(
      std::ceil(kEquationsPerUnknown * p / equations_of_sample), 1.0, 1e9));
}

}  // namespace

int SamplesOfShare(const Model& model, bool is_proxy) {
  const ProblemSizes sizes(model, is_proxy);
  return SamplesFor(sizes.p, sizes.unlike_equations);
}

int SamplesOfBlock(const Model& model, bool is_proxy) {
  const ProblemSizes sizes(model, is_proxy);
  return std::min(SamplesOfShare(model, is_proxy),
                  std::max(SamplesFor(sizes.p, sizes.equations_of_sample),
                           kLeastSamplesOfBlock));
}

int OutputLayerPeriod(const Model& model,
                      bool is_proxy,
                      int batch_size,
                      int num_samples) {
  const ProblemSizes sizes(model, is_proxy);
  const double pass = 2.0 * model.num_weights() * model.num_columns();
  const double solution =
      (is_proxy ? 3.0 * pass : pass) +
      4.0 * sizes.equations_of_sample * sizes.p * (sizes.p + sizes.q);
  const int share = std::min(num_samples, SamplesOfShare(model, is_proxy));
  const double period =
      solution * share / (kCostOfSolutions * 3.0 * pass * batch_size);
  return static_cast<int>(std::clamp(std::ceil(period), 1.0, 1e9));
}

double OutputLayerBytes(const Model& model, bool is_proxy) {
  const ProblemSizes sizes(model, is_proxy);
  const double block = SamplesOfBlock(model, is_proxy);
  return sizeof(double) * (sizes.p + sizes.q) *
             (3.0 * block * sizes.equations_of_sample + 4.0 * sizes.p) +
         block * model.num_columns() * model.network().bytes_per_column();
}

double ProjectionBytes(const Model& model, double num_outputs, int batch_size) {
  const auto p = static_cast<double>(OutputLayerOf(model.network()).size());
  return 4.0 * sizeof(double) * p * (num_outputs * batch_size + p);
}

}  // namespace invgrad
