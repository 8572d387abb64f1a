// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "inspect/measure.hpp"

namespace dynslam::runtime::inspect {
namespace {

double rate_of(const std::vector<double>& times) {
  const double interval = median_interval(times);
  return interval > 0 ? 1 / interval : 0;
}

}  // namespace

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

double median_interval(std::span<const double> times) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < times.size(); ++i) intervals.push_back(times[i] - times[i - 1]);
  return quantile(std::move(intervals), 0.5);
}

StampReport measure_stamps(const Sequence& sequence) {
  StampReport r;
  r.colour_images = sequence.colour_times.size();
  r.depth_images = sequence.depth_times.size();
  r.pairs = sequence.frames.size();
  r.colour_rate = rate_of(sequence.colour_times);
  r.depth_rate = rate_of(sequence.depth_times);
  std::vector<double> times, delays, sizes, spread;
  for (const FrameRecord& frame : sequence.frames) {
    times.push_back(frame.t_rgb);
    delays.push_back(frame.t_depth - frame.t_rgb);
    sizes.push_back(std::abs(delays.back()));
  }
  r.duration = times.back() - times.front();
  r.delay_median = quantile(delays, 0.5);
  r.delay_p95 = quantile(sizes, 0.95);
  for (const double delay : delays) spread.push_back(std::abs(delay - r.delay_median));
  r.delay_spread = quantile(spread, 0.5);
  const double interval = median_interval(times);
  constexpr double kGap = 1.75;  // intervals: one frame missing is 2
  for (std::size_t i = 1; i < times.size(); ++i) {
    const double length = times[i] - times[i - 1];
    if (interval > 0 && length > kGap * interval)
      r.gaps.push_back({times[i - 1] - times.front(), length,
                        static_cast<std::size_t>(std::llround(length / interval)) - 1});
  }
  return r;
}

}  // namespace dynslam::runtime::inspect
