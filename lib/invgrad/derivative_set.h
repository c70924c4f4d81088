// The derivatives of a network's outputs with respect to a point that a
// differential equation reads. Use it to state these derivatives, in a
// TrialFunction (trial_function.h) or in a Model (model.h). It is a set of
// derivatives that is closed under products.
//
//   j = (v, D_1 v, .., D_{T-1} v),   D_k = d^alpha or a sum of d_i^2
//
//   (s z)_k  = sum_ij c_kij s_i z_j                   Leibniz: c = binomials
//   phi(z)   = sum_p phi^(p)(z_0) / p! n^p            n = (0, z_1, .., z_{T-1})
//
// The jet j has T channels. A network propagates it in its forward pass [1].
// The sum over p ends at the highest order D, because n^(D+1) = 0. The tangent
// of the jet of a = phi(z) is its product with the jet of phi'(z), since da =
// phi'(z) dz. The product is symmetric, so the same holds for curvatures and
// all second derivatives.
//
// The set is stated by words in the letters of the variables: for the variables
// "tx", the words t, x, xx, xxt mean u_t, u_x, u_xx, u_xxt; xx+yy means u_xx +
// u_yy, which has one channel in place of two. Channel 0 is the value, channels
// 1, 2, .. are the words in their order, and those that they need follow: with
// xx also x, with xxt also x, xx, t, xt, with xx+yy also x and y.
//
// Shapes:  matrices have one row per function and T adjacent columns, one per
//          channel, for each sample. Without words T = 1: plain values,
//          multiplied entry by entry.
// Cost:    a product: one operation a term c_kij and entry, 8 for (u, u_t, u_x,
//          u_xx). A composition: as much for each power n^p.
// Fails:   words that are not understood, or of an order above kMaxOrder, are
//          CHECKed.
//
// [1] Li et al. A computational framework for neural network-based variational
//     Monte Carlo with Forward Laplacian. Nature Machine Intelligence 6 (2024).
//     arXiv 2307.08214: the sums d_i^2. Single derivatives: Griewank, Utke,
//     Walther. Evaluating higher derivative tensors by forward propagation of
//     univariate Taylor series. Mathematics of Computation 69 (2000).
#ifndef INVGRAD_DERIVATIVE_SET_H_
#define INVGRAD_DERIVATIVE_SET_H_

#include <memory>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "invgrad/internal/activation.h"

namespace invgrad {

class DerivativeSet {
 public:
  // D. Second derivatives in the weights need two more of phi.
  static constexpr int kMaxOrder = kMaxActivationOrder - 2;

  // Values alone.
  static std::shared_ptr<const DerivativeSet> Values();
  // `variables`: a letter each.
  DerivativeSet(std::string variables, const std::vector<std::string>& words);

  const std::string& variables() const { return variables_; }
  int num_variables() const { return static_cast<int>(variables_.size()); }
  int num_channels() const { return static_cast<int>(channels_.size()); }  // T
  // 1 + the number of words: the first channels.
  int num_stated() const { return num_stated_; }
  int order() const { return order_; }  // D

  // "", "t", "xx+yy". CHECKs that the set has it.
  int ChannelOf(const std::string& word) const;
  const std::string& word(int channel) const { return channels_[channel].word; }
  // Whether the other set has the same variables and channels, in their order.
  bool HasChannelsOf(const DerivativeSet& other) const;

  // The jets of the variables at the points a: d T x N, a column a sample, with
  // the d values of channel 0, then those of channel 1, and so on.
  Eigen::MatrixXd InputJets(const Eigen::MatrixXd& points) const;

  // Replaces the jets of z by the jets of phi(z), and writes the jets of
  // phi'(z) and, unless null, of phi''(z). `slopes` and `curvatures`: as z
  // (CHECKed).
  void Activate(Activation activation,
                Eigen::Ref<Eigen::MatrixXd> z,
                Eigen::MatrixXd* slopes,
                Eigen::MatrixXd* curvatures) const;

  // values = factors values, a product of jets, linear in values for fixed
  // factors. Sizes are the same (CHECKed).
  void Multiply(const Eigen::Ref<const Eigen::MatrixXd>& factors,
                Eigen::Ref<Eigen::MatrixXd> values) const;
  // The transposed map, for covectors.
  void MultiplyTransposed(const Eigen::Ref<const Eigen::MatrixXd>& factors,
                          Eigen::Ref<Eigen::MatrixXd> covectors) const;

  // The jet of phi(z) of one function, for derivatives[p] = phi^(p)(z_0) up to
  // p = D. Both have T entries.
  void Compose(const double* derivatives,
               const double* z,
               double* result) const;

 private:
  // c s_i z_j, i, j > 0.
  struct Term {
    int i;
    int j;
    double c;
  };
  struct Channel {
    std::string word;
    std::vector<int> orders;  // alpha; empty: a sum
    std::vector<int> summed;  // the variables i of a sum of d_i^2
    int order = 0;
    std::vector<Term> terms;
  };

  Channel Parse(const std::string& word) const;
  // The channel with the same derivative, which is added if it is new.
  int Add(const Channel& channel);
  void AddNeeded(int k);
  void AddTerms(int k);
  int Find(const Channel& channel) const;  // -1: none
  void CheckShapes(const Eigen::Ref<const Eigen::MatrixXd>& factors,
                   const Eigen::Ref<Eigen::MatrixXd>& values) const;
  // powers[p - 2] = n^p for the jets z of a sample, p = 2 .. D.
  template <typename Z>
  void ComputePowers(const Z& z, std::vector<Eigen::ArrayXXd>* powers) const;

  std::string variables_;
  std::vector<Channel> channels_;
  std::vector<int> ascending_;  // the channels, by order
  int num_stated_ = 1;
  int order_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_DERIVATIVE_SET_H_
