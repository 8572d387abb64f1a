// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>

namespace dynslam {

/// Whether probabilities are right: of what was said to happen with a probability of 0.8, 0.8 must happen (reliability
/// diagram; DeGroot and Fienberg 1983). Counts statements by tenths of the probability.
class ReliabilityDiagram {
 public:
  struct Tenth {
    std::size_t statements = 0;
    double said = 0;      ///< mean probability that was stated; 0 without statements
    double happened = 0;  ///< share of them that came true
  };

  /// @param log_odds  of the statement; NaN is not counted
  template <std::floating_point S>
  void add(S log_odds, bool came_true) {
    if (std::isnan(log_odds)) return;
    const double p = 1 / (1 + std::exp(-static_cast<double>(log_odds)));
    Sum& sum = sums_[std::min<std::size_t>(9, static_cast<std::size_t>(10 * p))];
    ++sum.statements;
    sum.probability += p;
    sum.true_ones += came_true ? 1 : 0;
    ++all_;
  }

  [[nodiscard]] std::size_t statements() const { return all_; }
  /// @param k  0 to 9: probabilities from k / 10 on
  [[nodiscard]] Tenth tenth(std::size_t k) const {
    const Sum& sum = sums_[k];
    if (sum.statements == 0) return {};
    const auto n = static_cast<double>(sum.statements);
    return {sum.statements, sum.probability / n, static_cast<double>(sum.true_ones) / n};
  }
  /// Greatest difference between what was said and what happened, in tenths that have at least a share of all statements.
  [[nodiscard]] double largest_error(double least_share = 0.01) const {
    double largest = 0;
    for (std::size_t k = 0; k < sums_.size(); ++k) {
      const Tenth t = tenth(k);
      if (t.statements > 0 && static_cast<double>(t.statements) >= least_share * static_cast<double>(all_))
        largest = std::max(largest, std::abs(t.said - t.happened));
    }
    return largest;
  }

 private:
  struct Sum {
    std::size_t statements = 0, true_ones = 0;
    double probability = 0;
  };
  std::array<Sum, 10> sums_{};
  std::size_t all_ = 0;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
