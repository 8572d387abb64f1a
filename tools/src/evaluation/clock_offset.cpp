// SPDX-License-Identifier: BSD-3-Clause
// The offset of two clocks, by how fast the camera turns and moves, which no alignment changes.
#include "evaluation/clock_offset.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace dynslam::runtime {
namespace {

using Poses = std::span<const StampedPose<double>>;

/// Speeds on a regular grid of times; NaN in gaps.
struct Speeds {
  double begin = 0, step = 0;
  std::array<std::vector<double>, 2> values;  // of turning [rad/s] and of moving [m/s]
};

constexpr double kInterpolatedGap = 0.25;  // between poses, that is interpolated over [s]
/// Largest standard deviation of an offset that is of use [s]: poses pair within it.
constexpr double kLeastCertain = 0.02;

Speeds speeds_of(Poses poses, double step) {
  Speeds s;
  s.step = step;
  s.begin = poses.front().t;
  const auto count = static_cast<std::size_t>((poses.back().t - s.begin) / step) + 1;
  for (auto& values : s.values) values.assign(count, std::nan(""));
  std::size_t after = 1;
  for (std::size_t k = 0; k < count; ++k) {
    const double t = s.begin + static_cast<double>(k) * step;
    while (after + 1 < poses.size() && poses[after].t < t) ++after;
    const double dt = poses[after].t - poses[after - 1].t;
    if (!(dt > 0) || dt > kInterpolatedGap) continue;
    const SE3<double> motion = poses[after - 1].T_w_c.inverse() * poses[after].T_w_c;
    s.values[0][k] = motion.so3().log().norm() / dt;
    s.values[1][k] = motion.translation().norm() / dt;
  }
  return s;
}

/// Correlation of two speeds where b comes `lag` steps later; nullopt where too little of both overlaps.
std::optional<double> correlation(const std::vector<double>& a, const std::vector<double>& b,
                                  std::ptrdiff_t lag, std::size_t fewest) {
  double sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0, n = 0;
  const auto size_a = static_cast<std::ptrdiff_t>(a.size()), size_b = static_cast<std::ptrdiff_t>(b.size());
  for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, -lag); j < size_b && j + lag < size_a; ++j) {
    const double x = a[static_cast<std::size_t>(j + lag)], y = b[static_cast<std::size_t>(j)];
    if (!std::isfinite(x) || !std::isfinite(y)) continue;
    sa += x, sb += y, saa += x * x, sbb += y * y, sab += x * y, n += 1;
  }
  if (n < static_cast<double>(fewest)) return std::nullopt;
  const double va = saa - sa * sa / n, vb = sbb - sb * sb / n;
  if (!(va > 0) || !(vb > 0)) return std::nullopt;
  return (sab - sa * sb / n) / std::sqrt(va * vb);
}

/// RMSE of positions that are interpolated at the shifted times; nullopt where few are covered.
std::optional<double> error_at(Poses estimate, Poses truth, double offset) {
  std::vector<Eigen::Vector3d> a, b;
  std::size_t after = 1;
  for (const auto& pose : estimate) {
    const double t = pose.t + offset;
    while (after + 1 < truth.size() && truth[after].t < t) ++after;
    const auto &p = truth[after - 1], &q = truth[after];
    if (t < p.t || t > q.t || q.t - p.t > kInterpolatedGap || !(q.t > p.t)) continue;
    const double share = (t - p.t) / (q.t - p.t);
    a.push_back(pose.T_w_c.translation());
    b.push_back((1 - share) * p.T_w_c.translation() + share * q.T_w_c.translation());
  }
  if (2 * a.size() < estimate.size()) return std::nullopt;
  const auto T = horn_alignment<double>(a, b);
  if (!T) return std::nullopt;
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += (*T * a[k] - b[k]).squaredNorm();
  return std::sqrt(sum / static_cast<double>(a.size()));
}

/// About `offset` by what aligns positions best, in ever finer steps.
double refined(Poses estimate, Poses truth, double offset, double step) {
  constexpr double kFinest = 1e-4;  // seconds
  for (; step > kFinest; step /= 4) {
    double best = offset;
    auto least = error_at(estimate, truth, offset);
    for (int k = -6; k <= 6; ++k) {
      const auto error = error_at(estimate, truth, offset + k * step / 3);
      if (error && (!least || *error < *least)) {
        least = error;
        best = offset + k * step / 3;
      }
    }
    offset = best;
  }
  return offset;
}

/// Standard deviation of `offset` [s], by how fast positions cease to fit when they are shifted further;
/// nullopt where they fit as well. On a line or a circle at a constant speed, alignment makes up for any
/// shift. Errors of poses last about a second, so of each second there is one independent measurement.
std::optional<double> deviation(Poses estimate, Poses truth, double offset) {
  constexpr double kShift = 0.1;  // seconds
  const auto fit = error_at(estimate, truth, offset);
  const auto before = error_at(estimate, truth, offset - kShift),
             after = error_at(estimate, truth, offset + kShift);
  if (!fit || !before || !after) return std::nullopt;
  const double grown = (*before * *before + *after * *after) / 2 - *fit * *fit;
  if (!(grown > 0)) return std::nullopt;
  const double seconds = std::max(1.0, estimate.back().t - estimate.front().t);
  return kShift * *fit / std::sqrt(grown * seconds);
}

}  // namespace

std::optional<ClockOffset> clock_offset(std::span<const StampedPose<double>> estimate,
                                        std::span<const StampedPose<double>> groundtruth) {
  if (estimate.size() < 2 || groundtruth.size() < 2) return std::nullopt;
  constexpr double kStep = 1.0 / 30, kMostSteps = 6000;
  const double longest =
      std::max(estimate.back().t - estimate.front().t, groundtruth.back().t - groundtruth.front().t);
  const double step = std::max(kStep, longest / kMostSteps);
  const Speeds a = speeds_of(groundtruth, step), b = speeds_of(estimate, step);
  const auto size_a = static_cast<std::ptrdiff_t>(a.values[0].size()),
             size_b = static_cast<std::ptrdiff_t>(b.values[0].size());
  const auto fewest = static_cast<std::size_t>(std::min(size_a, size_b) / 2);  // half of the shorter one
  constexpr double kAlike = 0.5;                                               // correlation, of either
  std::optional<std::ptrdiff_t> best;
  double most = kAlike;
  for (std::ptrdiff_t lag = -size_b; lag <= size_a; ++lag) {
    double sum = 0, count = 0;
    for (std::size_t k = 0; k < 2; ++k) {
      if (const auto c = correlation(a.values[k], b.values[k], lag, std::max<std::size_t>(fewest, 8)))
        sum += *c, count += 1;
    }
    if (count > 0 && sum / count > most) {
      most = sum / count;
      best = lag;
    }
  }
  if (!best) return std::nullopt;
  const double offset =
      refined(estimate, groundtruth, a.begin - b.begin + static_cast<double>(*best) * step, step);
  const auto uncertain = deviation(estimate, groundtruth, offset);
  if (!uncertain || *uncertain > kLeastCertain) return std::nullopt;
  return ClockOffset{offset, *uncertain};
}

}  // namespace dynslam::runtime
