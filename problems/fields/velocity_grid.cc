#include "problems/fields/velocity_grid.h"

#include <cmath>
#include <complex>
#include <utility>
#include <vector>

#include "glog/logging.h"

namespace invgrad {

using Eigen::ArrayXd;
using Eigen::VectorXd;

namespace {

// A sparse matrix that is filled entry by entry; an index < 0 is left out.
class MapBuilder {
 public:
  void Add(int row, int col, double value) {
    if (row >= 0 && col >= 0) entries_.emplace_back(row, col, value);
  }
  VelocityGrid::Map Build(int rows, int cols) const {
    VelocityGrid::Map map(rows, cols);
    map.setFromTriplets(entries_.begin(), entries_.end());
    return map;
  }

 private:
  std::vector<Eigen::Triplet<double>> entries_;
};

int Wrap(int i, int n) { return (i % n + n) % n; }

}  // namespace

VelocityGrid::VelocityGrid(int rows, int cols, Place place, Box box)
    : box_(box) {
  const bool is_closed = box == Box::kClosed;
  const bool has_faces = place == Place::kFaces;
  CHECK(has_faces || !is_closed) << "a closed box has its velocity on faces";
  CHECK_GT(rows, is_closed ? 1 : 0);
  CHECK_GT(cols, is_closed ? 1 : 0);
  using Outside = Lattice::Outside;
  const Outside outside = is_closed ? Outside::kZero : Outside::kPeriodic;
  const int wall = is_closed ? 1 : 0;
  cells_ = {rows, cols, is_closed ? Outside::kNearest : Outside::kPeriodic};
  components_[0] = {rows, cols - wall, outside};
  components_[1] = {rows - wall, cols, outside};

  const int n = num_cells();
  MapBuilder to_cells, from_cells, divergence;
  std::array<MapBuilder, 2> to_component;
  const auto cell = [&](int i, int j) {
    return Wrap(i, rows) * cols + Wrap(j, cols);
  };
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < cols; ++j) {
      for (int c = 0; c < 2; ++c) {
        const int di = c, dj = 1 - c;  // one step along the component's axis
        const int other = 1 - c;
        const int here = cell(i, j);
        if (!has_faces) {
          to_cells.Add(c * n + here, c * n + here, 1.0);
          from_cells.Add(c * n + here, c * n + here, 1.0);
          for (auto& map : to_component) {
            map.Add(c * n + here, c * n + here, 1.0);
          }
          divergence.Add(here, c * n + cell(i + di, j + dj), 0.5);
          divergence.Add(here, c * n + cell(i - di, j - dj), -0.5);
          continue;
        }
        const int low = Face(c, i, j), high = Face(c, i + di, j + dj);
        for (const int face : {low, high}) {
          to_cells.Add(c * n + here, face, 0.5);
          divergence.Add(here, face, face == high ? 1.0 : -1.0);
        }
        if (low < 0) continue;
        from_cells.Add(low, c * n + here, 0.5);
        from_cells.Add(low, c * n + cell(i - di, j - dj), 0.5);
        // This component on its own faces, and the mean of the four faces of
        // the other one around them.
        const int own = low - c * components_[0].size();
        const int size = components_[c].size();
        to_component[c].Add(c * size + own, low, 1.0);
        for (const int behind : {0, 1}) {
          for (const int far : {0, 1}) {
            const int face = Face(
                other, i - behind * di + far * dj, j - behind * dj + far * di);
            to_component[c].Add(other * size + own, face, 0.25);
          }
        }
      }
    }
  }
  to_cells_ = to_cells.Build(2 * n, size());
  from_cells_ = from_cells.Build(size(), 2 * n);
  divergence_ = divergence.Build(n, size());
  for (int c = 0; c < 2; ++c) {
    to_component_[c] = to_component[c].Build(2 * components_[c].size(), size());
  }
  FillInverseLaplace(has_faces);
}

void VelocityGrid::FillInverseLaplace(bool has_faces) {
  const bool is_closed = box_ == Box::kClosed;
  const int rows = cells_.rows;
  const int cols = cells_.cols;
  // -|wave number|^2 of D G along an axis of n cells.
  const auto symbol = [&](int mode, int count) {
    if (is_closed)
      return -4.0 * std::pow(std::sin(M_PI * mode / (2 * count)), 2);
    if (has_faces) return -4.0 * std::pow(std::sin(M_PI * mode / count), 2);
    return -std::pow(std::sin(2.0 * M_PI * mode / count), 2);
  };
  if (is_closed) {
    cosine_.emplace(rows, cols);
  } else {
    fourier_.emplace(rows, cols);
  }
  const int num_cols = is_closed ? cols : cols / 2 + 1;
  inverse_laplace_.resize(rows * num_cols);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < num_cols; ++j) {
      const double eigenvalue = symbol(i, rows) + symbol(j, cols);
      constexpr double kZero = 1e-12;
      inverse_laplace_[i * num_cols + j] =
          eigenvalue > -kZero ? 0.0 : 1.0 / eigenvalue;
    }
  }
}

// The index in u of the low face of cell (i, j); -1 on a wall.
int VelocityGrid::Face(int c, int i, int j) const {
  const Lattice& faces = components_[c];
  if (box_ == Box::kClosed) {
    (c == 0 ? j : i) -= 1;
    if (i < 0 || j < 0 || i >= faces.rows || j >= faces.cols) return -1;
  }
  return c * components_[0].size() + Wrap(i, faces.rows) * faces.cols +
         Wrap(j, faces.cols);
}

VectorXd VelocityGrid::Component(const VectorXd& u, int c) const {
  return u.segment(c * components_[0].size(), components_[c].size());
}

Eigen::VectorBlock<VectorXd> VelocityGrid::Part(VectorXd* u, int c) const {
  return u->segment(c * components_[0].size(), components_[c].size());
}

VectorXd VelocityGrid::Project(const VectorXd& u) const {
  VectorXd p = divergence_ * u;
  if (fourier_.has_value()) {
    Eigen::ArrayXcd modes(fourier_->num_modes());
    fourier_->Forward(p.data(), modes.data());
    modes *= inverse_laplace_;
    fourier_->Backward(modes.data(), p.data());
  } else {
    ArrayXd modes(num_cells());
    cosine_->Forward(p.data(), modes.data());
    modes *= inverse_laplace_;
    cosine_->Backward(modes.data(), p.data());
  }
  return u + divergence_.transpose() * p;
}

}  // namespace invgrad
