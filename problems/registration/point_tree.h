// The nearest points of a cloud (nanoflann).
#ifndef PROBLEMS_REGISTRATION_POINT_TREE_H_
#define PROBLEMS_REGISTRATION_POINT_TREE_H_

#include <array>
#include <cstddef>

#include "Eigen/Core"
#include "nanoflann.hpp"

namespace invgrad {

class PointTree {
 public:
  // The points must outlive the tree.
  explicit PointTree(const Eigen::Matrix3Xd& points)
      : points_(points), index_(3, *this) {}

  // What nanoflann reads the points by; the names are its own.
  // NOLINTBEGIN(readability-identifier-naming)
  std::size_t kdtree_get_point_count() const { return points_.cols(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points_(axis, i);
  }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
  // NOLINTEND(readability-identifier-naming)

  // Returns the number of points found, the nearest first.
  template <std::size_t N>
  int Nearest(const Eigen::Vector3d& at,
              std::array<std::size_t, N>* found,
              std::array<double, N>* squared_distances) const {
    return static_cast<int>(index_.knnSearch(
        at.data(), N, found->data(), squared_distances->data()));
  }

 private:
  using Index = nanoflann::KDTreeSingleIndexAdaptor<
      nanoflann::L2_Simple_Adaptor<double, PointTree>,
      PointTree,
      3,
      std::size_t>;

  const Eigen::Matrix3Xd& points_;
  Index index_;
};

}  // namespace invgrad

#endif  // PROBLEMS_REGISTRATION_POINT_TREE_H_
