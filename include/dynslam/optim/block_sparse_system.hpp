// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace dynslam {

/// A sparse symmetric positive definite matrix of B x B blocks, and the linear system with it: what a graph
/// of poses makes of least squares. Its order (approximate minimum degree, Amestoy et al. 1996) and the
/// pattern of its factor are found once, on blocks; the factor L L^T is computed from left to right.
template <std::floating_point S, int B>
class BlockSparseSystem {
 public:
  static constexpr std::size_t kBlock = std::size_t(B) * B;
  using Block = std::array<S, kBlock>;  ///< column by column

  /// Makes it n x n blocks and zero.
  /// @param pairs  rows and columns that have a block off the diagonal, in any order, repeated or not; the
  ///               diagonal has all of its blocks
  void reset(int n, std::span<const std::array<int, 2>> pairs) {
    n_ = n;
    set_pattern(pairs);
    set_order();
    set_factor_pattern();
    blocks_.assign(rows_.size(), Block{});
  }
  [[nodiscard]] int size() const { return n_; }

  /// Place of the block (row, column), row >= column, that reset() was told of.
  [[nodiscard]] std::size_t place(int row, int column) const {
    const auto first = rows_.begin() + begin_[index(column)],
               last = rows_.begin() + begin_[index(column) + 1];
    return index(std::lower_bound(first, last, row) - rows_.begin());
  }
  /// Of a block on the diagonal; its lower triangle is read.
  [[nodiscard]] std::size_t diagonal(int column) const { return index(begin_[index(column)]); }
  [[nodiscard]] Block& block(std::size_t place) { return blocks_[place]; }
  void set_zero() { std::fill(blocks_.begin(), blocks_.end(), Block{}); }

  /// Factors the matrix, which stays as it is.
  /// @return false where it is not positive definite by more than rounding: some pivot is not above 10
  ///         epsilon of the element it was on the diagonal, or a number is not finite. Nothing may be solved
  ///         then.
  [[nodiscard]] bool factor() {
    std::fill(factor_.begin(), factor_.end(), Block{});
    for (std::size_t k = 0; k < blocks_.size(); ++k) {
      if (transposed_[k] != 0) {
        copy_transposed(blocks_[k], factor_[target_[k]]);
      } else {
        factor_[target_[k]] = blocks_[k];
      }
    }
    std::fill(head_.begin(), head_.end(), -1);
    for (int j = 0; j < n_; ++j) {
      const Column before = diagonal_of(factor_[index(column_begin_[index(j)])]);
      subtract_columns(j);
      if (!finish_column(j, before)) return false;
    }
    return true;
  }

  /// Solves with the factor. @param x  the right side, and the solution afterwards
  void solve(std::span<S> x) {
    for (int j = 0; j < n_; ++j) std::copy_n(x.begin() + B * order_[index(j)], B, work_.begin() + B * j);
    for (int j = 0; j < n_; ++j) {
      S* const at = work_.data() + B * j;
      const auto [begin, end] = column_range(j);
      solve_lower(factor_[begin], at);
      for (std::size_t p = begin + 1; p < end; ++p)
        subtract_product(factor_[p], at, work_.data() + B * row_[p]);
    }
    for (int j = n_ - 1; j >= 0; --j) {
      S* const at = work_.data() + B * j;
      const auto [begin, end] = column_range(j);
      for (std::size_t p = begin + 1; p < end; ++p)
        subtract_transposed_product(factor_[p], work_.data() + B * row_[p], at);
      solve_upper(factor_[begin], at);
    }
    for (int j = 0; j < n_; ++j) std::copy_n(work_.begin() + B * j, B, x.begin() + B * order_[index(j)]);
  }

 private:
  using Column = std::array<S, std::size_t(B)>;

  template <std::integral I>
  [[nodiscard]] static std::size_t index(I i) {
    return static_cast<std::size_t>(i);
  }
  [[nodiscard]] std::pair<std::size_t, std::size_t> column_range(int j) const {
    return {index(column_begin_[index(j)]), index(column_begin_[index(j) + 1])};
  }

  /// Columns of the lower triangle, each with its block on the diagonal first.
  void set_pattern(std::span<const std::array<int, 2>> pairs) {
    std::vector<std::array<int, 2>> all;  // column, row
    all.reserve(pairs.size() + index(n_));
    for (int k = 0; k < n_; ++k) all.push_back({k, k});
    for (const auto& [i, j] : pairs) all.push_back({std::min(i, j), std::max(i, j)});
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    rows_.clear();
    begin_.assign(index(n_) + 1, 0);
    for (const auto& [column, row] : all) {
      rows_.push_back(row);
      ++begin_[index(column) + 1];
    }
    for (std::size_t k = 0; k < index(n_); ++k) begin_[k + 1] += begin_[k];
  }

  void set_order() {
    std::vector<Eigen::Triplet<S, int>> ones;
    ones.reserve(rows_.size());
    for (int c = 0; c < n_; ++c) {
      for (int p = begin_[index(c)]; p < begin_[index(c) + 1]; ++p)
        ones.emplace_back(rows_[index(p)], c, S(1));
    }
    Eigen::SparseMatrix<S> pattern(n_, n_);
    pattern.setFromTriplets(ones.begin(), ones.end());
    Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
    Eigen::AMDOrdering<int>()(pattern.template selfadjointView<Eigen::Lower>(), order);
    order_.assign(order.indices().data(), order.indices().data() + n_);
  }

  /// Of each column of the factor its rows: those of the matrix, and those of the columns whose first row
  /// below the diagonal it is.
  void set_factor_pattern() {
    std::vector<int> rank(index(n_));
    for (int k = 0; k < n_; ++k) rank[index(order_[index(k)])] = k;
    std::vector<std::vector<int>> columns(index(n_));
    const auto each_block = [&](auto&& f) {
      for (int c = 0; c < n_; ++c) {
        for (int p = begin_[index(c)]; p < begin_[index(c) + 1]; ++p)
          f(index(p), rank[index(rows_[index(p)])], rank[index(c)]);
      }
    };
    each_block([&](std::size_t, int a, int b) { columns[index(std::min(a, b))].push_back(std::max(a, b)); });
    row_.clear();
    column_begin_.assign(1, 0);
    for (int j = 0; j < n_; ++j) {
      auto& column = columns[index(j)];
      std::sort(column.begin(), column.end());
      column.erase(std::unique(column.begin(), column.end()), column.end());
      row_.insert(row_.end(), column.begin(), column.end());
      column_begin_.push_back(static_cast<int>(row_.size()));
      if (column.size() > 1) {
        auto& parent = columns[index(column[1])];
        parent.insert(parent.end(), column.begin() + 1, column.end());
      }
    }
    target_.resize(rows_.size());
    transposed_.resize(rows_.size());
    each_block([&](std::size_t p, int a, int b) {
      const auto [begin, end] = column_range(std::min(a, b));
      const auto first = row_.begin() + static_cast<std::ptrdiff_t>(begin);
      const auto last = row_.begin() + static_cast<std::ptrdiff_t>(end);
      target_[p] = index(std::lower_bound(first, last, std::max(a, b)) - row_.begin());
      transposed_[p] = a < b;
    });
    factor_.resize(row_.size());
    head_.resize(index(n_));
    next_.resize(index(n_));
    cursor_.resize(index(n_));
    at_.resize(index(n_));
    work_.resize(index(n_) * B);
  }

  /// Takes the columns before j that reach it off column j. Those wait in a list at the row that is their
  /// next.
  void subtract_columns(int j) {
    const auto [begin, end] = column_range(j);
    for (std::size_t p = begin; p < end; ++p) at_[index(row_[p])] = p;
    for (int k = head_[index(j)]; k >= 0;) {
      const int after = next_[index(k)];
      const std::size_t first = cursor_[index(k)], last = index(column_begin_[index(k) + 1]);
      Block transposed;
      copy_transposed(factor_[first], transposed);
      for (std::size_t p = first; p < last; ++p)
        subtract_block_product(factor_[p], transposed, factor_[at_[index(row_[p])]]);
      wait(k, first + 1, last);
      k = after;
    }
  }
  void wait(int k, std::size_t next, std::size_t last) {
    cursor_[index(k)] = next;
    if (next == last) return;
    int& head = head_[index(row_[next])];
    next_[index(k)] = std::exchange(head, k);
  }

  /// Factors the block on the diagonal and divides what is below it by it.
  [[nodiscard]] bool finish_column(int j, const Column& before) {
    const auto [begin, end] = column_range(j);
    Block& L = factor_[begin];
    for (int c = 0; c < B; ++c) {
      S* const column = L.data() + B * c;
      for (int k = 0; k < c; ++k) {
        for (int r = c; r < B; ++r) column[r] -= L[index(B * k + r)] * L[index(B * k + c)];
      }
      const S least = S(10) * std::numeric_limits<S>::epsilon() * before[index(c)];
      if (!(before[index(c)] > S(0) && column[c] > least && column[c] <= std::numeric_limits<S>::max()))
        return false;
      const S root = std::sqrt(column[c]), inverse = S(1) / root;
      column[c] = root;
      for (int r = c + 1; r < B; ++r) column[r] *= inverse;
      for (int r = 0; r < c; ++r) column[r] = S(0);
    }
    for (std::size_t p = begin + 1; p < end; ++p) divide_block(L, factor_[p]);
    wait(j, begin + 1, end);
    return true;
  }

  [[nodiscard]] static Column diagonal_of(const Block& block) {
    Column out;
    for (int c = 0; c < B; ++c) out[index(c)] = block[index(B * c + c)];
    return out;
  }
  static void copy_transposed(const Block& from, Block& to) {
    for (int c = 0; c < B; ++c) {
      for (int r = 0; r < B; ++r) to[index(B * r + c)] = from[index(B * c + r)];
    }
  }
  /// C -= A B_T^T
  static void subtract_block_product(const Block& A, const Block& B_T, Block& C) {
    for (int c = 0; c < B; ++c) {
      Column sum;
      for (int r = 0; r < B; ++r) sum[index(r)] = C[index(B * c + r)];
      for (int k = 0; k < B; ++k) {
        for (int r = 0; r < B; ++r) sum[index(r)] -= A[index(B * k + r)] * B_T[index(B * c + k)];
      }
      for (int r = 0; r < B; ++r) C[index(B * c + r)] = sum[index(r)];
    }
  }
  /// A = A L^-T
  static void divide_block(const Block& L, Block& A) {
    for (int c = 0; c < B; ++c) {
      for (int k = 0; k < c; ++k) {
        for (int r = 0; r < B; ++r) A[index(B * c + r)] -= A[index(B * k + r)] * L[index(B * k + c)];
      }
      const S inverse = S(1) / L[index(B * c + c)];
      for (int r = 0; r < B; ++r) A[index(B * c + r)] *= inverse;
    }
  }
  static void solve_lower(const Block& L, S* x) {
    for (int c = 0; c < B; ++c) {
      x[c] /= L[index(B * c + c)];
      for (int r = c + 1; r < B; ++r) x[r] -= L[index(B * c + r)] * x[c];
    }
  }
  static void solve_upper(const Block& L, S* x) {
    for (int c = B; c-- > 0;) {
      for (int r = c + 1; r < B; ++r) x[c] -= L[index(B * c + r)] * x[r];
      x[c] /= L[index(B * c + c)];
    }
  }
  /// y -= A x
  static void subtract_product(const Block& A, const S* x, S* y) {
    for (int c = 0; c < B; ++c) {
      for (int r = 0; r < B; ++r) y[r] -= A[index(B * c + r)] * x[c];
    }
  }
  /// y -= A^T x
  static void subtract_transposed_product(const Block& A, const S* x, S* y) {
    for (int c = 0; c < B; ++c) {
      S sum = S(0);
      for (int r = 0; r < B; ++r) sum += A[index(B * c + r)] * x[r];
      y[c] -= sum;
    }
  }

  int n_ = 0;
  std::vector<int> begin_, rows_;  // the matrix: of each column its first block, and the blocks' rows
  std::vector<Block> blocks_;
  std::vector<int> order_;               // place in the factor -> place in the matrix
  std::vector<int> column_begin_, row_;  // the factor, likewise
  std::vector<Block> factor_;
  std::vector<std::size_t> target_;       // of a block of the matrix its place in the factor,
  std::vector<std::uint8_t> transposed_;  // and whether it is transposed there
  std::vector<int> head_, next_;          // lists of columns by the row that is their next
  std::vector<std::size_t> cursor_, at_;  // that row's place; of each row its place in the column at hand
  std::vector<S> work_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
