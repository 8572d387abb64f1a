// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>

namespace dynslam {

/// Eq (10): log-odds of a probability in (0, 1).
template <std::floating_point S>
[[nodiscard]] S probability_to_log_odds(S p) {
  return std::log(p / (S(1) - p));
}

/// Eq (11): probability of log-odds; two branches keep it finite for any argument.
template <std::floating_point S>
[[nodiscard]] S log_odds_to_probability(S l) {
  if (l >= S(0)) return S(1) / (S(1) + std::exp(-l));
  const S e = std::exp(l);
  return e / (S(1) + e);
}

/// What is known of a piece of space.
enum class Occupancy : std::uint8_t { unknown, free, occupied };

/// Sensor model and bounds, as probabilities converted to log-odds once (OctoMap's values).
template <std::floating_point S>
struct LogOddsParams {
  S hit = probability_to_log_odds(S(0.7));
  S miss = probability_to_log_odds(S(0.4));
  S min = probability_to_log_odds(S(0.12));
  S max = probability_to_log_odds(S(0.97));
  S occupied = S(0);  ///< log-odds from which a cell is occupied
};

/// L(n|z_1:T) = L(n|z_1:T-1) + L(n|z_T) (Eq 12), clamped; unchanged where that is no number.
template <std::floating_point S>
[[nodiscard]] S fused_log_odds(S before, S measurement, const LogOddsParams<S>& params) {
  const S sum = before + measurement;
  return std::isnan(sum) ? before : std::clamp(sum, params.min, params.max);
}

/// Occupancy of one voxel: L(n|z_1:T) = L(n|z_1:T-1) + L(n|z_T) (Eq 12), clamped so that a changed
/// world can be learnt again. The prior is 0.5, i.e. log-odds 0, which makes Eq (12) equal Eq (9).
template <std::floating_point S>
class LogOddsCell {
 public:
  /// Adds the log-odds of one measurement. Infinite ones (a probability of 0 or 1) take the cell to its
  /// bounds; NaN is no measurement and changes nothing.
  void update(S measurement, const LogOddsParams<S>& params) {
    if (std::isnan(value_ + measurement)) return;
    value_ = fused_log_odds(value_, measurement, params);
    observed_ = true;
  }
  [[nodiscard]] S log_odds() const { return value_; }
  [[nodiscard]] S probability() const { return log_odds_to_probability(value_); }
  [[nodiscard]] Occupancy state(const LogOddsParams<S>& params) const {
    if (!observed_) return Occupancy::unknown;
    return value_ >= params.occupied ? Occupancy::occupied : Occupancy::free;
  }

 private:
  S value_ = S(0);
  bool observed_ = false;
};

/// Eq (9): Bayes' recursion on probabilities, P(n|z_1:T) from P(n|z_T), P(n|z_1:T-1) and the prior.
template <std::floating_point S>
[[nodiscard]] S bayes_update(S measurement, S previous, S prior) {
  return S(1) /
         (S(1) + (S(1) - measurement) / measurement * (S(1) - previous) / previous * prior / (S(1) - prior));
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
