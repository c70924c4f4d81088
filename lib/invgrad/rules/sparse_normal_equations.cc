// J^T J by blocks (block_gram.h). The independent blocks e are eliminated one by
// one, the rest, f, by CHOLMOD:
//
//   A = | C  E^T |    C = L L^T, block diagonal
//       | E  F   |
//
//   W = E L^-T,   S = F - W W^T
//   x_f = S^-1 (b_f - W L^-1 b_e),   x_e = L^-T (L^-1 b_e - W^T x_f)
//
// S is the Schur complement of bundle adjustment. Without independent blocks it
// is A.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "Eigen/SparseCore"
#include "invgrad/core/cholmod_factor.h"
#include "invgrad/internal/logging.h"
#include "invgrad/rules/block_gram.h"
#include "invgrad/rules/damped_normal_equations.h"
#include "invgrad/stored_jacobian.h"

namespace invgrad {
namespace {

using Eigen::VectorXd;

class SparseNormalEquations final : public DampedNormalEquations {
 public:
  bool SetJacobian(const JacobianOperator& J,
                   double c,
                   std::string* error) override {
    J_ = dynamic_cast<const SparseJacobian*>(&J);
    CHECK(J_ != nullptr);
    c_ = c;
    squared_norm_ = Eigen::Map<const VectorXd>(J_->matrix().valuePtr(),
                                               J_->matrix().nonZeros())
                        .squaredNorm();
    if (!std::isfinite(squared_norm_)) {
      *error = "the Jacobian is not finite";
      return false;
    }
    if (!gram_.HasPatternOf(*J_) &&
        !(gram_.Analyze(*J_, error) && AnalyzeRest(error))) {
      gram_ = BlockGram();  // the next J is analyzed, too
      return false;
    }
    gram_.Fill(*J_);
    return true;
  }

  double Norm() const override { return std::sqrt(squared_norm_); }

  bool LimitBend(const VectorXd& v, VectorXd* a) const override {
    constexpr double kLongest = 0.375;
    for (const Block& block : gram_.blocks()) {
      double v_square = 0.0;
      double a_square = 0.0;
      for (int k = 0; k < block.size; ++k) {
        const double D =
            gram_.entries()[block.first_entry + k * (block.height + 1)];
        const int column = block.column + k;
        v_square += D * v[column] * v[column];
        a_square += D * (*a)[column] * (*a)[column];
      }
      if (a_square > kLongest * kLongest * v_square) {
        a->segment(block.column, block.size) *=
            kLongest * std::sqrt(v_square / a_square);
      }
    }
    return true;
  }

  bool Factorize(double lambda) override {
    panels_ = gram_.entries();
    for (double& entry : panels_) entry *= c_;
    for (const Block& block : gram_.blocks()) {
      for (int k = 0; k < block.size; ++k) {
        double& entry = panels_[block.first_entry + k * (block.height + 1)];
        entry = entry > 0.0 ? (1.0 + lambda) * entry : 1.0;
      }
    }
    CopyRest();
    for (int e = 0; e < gram_.num_independent(); ++e) {
      if (!Eliminate(e)) return false;
    }
    if (rest_.cols() == 0) return true;
    cholmod_sparse view = CholmodView(&rest_, /*stype=*/-1);
    std::string ignored;
    return factor_.Factorize(&view, &ignored);
  }

  VectorXd Solve(const VectorXd& w) const override {
    VectorXd x;
    J_->TransposeTimes(w, &x);
    const int num_independent = gram_.num_independent();
    for (int e = 0; e < num_independent; ++e) SolveForward(e, &x);
    if (rest_.cols() > 0) {
      VectorXd rest(rest_.cols());
      VisitRest([&](int at, const Block& block) {
        rest.segment(at, block.size) = x.segment(block.column, block.size);
      });
      rest = factor_.Solve(rest);
      VisitRest([&](int at, const Block& block) {
        x.segment(block.column, block.size) = rest.segment(at, block.size);
      });
    }
    for (int e = num_independent - 1; e >= 0; --e) SolveBackward(e, &x);
    return x;
  }

 private:
  using Block = BlockGram::Block;
  using Pairs = std::vector<std::pair<int, int>>;

  // A part of S: the columns and rows of two blocks.
  struct RestPart {
    int first_entry = 0;  // in rest_
    int height = 0;       // of the column
  };

  const Block& RowBlock(const Block& block, int k) const {
    return gram_.blocks()[gram_.row_blocks()[block.first_row_block + k]];
  }

  // visit(first row of the block in S, block)
  template <typename Visit>
  void VisitRest(const Visit& visit) const {
    int at = 0;
    for (std::size_t f = gram_.num_independent(); f < gram_.blocks().size();
         ++f) {
      visit(at, gram_.blocks()[f]);
      at += gram_.blocks()[f].size;
    }
  }

  // b_e becomes L^-1 b_e, and b_f loses W L^-1 b_e.
  void SolveForward(int e, VectorXd* b) const {
    const Block& block = gram_.blocks()[e];
    double* const b_e = b->data() + block.column;
    for (int j = 0; j < block.size; ++j) {
      const double* const column =
          panels_.data() + block.first_entry + j * block.height;
      b_e[j] /= column[j];
      for (int r = j + 1; r < block.size; ++r) b_e[r] -= column[r] * b_e[j];
      const double* W = column + block.size;
      for (int k = 1; k < block.num_row_blocks; ++k) {
        const Block& other = RowBlock(block, k);
        double* const b_f = b->data() + other.column;
        for (int r = 0; r < other.size; ++r) b_f[r] -= W[r] * b_e[j];
        W += other.size;
      }
    }
  }

  // x_e becomes L^-T (x_e - W^T x_f).
  void SolveBackward(int e, VectorXd* x) const {
    const Block& block = gram_.blocks()[e];
    double* const x_e = x->data() + block.column;
    for (int j = block.size - 1; j >= 0; --j) {
      const double* const column =
          panels_.data() + block.first_entry + j * block.height;
      double sum = x_e[j];
      for (int r = j + 1; r < block.size; ++r) sum -= column[r] * x_e[r];
      const double* W = column + block.size;
      for (int k = 1; k < block.num_row_blocks; ++k) {
        const Block& other = RowBlock(block, k);
        const double* const x_f = x->data() + other.column;
        for (int r = 0; r < other.size; ++r) sum -= W[r] * x_f[r];
        W += other.size;
      }
      x_e[j] = sum / column[j];
    }
  }

  bool AnalyzeRest(std::string* error) {
    const Pairs pairs = RestPairs();
    FillPattern(pairs);
    FindParts(pairs);
    if (rest_.cols() == 0) return true;
    cholmod_sparse view = CholmodView(&rest_, /*stype=*/-1);
    return factor_.Analyze(&view, Order(pairs), error);
  }

  // visit(column block, row block) for the parts of S that the panel of block b
  // changes, in the order in which CopyRest and Eliminate use them.
  template <typename Visit>
  void VisitParts(int b, const Visit& visit) const {
    const Block& block = gram_.blocks()[b];
    const int* const rows = gram_.row_blocks().data() + block.first_row_block;
    if (b >= gram_.num_independent()) {
      for (int k = 0; k < block.num_row_blocks; ++k) visit(b, rows[k]);
      return;
    }
    for (int k = 1; k < block.num_row_blocks; ++k) {
      for (int l = k; l < block.num_row_blocks; ++l) visit(rows[k], rows[l]);
    }
  }

  // The blocks of S that are not zero: column block, row block; sorted.
  Pairs RestPairs() const {
    Pairs pairs;
    for (int b = 0; b < static_cast<int>(gram_.blocks().size()); ++b) {
      VisitParts(b, [&pairs](int column_block, int row_block) {
        pairs.emplace_back(column_block, row_block);
      });
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    return pairs;
  }

  // Of S, its parts, and the entries on its diagonal's blocks.
  void FillPattern(const Pairs& pairs) {
    const std::vector<Block>& blocks = gram_.blocks();
    const int num_independent = gram_.num_independent();
    std::vector<int> columns(blocks.size(), 0);
    int n = 0;
    for (std::size_t f = num_independent; f < blocks.size(); ++f) {
      columns[f] = n;
      n += blocks[f].size;
    }
    std::vector<int> outer = {0};
    std::vector<int> inner;
    parts_of_pairs_.clear();
    for (std::size_t begin = 0; begin < pairs.size();) {
      const int column_block = pairs[begin].first;
      std::size_t end = begin;
      int height = 0;
      while (end < pairs.size() && pairs[end].first == column_block) {
        height += blocks[pairs[end++].second].size;
      }
      int first_entry = static_cast<int>(inner.size());
      for (std::size_t k = begin; k < end; ++k) {
        parts_of_pairs_.push_back({first_entry, height});
        first_entry += blocks[pairs[k].second].size;
      }
      for (int c = 0; c < blocks[column_block].size; ++c) {
        for (std::size_t k = begin; k < end; ++k) {
          const int row_block = pairs[k].second;
          for (int r = 0; r < blocks[row_block].size; ++r) {
            inner.push_back(columns[row_block] + r);
          }
        }
        outer.push_back(static_cast<int>(inner.size()));
      }
      begin = end;
    }
    rest_.resize(n, n);
    rest_.resizeNonZeros(static_cast<Eigen::Index>(inner.size()));
    std::copy(outer.begin(), outer.end(), rest_.outerIndexPtr());
    std::copy(inner.begin(), inner.end(), rest_.innerIndexPtr());
  }

  void FindParts(const Pairs& pairs) {
    const auto part = [&](int column_block, int row_block) {
      const auto at = std::lower_bound(
          pairs.begin(), pairs.end(), std::pair(column_block, row_block));
      return parts_of_pairs_[at - pairs.begin()];
    };
    parts_of_panels_.clear();
    first_parts_.clear();
    for (int b = 0; b < static_cast<int>(gram_.blocks().size()); ++b) {
      first_parts_.push_back(static_cast<int>(parts_of_panels_.size()));
      VisitParts(b, [&](int column_block, int row_block) {
        parts_of_panels_.push_back(part(column_block, row_block));
      });
    }
  }

  // AMD's of the graph of the blocks, as Ceres has it.
  std::vector<int> Order(const Pairs& pairs) const {
    const int first = gram_.num_independent();
    const int num_blocks = static_cast<int>(gram_.blocks().size()) - first;
    Eigen::SparseMatrix<double> graph(num_blocks, num_blocks);
    graph.resizeNonZeros(static_cast<Eigen::Index>(pairs.size()));
    int* const outer = graph.outerIndexPtr();
    std::fill_n(outer, num_blocks + 1, 0);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      graph.innerIndexPtr()[k] = pairs[k].second - first;
      ++outer[pairs[k].first - first + 1];
    }
    std::partial_sum(outer, outer + num_blocks + 1, outer);
    cholmod_sparse view = CholmodView(&graph, /*stype=*/-1);
    view.xtype = CHOLMOD_PATTERN;
    std::vector<int> places(num_blocks);
    CHECK(cholmod_amd(&view, nullptr, 0, places.data(), factor_.common()));
    std::vector<int> columns;
    int column = 0;
    for (int f = 0; f < num_blocks; ++f) {
      columns.push_back(column);
      column += gram_.blocks()[first + f].size;
    }
    std::vector<int> order;
    for (const int f : places) {
      for (int c = 0; c < gram_.blocks()[first + f].size; ++c) {
        order.push_back(columns[f] + c);
      }
    }
    return order;
  }

  // S = F
  void CopyRest() {
    double* const S = rest_.valuePtr();
    std::fill_n(S, rest_.nonZeros(), 0.0);
    for (std::size_t b = gram_.num_independent(); b < gram_.blocks().size();
         ++b) {
      const Block& block = gram_.blocks()[b];
      const double* from = panels_.data() + block.first_entry;
      for (int k = 0; k < block.num_row_blocks; ++k) {
        const RestPart& part = parts_of_panels_[first_parts_[b] + k];
        const int num_rows = RowBlock(block, k).size;
        for (int c = 0; c < block.size; ++c) {
          std::copy_n(from + c * block.height,
                      num_rows,
                      S + part.first_entry + c * part.height);
        }
        from += num_rows;
      }
    }
  }

  // The panel of block e becomes L and W, and S loses W W^T. Returns false if C
  // is not positive definite.
  bool Eliminate(int e) {
    const Block& block = gram_.blocks()[e];
    const int height = block.height;
    double* const panel = panels_.data() + block.first_entry;
    for (int j = 0; j < block.size; ++j) {
      double* const column = panel + j * height;
      const double root = std::sqrt(column[j]);
      if (!(root > 0.0)) return false;
      for (int r = j; r < height; ++r) column[r] /= root;
      for (int k = j + 1; k < block.size; ++k) {
        double* const later = panel + k * height;
        for (int r = k; r < height; ++r) later[r] -= column[k] * column[r];
      }
    }
    const RestPart* part = parts_of_panels_.data() + first_parts_[e];
    int column = block.size;
    for (int k = 1; k < block.num_row_blocks; ++k) {
      const int num_columns = RowBlock(block, k).size;
      int row = column;
      for (int l = k; l < block.num_row_blocks; ++l, ++part) {
        const int num_rows = RowBlock(block, l).size;
        for (int c = 0; c < num_columns; ++c) {
          double* const S =
              rest_.valuePtr() + part->first_entry + c * part->height;
          for (int j = 0; j < block.size; ++j) {
            const double* const W = panel + j * height;
            for (int r = 0; r < num_rows; ++r) {
              S[r] -= W[column + c] * W[row + r];
            }
          }
        }
        row += num_rows;
      }
      column += num_columns;
    }
    return true;
  }

  const SparseJacobian* J_ = nullptr;
  double c_ = 1.0;
  double squared_norm_ = 0.0;
  BlockGram gram_;
  std::vector<double> panels_;        // c J^T J + lambda D, then L and W
  Eigen::SparseMatrix<double> rest_;  // S, lower triangle
  std::vector<RestPart> parts_of_pairs_;
  // Of a block f, for each row block of its panel; of a block e, for each pair
  // of them.
  std::vector<RestPart> parts_of_panels_;
  std::vector<int> first_parts_;
  CholmodFactor factor_;
};

}  // namespace

std::unique_ptr<DampedNormalEquations> MakeSparseNormalEquations() {
  return std::make_unique<SparseNormalEquations>();
}

}  // namespace invgrad
