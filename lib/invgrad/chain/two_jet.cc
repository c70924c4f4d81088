#include "invgrad/chain/two_jet.h"

#include "glog/logging.h"

namespace invgrad {
namespace {

using Eigen::ArrayXd;
using Eigen::Index;
using Eigen::MatrixXd;

// The jets of g(z) for one sample, from g, g', g'' at the values of z. Channel
// 0 of z is not read, so that z may be the result.
template <typename G, typename Z, typename Result>
void Compose(const G& g,
             const G& slope,
             const G& curvature,
             const ArrayXd& squared_gradient,
             const Z& z,
             Result result) {
  const Index last = z.cols() - 1;
  result.col(0) = g;
  for (Index i = 1; i < last; ++i) result.col(i) = slope * z.col(i);
  result.col(last) = slope * z.col(last) + curvature * squared_gradient;
}

void CheckChannels(int num_channels,
                   const Eigen::Ref<const MatrixXd>& factors,
                   const Eigen::Ref<MatrixXd>& values) {
  CHECK_EQ(factors.rows(), values.rows());
  CHECK_EQ(factors.cols(), values.cols());
  CHECK(num_channels == 1 || num_channels >= NumTwoJetChannels(1));
  CHECK_EQ(values.cols() % num_channels, 0);
}

}  // namespace

MatrixXd JetsOfInputs(const MatrixXd& inputs) {
  const Index d = inputs.rows();
  const Index num_channels = NumTwoJetChannels(static_cast<int>(d));
  MatrixXd jets = MatrixXd::Zero(d, num_channels * inputs.cols());
  for (Index s = 0; s < inputs.cols(); ++s) {
    jets.col(s * num_channels) = inputs.col(s);
    jets.middleCols(s * num_channels + 1, d).setIdentity();
  }
  return jets;
}

void ActivateJets(Activation activation,
                  int num_channels,
                  Eigen::Ref<MatrixXd> z,
                  MatrixXd* slopes,
                  MatrixXd* curvatures) {
  CheckChannels(num_channels, *slopes, z);
  if (curvatures != nullptr) CheckChannels(num_channels, *curvatures, z);
  const int size = static_cast<int>(z.rows());
  if (num_channels == 1) {
    for (Index s = 0; s < z.cols(); ++s) {
      ActivateAll(activation,
                  size,
                  z.col(s).data(),
                  slopes->col(s).data(),
                  curvatures == nullptr ? nullptr : curvatures->col(s).data());
    }
    return;
  }
  ArrayXd d1(size), d2(size), d3(size), d4(size), squared_gradient(size);
  for (Index s = 0; s < z.cols(); s += num_channels) {
    auto jets = z.middleCols(s, num_channels).array();
    ActivateAll(activation,
                size,
                z.col(s).data(),
                d1.data(),
                d2.data(),
                d3.data(),
                curvatures == nullptr ? nullptr : d4.data());
    squared_gradient =
        jets.middleCols(1, num_channels - 2).square().rowwise().sum();
    Compose(d1,
            d2,
            d3,
            squared_gradient,
            jets,
            slopes->middleCols(s, num_channels).array());
    if (curvatures != nullptr) {
      Compose(d2,
              d3,
              d4,
              squared_gradient,
              jets,
              curvatures->middleCols(s, num_channels).array());
    }
    const ArrayXd value = jets.col(0);
    Compose(value, d1, d2, squared_gradient, jets, jets);
  }
}

void MultiplyJets(int num_channels,
                  const Eigen::Ref<const MatrixXd>& factors,
                  Eigen::Ref<MatrixXd> values) {
  CheckChannels(num_channels, factors, values);
  if (num_channels == 1) {
    values.array() *= factors.array();
    return;
  }
  const int last = num_channels - 1;
  for (Index s = 0; s < values.cols(); s += num_channels) {
    const auto f = factors.middleCols(s, num_channels).array();
    auto v = values.middleCols(s, num_channels).array();
    // From the last channel to the first: each channel reads the previous ones.
    v.col(last) = f.col(0) * v.col(last) + f.col(last) * v.col(0);
    for (int i = 1; i < last; ++i) {
      v.col(last) += 2.0 * f.col(i) * v.col(i);
      v.col(i) = f.col(0) * v.col(i) + f.col(i) * v.col(0);
    }
    v.col(0) *= f.col(0);
  }
}

void MultiplyJetsTransposed(int num_channels,
                            const Eigen::Ref<const MatrixXd>& factors,
                            Eigen::Ref<MatrixXd> covectors) {
  CheckChannels(num_channels, factors, covectors);
  if (num_channels == 1) {
    covectors.array() *= factors.array();
    return;
  }
  const int last = num_channels - 1;
  for (Index s = 0; s < covectors.cols(); s += num_channels) {
    const auto f = factors.middleCols(s, num_channels).array();
    auto w = covectors.middleCols(s, num_channels).array();
    // From the first channel to the last: each channel reads the following
    // ones.
    w.col(0) = f.col(0) * w.col(0) + f.col(last) * w.col(last);
    for (int i = 1; i < last; ++i) {
      w.col(0) += f.col(i) * w.col(i);
      w.col(i) = f.col(0) * w.col(i) + 2.0 * f.col(i) * w.col(last);
    }
    w.col(last) *= f.col(0);
  }
}

}  // namespace invgrad
