#include "problems/equations/periodic_evolution.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "glog/logging.h"
#include "problems/fields/fourier_grid.h"

namespace invgrad {
namespace {

using Complex = std::complex<double>;
using Modes = Eigen::ArrayXcd;
using Eigen::ArrayXd;
using Eigen::Index;

// The coefficients of a step of length h.
struct Coefficients {
  Modes whole;  // exp(a h)
  Modes half;   // exp(a h / 2)
  Modes q;      // of the inner stages
  Modes f1, f2, f3;
};

Coefficients MakeCoefficients(const Modes& a, double h) {
  constexpr int kCirclePoints = 64;
  Coefficients c;
  c.whole = (a * h).exp();
  c.half = (0.5 * a * h).exp();
  c.q = c.f1 = c.f2 = c.f3 = Modes::Zero(a.size());
  for (int j = 0; j < kCirclePoints; ++j) {
    const Complex on_circle =
        std::polar(1.0, 2.0 * M_PI * (j + 0.5) / kCirclePoints);
    const Modes z = a * h + on_circle;
    const Modes e = z.exp();
    const Modes z2 = z * z;
    const Modes z3 = z2 * z;
    c.q += ((0.5 * z).exp() - 1.0) / z;
    c.f1 += (-4.0 - z + e * (4.0 - 3.0 * z + z2)) / z3;
    c.f2 += (2.0 + z + e * (z - 2.0)) / z3;
    c.f3 += (-4.0 - 3.0 * z - z2 + e * (4.0 - z)) / z3;
  }
  for (Modes* values : {&c.q, &c.f1, &c.f2, &c.f3})
    *values *= h / kCirclePoints;
  return c;
}

class Evolution {
 public:
  explicit Evolution(const PeriodicEvolution& equation)
      : equation_(equation),
        grid_(1, equation.num_cells),
        k_(grid_.num_modes()),
        a_(grid_.num_modes()),
        cells_(equation.num_cells) {
    for (Index m = 0; m < k_.size(); ++m) {
      k_[m] = M_PI * static_cast<double>(m);
      a_[m] = equation.linear(k_[m]);
    }
  }

  void Begin(const std::function<double(double)>& start) {
    for (Index j = 0; j < cells_.size(); ++j) {
      cells_[j] = start(-1.0 + 2.0 * static_cast<double>(j) /
                                   static_cast<double>(cells_.size()));
    }
    u_.resize(grid_.num_modes());
    grid_.Forward(cells_.data(), u_.data());
  }
  void BeginByModes(const std::function<Complex(int m)>& start) {
    u_.resize(grid_.num_modes());
    // The transform's first cell is at x = -1.
    const auto n = static_cast<double>(cells_.size());
    for (int m = 0; m < u_.size(); ++m) {
      u_[m] = (m % 2 == 0 ? n : -n) * start(m);
    }
  }

  // By equal steps that are at most as long as asked.
  void Advance(double duration) {
    if (duration <= 0.0) return;
    const double count = std::ceil(duration / equation_.time_step - 1e-9);
    const double h = duration / count;
    if (h != h_) {
      h_ = h;
      c_ = MakeCoefficients(a_, h);
    }
    for (double step = 0.0; step < count; step += 1.0) Step();
  }

  // u(x), by the sum of the modes.
  double At(double x) const {
    const auto n = static_cast<double>(cells_.size());
    double sum = u_[0].real();
    const Complex turn = std::polar(1.0, M_PI * (x + 1.0));
    Complex wave = turn;
    for (Index m = 1; m < u_.size(); ++m) {
      const bool is_last = 2 * m == cells_.size();
      sum += (is_last ? 1.0 : 2.0) * (u_[m] * wave).real();
      wave *= turn;
    }
    return sum / n;
  }

 private:
  Modes Nonlinear(const Modes& modes) {
    Modes copy = modes;
    grid_.Backward(copy.data(), cells_.data());
    for (double& value : cells_) value = equation_.nonlinear(value);
    Modes result(modes.size());
    grid_.Forward(cells_.data(), result.data());
    if (equation_.has_derivative) {
      result *= Complex(0.0, 1.0) * k_;
      // The sawtooth of the grid has no derivative on it.
      if (cells_.size() % 2 == 0) result[result.size() - 1] = 0.0;
    }
    return result;
  }

  void Step() {
    const Modes n_u = Nonlinear(u_);
    const Modes a = c_.half * u_ + c_.q * n_u;
    const Modes n_a = Nonlinear(a);
    const Modes b = c_.half * u_ + c_.q * n_a;
    const Modes n_b = Nonlinear(b);
    const Modes c = c_.half * a + c_.q * (2.0 * n_b - n_u);
    const Modes n_c = Nonlinear(c);
    u_ = c_.whole * u_ + c_.f1 * n_u + 2.0 * c_.f2 * (n_a + n_b) + c_.f3 * n_c;
  }

  const PeriodicEvolution& equation_;
  const FourierGrid grid_;
  ArrayXd k_;
  Modes a_;
  ArrayXd cells_;
  Modes u_;
  double h_ = 0.0;
  Coefficients c_;
};

// u at the points, by one evolution that has begun.
Eigen::VectorXd SolveAt(const Eigen::MatrixXd& points, Evolution* evolution) {
  CHECK_EQ(points.rows(), 2);
  std::vector<Index> order(points.cols());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&points](Index i, Index j) {
    return points(0, i) < points(0, j);
  });
  Eigen::VectorXd solution(points.cols());
  double t = 0.0;
  for (const Index s : order) {
    evolution->Advance(points(0, s) - t);
    t = points(0, s);
    solution[s] = evolution->At(points(1, s));
  }
  return solution;
}

}  // namespace

Eigen::VectorXd PeriodicEvolution::Solve(
    const std::function<double(double x)>& start,
    const Eigen::MatrixXd& points) const {
  CHECK_GT(time_step, 0.0);
  Evolution evolution(*this);
  evolution.Begin(start);
  return SolveAt(points, &evolution);
}

Eigen::VectorXd PeriodicEvolution::SolveByModes(
    const std::function<Complex(int m)>& start,
    const Eigen::MatrixXd& points) const {
  CHECK_GT(time_step, 0.0);
  Evolution evolution(*this);
  evolution.BeginByModes(start);
  return SolveAt(points, &evolution);
}

}  // namespace invgrad
