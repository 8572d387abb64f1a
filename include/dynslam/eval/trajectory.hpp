// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <queue>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "dynslam/concepts/scalar.hpp"
#include "dynslam/geometry/rigid_alignment.hpp"
#include "dynslam/geometry/se3.hpp"

namespace dynslam {

/// A camera pose at a time [s]. Time is double whatever the scalar of the pose: seconds since 1970 in float
/// are multiples of 128, in double of 238 ns, so what nanoseconds are known stand beside it.
template <std::floating_point S>
struct StampedPose {
  double t;
  SE3<S> T_w_c;
  std::int64_t ns{};  ///< the same time in nanoseconds, as it was recorded; 0: unknown
};

/// Pairs (index in a, index in b) by TUM's greedy rule: all candidate pairs closer than `max_difference`
/// seconds, nearest first, each stamp used once. Sorted by the index in `a`.
///
/// The nearest pair of all is always one of neighbours in time, so a list of both sequences' stamps, from
/// which pairs are taken out, and a heap of its neighbours do: n log n steps, whatever number of stamps lies
/// within the limit.
/// @param a, b  increasing time stamps [s]
/// @param offset  added to b's stamps [s]
[[nodiscard]] inline std::vector<std::pair<std::size_t, std::size_t>> associate(std::span<const double> a,
                                                                                std::span<const double> b,
                                                                                double max_difference = 0.02,
                                                                                double offset = 0.0) {
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  // Nodes of the list: those of a by their index, those of b behind them.
  const std::size_t n = a.size(), count = n + b.size();
  std::vector<std::size_t> before(count, kNone), after(count, kNone);
  using Candidate = std::tuple<double, std::size_t, std::size_t>;
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> candidates;
  const auto consider = [&](std::size_t x, std::size_t y) {
    if (x == kNone || y == kNone || (x < n) == (y < n)) return;
    const std::size_t i = std::min(x, y), j = std::max(x, y) - n;
    const double difference = std::abs(a[i] - (b[j] + offset));
    if (difference < max_difference) candidates.emplace(difference, i, j);
  };
  for (std::size_t i = 0, j = 0, last = kNone; i < n || j < b.size();) {
    const bool from_a = j == b.size() || (i < n && a[i] <= b[j] + offset);
    const std::size_t node = from_a ? i++ : n + j++;
    before[node] = last;
    if (last != kNone) after[last] = node;
    consider(last, node);
    last = node;
  }
  std::vector<bool> used(count, false);
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  while (!candidates.empty()) {
    const std::size_t i = std::get<1>(candidates.top()), j = std::get<2>(candidates.top());
    candidates.pop();
    if (used[i] || used[n + j]) continue;
    used[i] = used[n + j] = true;
    pairs.emplace_back(i, j);
    // Whoever stood before the two now stands beside whoever came after them.
    const bool a_first = after[i] == n + j;
    const std::size_t left = before[a_first ? i : n + j], right = after[a_first ? n + j : i];
    if (left != kNone) after[left] = right;
    if (right != kNone) before[right] = left;
    consider(left, right);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

/// Moments of a set of errors; `std` is the population's (as numpy.std).
template <std::floating_point S>
struct Statistics {
  S rmse = S(0), mean = S(0), median = S(0), std = S(0), min = S(0), max = S(0);
};

/// All zero for an empty set.
template <std::floating_point S>
[[nodiscard]] Statistics<S> statistics(std::span<const S> values) {
  Statistics<S> result;
  if (values.empty()) return result;
  const auto n = static_cast<S>(values.size());
  S sum = S(0), squares = S(0);
  for (const S v : values) {
    sum += v;
    squares += v * v;
  }
  result.mean = sum / n;
  result.rmse = std::sqrt(squares / n);
  S variance = S(0);
  for (const S v : values) variance += (v - result.mean) * (v - result.mean);
  result.std = std::sqrt(variance / n);
  std::vector<S> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  const std::size_t half = sorted.size() / 2;
  result.median = sorted.size() % 2 == 1 ? sorted[half] : S(0.5) * (sorted[half - 1] + sorted[half]);
  result.min = sorted.front();
  result.max = sorted.back();
  return result;
}

/// Absolute trajectory error after alignment.
template <std::floating_point S>
struct AteResult {
  std::size_t pairs = 0;
  Statistics<S> translation;  ///< metres
  SE3<S> T_gt_est;            ///< aligns the estimate with the ground truth
  S scale = S(1);             ///< of the estimate before that
  std::vector<double> times;  ///< stamps of the ground truth's poses [s]
  std::vector<S> errors;      ///< metres, one per pair
};

namespace detail {
template <std::floating_point S>
[[nodiscard]] std::vector<double> stamps(std::span<const StampedPose<S>> trajectory) {
  std::vector<double> t;
  t.reserve(trajectory.size());
  for (const auto& pose : trajectory) t.push_back(pose.t);
  return t;
}

/// Index of the stamp nearest to `t` by TUM's bisection. Of two equally near stamps the one visited
/// first is taken: such ties are common on regular stamps, and decide the last digits of the RPE.
[[nodiscard]] inline std::size_t closest_index(std::span<const double> times, double t) {
  std::size_t begin = 0, end = times.size(), best = 0;
  double difference = std::abs(times[0] - t);
  while (begin < end) {
    const std::size_t middle = (begin + end) / 2;
    if (std::abs(times[middle] - t) < difference) {
      difference = std::abs(times[middle] - t);
      best = middle;
    }
    if (times[middle] == t) return middle;
    if (times[middle] > t) {
      end = middle;
    } else {
      begin = middle + 1;
    }
  }
  return best;
}
}  // namespace detail

/// How an estimate is laid on the ground truth before positions are compared.
enum class Alignment {
  se3,   ///< by the rigid motion of least squares (Horn), as TUM's evaluate_ate.py
  sim3,  ///< and a scale (Umeyama 1991): for estimates without one
  none,  ///< not at all: both are in one frame
  first  ///< by the first pair of poses
};

namespace detail {
/// Scale and translation that go with the rotation of least squares.
/// @return false, with nothing done, where one of the two is in one place, as far as S can tell
template <std::floating_point S>
[[nodiscard]] bool scale_alignment(std::span<const Eigen::Matrix<S, 3, 1>> a,
                                   std::span<const Eigen::Matrix<S, 3, 1>> b, SE3<S>& T, S& scale) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  Vector3 mean_a = Vector3::Zero(), mean_b = Vector3::Zero();
  for (std::size_t k = 0; k < a.size(); ++k) {
    mean_a += a[k] / static_cast<S>(a.size());
    mean_b += b[k] / static_cast<S>(a.size());
  }
  S common = S(0), spread_a = S(0), spread_b = S(0), size_a = S(0), size_b = S(0);
  for (std::size_t k = 0; k < a.size(); ++k) {
    const Vector3 from = a[k] - mean_a, to = b[k] - mean_b;
    common += to.dot(T.so3() * from);
    spread_a += from.squaredNorm();
    spread_b += to.squaredNorm();
    size_a += a[k].squaredNorm();
    size_b += b[k].squaredNorm();
  }
  // A scale between them would be none, or lay all on one point.
  const S rounding = S(100) * Eigen::NumTraits<S>::epsilon();  // of coordinates, relative
  if (!(spread_a > rounding * rounding * size_a && spread_b > rounding * rounding * size_b)) return false;
  scale = common / spread_a;
  T = SE3<S>(T.so3(), Vector3(mean_b - scale * (T.so3() * mean_a)));
  return true;
}
}  // namespace detail

/// Absolute trajectory error after an alignment.
/// @return nullopt with no associated poses; where the alignment is one of least squares, with fewer than 3
/// or
///         degenerate positions
template <std::floating_point S>
[[nodiscard]] std::optional<AteResult<S>> absolute_trajectory_error(
    std::span<const StampedPose<S>> estimate, std::span<const StampedPose<S>> groundtruth,
    double max_difference = 0.02, Alignment alignment = Alignment::se3) {
  const auto t_gt = detail::stamps(groundtruth), t_est = detail::stamps(estimate);
  const auto pairs = associate(t_gt, t_est, max_difference);
  if (pairs.empty()) return std::nullopt;
  std::vector<Eigen::Matrix<S, 3, 1>> a, b;
  for (const auto& [i, j] : pairs) {
    b.push_back(groundtruth[i].T_w_c.translation());
    a.push_back(estimate[j].T_w_c.translation());
  }
  AteResult<S> result;
  result.pairs = pairs.size();
  if (alignment == Alignment::first) {
    result.T_gt_est = groundtruth[pairs.front().first].T_w_c * estimate[pairs.front().second].T_w_c.inverse();
  } else if (alignment != Alignment::none) {
    const auto T = horn_alignment<S>(a, b);
    if (!T) return std::nullopt;
    result.T_gt_est = *T;
    if (alignment == Alignment::sim3 && !detail::scale_alignment<S>(a, b, result.T_gt_est, result.scale))
      return std::nullopt;
  }
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    result.times.push_back(t_gt[pairs[k].first]);
    const Eigen::Matrix<S, 3, 1> scaled = result.scale * a[k];
    result.errors.push_back((result.T_gt_est * scaled - b[k]).norm());
  }
  result.translation = statistics<S>(result.errors);
  return result;
}

/// Relative pose error over an interval of time.
template <std::floating_point S>
struct RpeResult {
  std::size_t pairs = 0;
  Statistics<S> translation;   ///< metres per interval
  Statistics<S> rotation_deg;  ///< degrees per interval
};

/// Relative pose error over `delta` seconds for all pairs, as TUM's
/// evaluate_rpe.py --fixed_delta --delta 1 --delta_unit s.
/// @return nullopt when no interval has ground truth near both ends (gap: twice its median period)
template <std::floating_point S>
[[nodiscard]] std::optional<RpeResult<S>> relative_pose_error(std::span<const StampedPose<S>> estimate,
                                                              std::span<const StampedPose<S>> groundtruth,
                                                              double delta = 1.0) {
  if (estimate.size() < 2 || groundtruth.size() < 2) return std::nullopt;
  const auto t_gt = detail::stamps(groundtruth), t_est = detail::stamps(estimate);
  std::vector<double> periods;
  for (std::size_t i = 1; i < t_gt.size(); ++i) periods.push_back(t_gt[i] - t_gt[i - 1]);
  const double max_gap = 2.0 * statistics<double>(periods).median;

  std::vector<S> translation, rotation;
  for (std::size_t i = 0; i < t_est.size(); ++i) {
    const std::size_t j = detail::closest_index(t_est, t_est[i] + delta);
    if (j == t_est.size() - 1) continue;
    const std::size_t gi = detail::closest_index(t_gt, t_est[i]), gj = detail::closest_index(t_gt, t_est[j]);
    if (std::abs(t_gt[gi] - t_est[i]) > max_gap || std::abs(t_gt[gj] - t_est[j]) > max_gap) continue;
    const SE3<S> motion_est = estimate[j].T_w_c.inverse() * estimate[i].T_w_c;
    const SE3<S> motion_gt = groundtruth[gj].T_w_c.inverse() * groundtruth[gi].T_w_c;
    const SE3<S> error = motion_est.inverse() * motion_gt;
    translation.push_back(error.translation().norm());
    rotation.push_back(error.so3().log().norm() * S(180) / std::numbers::pi_v<S>);
  }
  if (translation.size() < 2) return std::nullopt;
  RpeResult<S> result;
  result.pairs = translation.size();
  result.translation = statistics<S>(translation);
  result.rotation_deg = statistics<S>(rotation);
  return result;
}

/// Error of the whole way's motion, first associated pose to last [m]: the drift, and what a closed loop
/// took out of it.
/// @return nullopt with fewer than 2 associated poses
template <std::floating_point S>
[[nodiscard]] std::optional<S> end_error(std::span<const StampedPose<S>> estimate,
                                         std::span<const StampedPose<S>> groundtruth,
                                         double max_difference = 0.02) {
  const auto t_gt = detail::stamps(groundtruth), t_est = detail::stamps(estimate);
  const auto pairs = associate(t_gt, t_est, max_difference);
  if (pairs.size() < 2) return std::nullopt;
  const auto motion = [](const SE3<S>& first, const SE3<S>& last) { return first.inverse() * last; };
  const SE3<S> truth = motion(groundtruth[pairs.front().first].T_w_c, groundtruth[pairs.back().first].T_w_c);
  const SE3<S> found = motion(estimate[pairs.front().second].T_w_c, estimate[pairs.back().second].T_w_c);
  return (truth.inverse() * found).translation().norm();
}

/// Eq (13): improvement of `beta` over the baseline `alpha` in percent.
template <std::floating_point S>
[[nodiscard]] constexpr S improvement_percent(S alpha, S beta) {
  return (alpha - beta) / alpha * S(100);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
