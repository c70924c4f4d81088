#include <cmath>

#include "invgrad/internal/logging.h"
#include "invgrad/trial_function.h"

namespace invgrad {
namespace {

using Eigen::Index;

InputJet Scaled(const Box& box, Index i, const InputJet& a) {
  return (2.0 * a - (box.lower[i] + box.upper[i])) /
         (box.upper[i] - box.lower[i]);
}

}  // namespace

Features ScaledFeatures(const Box& box) {
  const Index d = box.lower.size();
  return {static_cast<int>(d), [box, d](const InputJet* a, InputJet* f) {
            for (Index i = 0; i < d; ++i) f[i] = Scaled(box, i, a[i]);
          }};
}

Features PeriodicFeatures(const Box& box,
                          int coordinate,
                          double period,
                          int num_waves) {
  const Index d = box.lower.size();
  CHECK_GE(coordinate, 0);
  CHECK_LT(coordinate, d);
  CHECK_GT(period, 0.0);
  CHECK_GT(num_waves, 0);
  return {static_cast<int>(d) - 1 + 2 * num_waves,
          [=](const InputJet* a, InputJet* f) {
            for (Index i = 0; i < d; ++i) {
              if (i != coordinate) {
                *f++ = Scaled(box, i, a[i]);
                continue;
              }
              for (int k = 1; k <= num_waves; ++k) {
                const InputJet angle =
                    2.0 * M_PI * k / period * (a[i] - box.lower[i]);
                *f++ = cos(angle);
                *f++ = sin(angle);
              }
            }
          }};
}

Features FourierFeatures(const Eigen::MatrixXd& frequencies) {
  const Index size = frequencies.rows();
  return {static_cast<int>(2 * size), [=](const InputJet* a, InputJet* f) {
            for (Index j = 0; j < size; ++j) {
              InputJet angle;
              for (Index i = 0; i < frequencies.cols(); ++i) {
                angle += frequencies(j, i) * a[i];
              }
              f[j] = cos(angle);
              f[size + j] = sin(angle);
            }
          }};
}

}  // namespace invgrad
