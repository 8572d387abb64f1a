// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <concepts>

#include "dynslam/concepts/scalar.hpp"

namespace dynslam {

/// A robust loss of the squared normalised residual s = r^T Sigma^-1 r: the cost `rho(s)` and the
/// weight of iteratively reweighted least squares, `weight(s)` = d rho / d s.
template <class K, class S>
concept RobustKernel = Scalar<S> && requires(const K& kernel, const S& s) {
  { kernel.rho(s) } -> std::convertible_to<S>;
  { kernel.weight(s) } -> std::convertible_to<S>;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
