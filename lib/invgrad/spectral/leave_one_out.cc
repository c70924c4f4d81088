#include "invgrad/spectral/leave_one_out.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "fmt/core.h"
#include "invgrad/core/finite.h"
#include "invgrad/core/memory_limit.h"
#include "invgrad/internal/logging.h"
#include "invgrad/spectral/routes/gram_matrix.h"
#include "invgrad/spectral/routes/left_out_changes.h"
#include "invgrad/spectral/routes/spectral_routes.h"
#include "invgrad/spectral/routes/stieltjes_quadrature.h"

namespace invgrad {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The middles of `count` equal parts of 0 .. size - 1.
std::vector<int> EvenlySpaced(int count, int size) {
  std::vector<int> chosen(count);
  for (int i = 0; i < count; ++i) {
    chosen[i] = static_cast<int>((2L * i + 1) * size / (2L * count));
  }
  return chosen;
}

}  // namespace

LeaveOneOutScore& LeaveOneOutScore::operator+=(const LeaveOneOutScore& other) {
  g_c += other.g_c;
  c_c += other.c_c;
  c_H_c += other.c_H_c;
  g_g += other.g_g;
  g_fitted += other.g_fitted;
  return *this;
}

double LeaveOneOutScore::StepSize() const {
  return g_c > 0.0 && c_H_c > 0.0 ? g_c / c_H_c : 0.0;
}

double LeaveOneOutScore::RelativeDecrease() const {
  return g_c > 0.0 && c_c > 0.0 ? (g_c / c_c) * (g_c / g_g) : 0.0;
}

double LeaveOneOutScore::Generalization() const {
  return g_fitted > 0.0 ? g_c / g_fitted : 0.0;
}

bool LeaveOneOut::Factorize(const JacobianOperator& J,
                            const VectorXd& g,
                            const std::vector<int>& rows_of_samples,
                            const LeaveOneOutOptions& options,
                            std::string* message) {
  CHECK_EQ(g.size(), J.rows());
  CHECK_GT(J.rows(), 0);
  CHECK_GT(J.cols(), 0);
  CHECK(options.tolerance > 0.0 && options.tolerance < 1.0)
      << options.tolerance;
  CHECK_GE(options.max_num_samples, 0);
  is_factorized_ = false;
  options_ = options;
  g_ = g;
  first_rows_.assign(1, 0);
  for (const int rows : rows_of_samples) {
    CHECK_GT(rows, 0) << "A sample has at least one row.";
    first_rows_.push_back(first_rows_.back() + rows);
  }
  CHECK_EQ(first_rows_.back(), J.rows()) << "The samples' rows are those of J.";
  const auto num_samples = static_cast<int>(rows_of_samples.size());
  chosen_ = EvenlySpaced(options.max_num_samples == 0
                             ? num_samples
                             : std::min(options.max_num_samples, num_samples),
                         num_samples);
  Index num_rows = 0;
  for (const int i : chosen_) num_rows += rows_of_samples[i];

  if (J.communicator() != nullptr) {
    *message = "leaving out samples needs all rows of J in one process";
    return false;
  }
  if (!CheckCovectorFinite(J, g, message)) return false;
  const Index m = J.rows();
  const Index n = J.cols();
  is_parameter_side_ = n < m;
  const Index size = std::min(m, n);
  const auto bytes = [](Index rows, Index cols) {
    return sizeof(double) * static_cast<double>(rows) *
           static_cast<double>(cols);
  };
  if (!FitsInMemory(
          fmt::format("leaving out samples with J {} x {}", m, n),
          {{"Gram matrix and its reduction",
            bytes(size, size) + Tridiagonalization::Bytes(
                                    static_cast<double>(size),
                                    Tridiagonalization::Method::kOneStage)},
           {"rows of the samples", 2.0 * bytes(size, num_rows)},
           {"dense J", is_parameter_side_ ? 2.0 * bytes(m, n) : 0.0}},
          options.memory_limit,
          message)) {
    return false;
  }
  VectorXd diagonal;
  if (!SmallerGram(
          J, ColumnStrips(size, nullptr), &K_, &diagonal, &unit_, message)) {
    return false;
  }
  if (unit_ == 0.0) {
    VectorXd gradient;
    J.TransposeTimes(g, &gradient);
    is_factorized_ = gradient.isZero(0.0);
    if (!is_factorized_) *message = "the squares of J's entries underflow";
    return is_factorized_;
  }
  reduction_.Compute(&K_, Tridiagonalization::Method::kOneStage);
  resolution_ = GramResolution(m, n);
  ReadSpectrum();

  const double root_unit = std::sqrt(unit_);
  MatrixXd dense;
  if (is_parameter_side_) J.ToDense(&dense);
  W_.setZero(size, num_rows);
  Index column = 0;
  for (const int i : chosen_) {
    for (int row = first_rows_[i]; row < first_rows_[i + 1]; ++row, ++column) {
      if (is_parameter_side_) {
        W_.col(column) = dense.row(row).transpose() / root_unit;
      } else {
        W_(row, column) = 1.0;
      }
    }
  }
  reduction_.ApplyQTranspose(&W_);
  if (is_parameter_side_) {
    J.TransposeTimes(g, &b_);
    b_ /= root_unit;
  } else {
    b_ = g;
  }
  reduction_.ApplyQTranspose(&b_);
  is_factorized_ = true;
  return true;
}

void LeaveOneOut::ReadSpectrum() {
  Tridiagonal T;
  T.Set(reduction_.diagonal(), reduction_.off_diagonal());
  lambda_max_ = T.Eigenvalue(T.size() - 1);
  const double resolved = resolution_ * lambda_max_;
  int num_null = 0;
  T.CountBelow(&resolved, 1, &num_null);
  has_null_space_ = is_parameter_side_ || num_null > 0;
  smallest_ = T.Eigenvalue(std::min(num_null, T.size() - 1));
}

LeaveOneOut::Mixture LeaveOneOut::MixtureOf(const SpectralFilter& filter,
                                            std::vector<double>* shifts,
                                            LeaveOneOutSummary* summary) const {
  Mixture mixture;
  mixture.exponent = filter.Exponent();
  if (mixture.exponent == 0.0) return mixture;
  double damping =
      filter.damping / unit_ + filter.relative_damping * lambda_max_;
  if (filter.tau > 0.0) {
    damping += filter.tau * filter.tau * lambda_max_;
    summary->message = fmt::format("{} at tau={:g} as damping tau^2 s_max^2",
                                   filter.clamp ? "clamping" : "truncation",
                                   filter.tau);
  }
  const double least = std::sqrt(resolution_ * smallest_ * lambda_max_);
  if (has_null_space_ && damping < least) {
    damping = least;
    summary->message += fmt::format(
        "{}damping raised to {:.2g} s_max^2: J J^T has values that "
        "are not resolved from zero",
        summary->message.empty() ? "" : "; ",
        damping / lambda_max_);
  }
  summary->damping = damping * unit_;
  std::vector<StieltjesNode> nodes;
  StieltjesQuadrature(mixture.exponent,
                      damping + (has_null_space_ ? 0.0 : smallest_),
                      damping + lambda_max_ * (1.0 + resolution_),
                      options_.tolerance,
                      &nodes);
  for (const StieltjesNode& node : nodes) {
    mixture.indices.push_back(static_cast<int>(shifts->size()));
    mixture.weights.push_back(node.weight);
    shifts->push_back(damping + node.z);
  }
  summary->num_shifts = static_cast<int>(nodes.size());
  summary->quadrature_error =
      mixture.exponent == 1.0 ? 0.0 : options_.tolerance;
  return mixture;
}

void LeaveOneOut::LeaveOutOfGradient(const Eigen::Ref<const MatrixXd>& W,
                                     const Eigen::Ref<const VectorXd>& g_i,
                                     VectorXd* left_out,
                                     VectorXd* fitted) const {
  const VectorXd own = W * g_i;
  VectorXd others = b_ - own;
  VectorXd all = b_;
  if (!is_parameter_side_) {
    Tridiagonal T;
    T.Set(reduction_.diagonal(), reduction_.off_diagonal());
    T.Times(VectorXd(others), &others);
    T.Times(b_, &all);
  }
  *left_out = W.transpose() * others;
  *fitted = W.transpose() * all;
}

void LeaveOneOut::SumUp(const VectorXd& change,
                        const VectorXd& fitted,
                        LeaveOneOutScore* score) const {
  for (const int i : chosen_) {
    const Index first = first_rows_[i];
    const Index rows = first_rows_[i + 1] - first;
    const auto g_i = g_.segment(first, rows);
    score->g_c += g_i.dot(change.segment(first, rows));
    score->g_g += g_i.squaredNorm();
    score->g_fitted += g_i.dot(fitted.segment(first, rows));
  }
  score->c_c = change.squaredNorm();
  score->c_H_c = options_.loss_hessian_times
                     ? change.dot(options_.loss_hessian_times(change))
                     : score->c_c;
}

bool LeaveOneOut::Evaluate(const std::vector<SpectralFilter>& filters,
                           MatrixXd* changes,
                           std::vector<LeaveOneOutSummary>* summaries) const {
  CHECK(is_factorized_) << "Factorize comes first.";
  const auto num_filters = static_cast<Index>(filters.size());
  const Index m = g_.size();
  changes->setZero(m, num_filters);
  summaries->assign(num_filters, LeaveOneOutSummary());
  MatrixXd all_fitted = MatrixXd::Zero(m, num_filters);

  std::vector<double> shifts;
  std::vector<Mixture> mixtures;
  for (Index k = 0; k < num_filters; ++k) {
    std::string invalid;
    CHECK(filters[k].IsValid(&invalid)) << invalid;
    CHECK_EQ(filters[k].noise, 0.0) << "A Wiener factor cannot be left out.";
    if (unit_ == 0.0) continue;
    mixtures.push_back(MixtureOf(filters[k], &shifts, &(*summaries)[k]));
  }
  // Each shift once.
  std::vector<double> distinct = shifts;
  std::sort(distinct.begin(), distinct.end());
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  for (Mixture& mixture : mixtures) {
    for (int& index : mixture.indices) {
      index = static_cast<int>(
          std::lower_bound(distinct.begin(), distinct.end(), shifts[index]) -
          distinct.begin());
    }
  }
  std::unique_ptr<LeftOutChanges> resolvents;
  if (!distinct.empty()) {
    resolvents = std::make_unique<LeftOutChanges>(reduction_.diagonal(),
                                                  reduction_.off_diagonal(),
                                                  distinct,
                                                  is_parameter_side_);
  }
  MatrixXd left_out;
  MatrixXd fitted;
  VectorXd left_out_of_gradient;
  VectorXd fitted_of_gradient;
  Index column = 0;
  for (const int i : chosen_) {
    if (unit_ == 0.0) break;
    const Index first = first_rows_[i];
    const Index rows = first_rows_[i + 1] - first;
    const auto W = W_.middleCols(column, rows);
    const auto g_i = g_.segment(first, rows);
    column += rows;
    if (resolvents != nullptr) {
      resolvents->Compute(W, b_, g_i, &left_out, &fitted);
    }
    for (Index k = 0; k < num_filters; ++k) {
      const Mixture& mixture = mixtures[k];
      auto c_i = changes->col(k).segment(first, rows);
      auto fitted_i = all_fitted.col(k).segment(first, rows);
      if (mixture.indices.empty()) {
        LeaveOutOfGradient(W, g_i, &left_out_of_gradient, &fitted_of_gradient);
        c_i = left_out_of_gradient;
        fitted_i = fitted_of_gradient;
      }
      for (size_t j = 0; j < mixture.indices.size(); ++j) {
        c_i += mixture.weights[j] * left_out.col(mixture.indices[j]);
        fitted_i += mixture.weights[j] * fitted.col(mixture.indices[j]);
      }
    }
  }
  for (Index k = 0; k < num_filters; ++k) {
    LeaveOneOutSummary& summary = (*summaries)[k];
    if (unit_ != 0.0) {
      const double scale = std::pow(unit_, 1.0 - mixtures[k].exponent);
      changes->col(k) *= scale;
      all_fitted.col(k) *= scale;
    }
    // Without rounding, where nothing is left in.
    if (first_rows_.size() == 2) changes->col(k).setZero();
    if (!CheckFinite("c", changes->col(k), &summary.message)) return false;
    SumUp(changes->col(k), all_fitted.col(k), &summary.score);
  }
  return true;
}

bool LeaveOneOutChange(const JacobianOperator& J,
                       const VectorXd& g,
                       const std::vector<int>& rows_of_samples,
                       const SpectralFilter& filter,
                       const LeaveOneOutOptions& options,
                       VectorXd* change,
                       LeaveOneOutSummary* summary) {
  *summary = LeaveOneOutSummary();
  LeaveOneOut leave_one_out;
  if (!leave_one_out.Factorize(
          J, g, rows_of_samples, options, &summary->message)) {
    return false;
  }
  MatrixXd changes;
  std::vector<LeaveOneOutSummary> summaries;
  const bool success = leave_one_out.Evaluate({filter}, &changes, &summaries);
  *change = changes.col(0);
  *summary = summaries[0];
  return success;
}

}  // namespace invgrad
