#include <cmath>

#include "invgrad/equation_points.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The tensor product of the coordinates, one column a point.
MatrixXd TensorProduct(const std::vector<VectorXd>& coordinates) {
  Index size = 1;
  for (const VectorXd& values : coordinates) size *= values.size();
  MatrixXd points(coordinates.size(), size);
  Index repeats = size;
  for (std::size_t i = 0; i < coordinates.size(); ++i) {
    repeats /= coordinates[i].size();
    for (Index s = 0; s < size; ++s) {
      points(i, s) = coordinates[i][(s / repeats) % coordinates[i].size()];
    }
  }
  return points;
}

}  // namespace

QuadraturePoints GaussRule(int count) {
  CHECK_GT(count, 0);
  QuadraturePoints rule;
  rule.points.resize(1, count);
  rule.weights.resize(count);
  for (int i = 0; i < count; ++i) {
    // Newton's method for the roots of the Legendre polynomial.
    double z = std::cos(M_PI * (i + 0.75) / (count + 0.5));
    double slope = 0.0;
    for (double change = 1.0; std::abs(change) > 1e-15;) {
      double p = 1.0;
      double previous = 0.0;
      for (int k = 0; k < count; ++k) {
        const double next = ((2 * k + 1) * z * p - k * previous) / (k + 1);
        previous = p;
        p = next;
      }
      slope = count * (z * p - previous) / (z * z - 1.0);
      change = p / slope;
      z -= change;
    }
    rule.points(0, i) = 0.5 * (1.0 - z);
    rule.weights[i] = 1.0 / ((1.0 - z * z) * slope * slope);
  }
  return rule;
}

QuadraturePoints GaussPanels(const std::vector<double>& ends,
                             const std::vector<int>& counts) {
  CHECK_EQ(ends.size(), counts.size() + 1);
  Index size = 0;
  for (const int count : counts) size += count;
  QuadraturePoints points;
  points.points.resize(1, size);
  points.weights.resize(size);
  Index first = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const double width = ends[i + 1] - ends[i];
    const QuadraturePoints rule = GaussRule(counts[i]);
    points.points.middleCols(first, counts[i]) =
        ends[i] + width * rule.points.array();
    points.weights.segment(first, counts[i]) =
        width / (ends.back() - ends.front()) * rule.weights;
    first += counts[i];
  }
  return points;
}

QuadraturePoints ProductPoints(const std::vector<QuadraturePoints>& rules) {
  std::vector<VectorXd> nodes;
  std::vector<VectorXd> weights;
  for (const QuadraturePoints& rule : rules) {
    CHECK_EQ(rule.points.rows(), 1);
    nodes.emplace_back(rule.points.row(0));
    weights.push_back(rule.weights);
  }
  return {TensorProduct(nodes),
          TensorProduct(weights).colwise().prod().transpose()};
}

QuadraturePoints GaussPoints(const Box& box, const std::vector<int>& counts) {
  CHECK_EQ(static_cast<Index>(counts.size()), box.lower.size())
      << "GaussPoints: one count a coordinate.";
  std::vector<QuadraturePoints> rules;
  for (Index i = 0; i < box.lower.size(); ++i) {
    rules.push_back(GaussPanels({box.lower[i], box.upper[i]}, {counts[i]}));
  }
  return ProductPoints(rules);
}

QuadraturePoints GaussTimesPeriodic(const Box& box, int num_t, int num_x) {
  CHECK_EQ(box.lower.size(), 2);
  const double last = box.upper[1] - (box.upper[1] - box.lower[1]) / num_x;
  const QuadraturePoints in_x = {
      Eigen::RowVectorXd::LinSpaced(num_x, box.lower[1], last),
      VectorXd::Constant(num_x, 1.0 / num_x)};
  return ProductPoints(
      {GaussPanels({box.lower[0], box.upper[0]}, {num_t}), in_x});
}

QuadraturePoints SequencePoints(const Box& box, int count, long first) {
  const Index d = box.lower.size();
  double phi = 2.0;
  for (int k = 0; k < 100; ++k) phi = std::pow(1.0 + phi, 1.0 / (d + 1.0));
  QuadraturePoints result;
  result.points.resize(d, count);
  result.weights = VectorXd::Constant(count, 1.0 / count);
  for (Index i = 0; i < d; ++i) {
    const double alpha = std::pow(phi, -(i + 1.0));
    for (int s = 0; s < count; ++s) {
      const double place =
          std::fmod(0.5 + static_cast<double>(first + s + 1) * alpha, 1.0);
      result.points(i, s) =
          box.lower[i] + (box.upper[i] - box.lower[i]) * place;
    }
  }
  return result;
}

QuadraturePoints FacePoints(const Box& box, int first, int count) {
  const auto d = static_cast<int>(box.lower.size());
  CHECK(first >= 0 && first < d)
      << "FacePoints: first = " << first << "; allowed: 0 to " << d - 1;
  QuadraturePoints faces;
  faces.points.resize(d, Index{2} * (d - first) * count);
  faces.weights = VectorXd::Constant(
      faces.points.cols(), 1.0 / static_cast<double>(faces.points.cols()));
  long place = 0;
  for (int i = first; i < d; ++i) {
    for (const double value : {box.lower[i], box.upper[i]}) {
      MatrixXd points = SequencePoints(box, count, place).points;
      points.row(i).setConstant(value);
      faces.points.middleCols(place, count) = points;
      place += count;
    }
  }
  return faces;
}

MatrixXd GridPoints(const Box& box, const std::vector<int>& counts) {
  CHECK_EQ(static_cast<Index>(counts.size()), box.lower.size())
      << "GridPoints: one count a coordinate.";
  std::vector<VectorXd> nodes;
  for (Index i = 0; i < box.lower.size(); ++i) {
    nodes.emplace_back(
        VectorXd::LinSpaced(counts[i], box.lower[i], box.upper[i]));
  }
  return TensorProduct(nodes);
}

}  // namespace invgrad
