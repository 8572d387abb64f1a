// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>

#include "dynslam/concepts/robust.hpp"

namespace dynslam {

/// Least squares: rho(s) = s.
template <Scalar S>
struct SquaredLoss {
  [[nodiscard]] S rho(const S& s) const { return s; }
  [[nodiscard]] S weight(const S&) const { return S(1); }
};

/// Huber: rho(s) = s up to delta^2, 2 delta sqrt(s) - delta^2 beyond. `delta` in standard deviations.
template <Scalar S>
struct Huber {
  S delta = S(1.345);
  [[nodiscard]] S rho(const S& s) const {
    using std::sqrt;
    return s <= delta * delta ? s : S(2) * delta * sqrt(s) - delta * delta;
  }
  [[nodiscard]] S weight(const S& s) const {
    using std::sqrt;
    return s <= delta * delta ? S(1) : delta / sqrt(s);
  }
};

/// Cauchy: rho(s) = c^2 log(1 + s / c^2). `c` in standard deviations.
template <Scalar S>
struct Cauchy {
  S c = S(2.3849);
  [[nodiscard]] S rho(const S& s) const {
    using std::log;
    return c * c * log(S(1) + s / (c * c));
  }
  [[nodiscard]] S weight(const S& s) const { return S(1) / (S(1) + s / (c * c)); }
};

/// Tukey's biweight: no influence beyond `c` standard deviations.
template <Scalar S>
struct Tukey {
  S c = S(4.6851);
  [[nodiscard]] S rho(const S& s) const {
    const S c2 = c * c;
    if (c2 < s) return c2 / S(3);
    const S k = S(1) - s / c2;
    return c2 / S(3) * (S(1) - k * k * k);
  }
  [[nodiscard]] S weight(const S& s) const {
    const S c2 = c * c;
    if (c2 < s) return S(0);
    const S k = S(1) - s / c2;
    return k * k;
  }
};

static_assert(RobustKernel<SquaredLoss<double>, double> && RobustKernel<Huber<float>, float> &&
              RobustKernel<Cauchy<double>, double> && RobustKernel<Tukey<float>, float>);

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
