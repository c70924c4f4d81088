// A manifold that replaces the next step it is given by a staged one.
//
//   Plus(x, delta) = own.Plus(x, staged)   once, if a step is staged
//                    own.Plus(x, delta)    otherwise
//
// `own` is the parameter block's own manifold, or Euclidean space if it has
// none. Ceres calls a manifold for each residual block in each evaluation, so
// the object is small and computes the Euclidean case itself.
//
// Ownership: a ceres::Problem deletes its manifolds or does not, depending on
// Problem::Options::manifold_ownership, which Ceres 2.1 does not reveal. Both
// are correct here. A manifold that a problem no longer uses is kept for the
// next use by the same problem; if the problem owns it, the problem deletes it
// in its destructor. So nothing is deleted twice; a problem that does not own
// its manifolds leaves 64 bytes for each parameter block behind, and the next
// problem at the same address uses them.
#ifndef INVGRAD_CERES_STAGING_MANIFOLD_H_
#define INVGRAD_CERES_STAGING_MANIFOLD_H_

#include <vector>

#include "ceres/manifold.h"
#include "ceres/problem.h"

namespace invgrad {

class StagingManifold final : public ceres::Manifold {
 public:
  // `num` manifolds for blocks of `problem`; Init must be called on each. They
  // must be given back, after the problem's blocks no longer use them.
  static std::vector<StagingManifold*> Take(const ceres::Problem& problem,
                                            std::size_t num);
  static void GiveBack(const std::vector<StagingManifold*>& manifolds);

  ~StagingManifold() override;

  // `own` is null for a Euclidean block; not owned.
  void Init(int ambient_size, const ceres::Manifold* own);

  // `step` must live until it is used or cleared.
  void Stage(const double* step) { staged_ = step; }
  void Clear() { staged_ = nullptr; }
  bool is_staged() const { return staged_ != nullptr; }

  int AmbientSize() const override { return ambient_size_; }
  int TangentSize() const override { return tangent_size_; }
  bool Plus(const double* x,
            const double* delta,
            double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool RightMultiplyByPlusJacobian(const double* x,
                                   int num_rows,
                                   const double* ambient_matrix,
                                   double* tangent_matrix) const override;
  bool Minus(const double* y,
             const double* x,
             double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;

 private:
  explicit StagingManifold(const void* problem) : problem_(problem) {}
  void SetIdentity(double* matrix) const;

  int ambient_size_ = 0;
  int tangent_size_ = 0;
  const ceres::Manifold* own_ = nullptr;
  mutable const double* staged_ = nullptr;
  const void* problem_;    // its identity
  bool is_in_use_ = true;  // between Take and GiveBack
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_STAGING_MANIFOLD_H_
