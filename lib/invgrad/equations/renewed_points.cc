#include <cstdint>
#include <limits>
#include <utility>

#include "fmt/ranges.h"
#include "invgrad/equation.h"
#include "invgrad/internal/logging.h"
#include "invgrad/random.h"

namespace invgrad {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {
constexpr int kCandidates = 4;
}  // namespace

RenewedPoints::RenewedPoints(Equation equation, Box box, Options options)
    : equation_(std::move(equation)), box_(std::move(box)), options_(options) {
  CHECK_GT(options_.num_steps, 0);
}

std::string RenewedPoints::Name() const {
  return fmt::format("points in [{}] to [{}], renewed every {} steps{}",
                     fmt::join(box_.lower, ", "),
                     fmt::join(box_.upper, ", "),
                     options_.num_steps,
                     options_.by_residual ? " by residual" : "");
}

MatrixXd RenewedPoints::DrawByResidual(const QuadraturePoints& candidates,
                                       const Model& model,
                                       const VectorXd& weights,
                                       long set) const {
  DataSet samples;
  MatrixXd y;
  std::string error;
  VectorXd density = VectorXd::Ones(candidates.points.cols());
  // Where there is no finite residual, the training reports it.
  if (TermSamples(equation_, 0, candidates, &samples, &error) &&
      model.Predict(weights, samples, &y, &error)) {
    const VectorXd size = y.colwise().norm();
    if (size.sum() > 0.0) density += size / size.mean();
  }
  const Index count = density.size() / kCandidates;
  const double interval = density.sum() / static_cast<double>(count);
  NumpyRandom random(static_cast<std::uint32_t>(set));
  MatrixXd points(candidates.points.rows(), count);
  double sum = density[0];
  Index s = 0;
  for (Index i = 0; i < count; ++i) {
    const double place = (static_cast<double>(i) + random.Rand()) * interval;
    while (sum <= place && s + 1 < density.size()) sum += density[++s];
    points.col(i) = candidates.points.col(s);
  }
  return points;
}

DataSet RenewedPoints::Batch(long step,
                             int batch_size,
                             const Model& model,
                             const VectorXd& weights) const {
  CHECK_EQ(batch_size, NumPoints(equation_))
      << "Points are renewed for batches of all points.";
  const int count = static_cast<int>(equation_.terms[0].points.points.cols());
  const int drawn = options_.by_residual ? kCandidates * count : count;
  Equation equation = equation_;
  QuadraturePoints& points = equation.terms[0].points;
  const long set = step / options_.num_steps;
  points = SequencePoints(box_, drawn, set * drawn);
  if (options_.by_residual) {
    points = {DrawByResidual(points, model, weights, set),
              VectorXd::Constant(count, 1.0 / count)};
  }
  DataSet samples;
  std::string error;
  if (!EquationSamples(equation, &samples, &error)) {
    // A batch without a finite loss ends the run.
    LOG(ERROR) << Name() << ": " << error;
    samples.inputs.setConstant(model.num_inputs(),
                               batch_size,
                               std::numeric_limits<double>::quiet_NaN());
    samples.contexts.setZero(model.simulator().num_context(), batch_size);
    samples.targets.setZero(model.simulator().num_outputs(), batch_size);
  }
  return samples;
}

}  // namespace invgrad
