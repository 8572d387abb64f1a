// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>
#include <concepts>

#include "dynslam/concepts/robust.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// The sum of a kernel's rho over many squared normalised residuals: the cost of an estimator.
template <std::floating_point S, RobustKernel<S> Kernel>
class RhoSum {
 public:
  explicit RhoSum(const Kernel& kernel) : kernel_(kernel) {}
  void add(S s) { sum_ += kernel_.rho(s); }
  [[nodiscard]] S value() const { return sum_; }

 private:
  Kernel kernel_;
  S sum_ = S(0);
};

/// Logarithms add up to that of a product: one for dozens of residuals instead of one for each, which took
/// longer than all else that a residual needs.
template <std::floating_point S>
class RhoSum<S, TDistribution<S>> {
 public:
  explicit RhoSum(const TDistribution<S>& kernel)
      : numerator_(kernel.numerator), inverse_nu_(S(1) / kernel.nu) {}
  void add(S s) {
    const S factor = S(1) + s * inverse_nu_;
    if (factor > kMost) {
      logarithms_ += std::log(factor);
      return;
    }
    product_ *= factor;
    if (product_ > kMost) {
      logarithms_ += std::log(product_);
      product_ = S(1);
    }
  }
  [[nodiscard]] S value() const { return numerator_ * (logarithms_ + std::log(product_)); }

 private:
  static constexpr S kMost = S(1e18);  // its square is far enough from the largest float
  S numerator_, inverse_nu_;
  S logarithms_ = S(0), product_ = S(1);
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
