#include "invgrad/chain/loss_on_curve.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "invgrad/internal/logging.h"

namespace invgrad {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::function<LossOnCurve(const VectorXd& t, double eta)> MakeLossOnCurve(
    std::shared_ptr<const Loss> loss,
    MatrixXd outputs,
    MatrixXd targets,
    double scale) {
  CHECK_EQ(outputs.rows(), loss->size());
  CHECK_EQ(outputs.cols(), targets.cols());
  return [loss = std::move(loss),
          outputs = std::move(outputs),
          targets = std::move(targets),
          scale](const VectorXd& t, double eta) {
    CHECK_EQ(t.size(), outputs.size());
    const Eigen::Index size = outputs.rows();
    VectorXd moved(size), velocity(size), gradient(size);
    LossOnCurve sum;
    for (Eigen::Index s = 0; s < outputs.cols(); ++s) {
      loss->Retract(outputs.col(s).data(),
                    t.data() + s * size,
                    eta,
                    moved.data(),
                    velocity.data());
      double value = 0.0;
      if (!loss->Evaluate(moved.data(),
                          targets.col(s).data(),
                          &value,
                          gradient.data(),
                          nullptr)) {
        constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
        return LossOnCurve{kNaN, kNaN, kNaN};
      }
      sum.loss += scale * value;
      sum.slope += scale * gradient.dot(velocity);
      const double length = moved.norm();
      if (length > 0.0) {
        sum.speed = std::max(sum.speed, velocity.norm() / length);
      }
    }
    return sum;
  };
}

}  // namespace invgrad
