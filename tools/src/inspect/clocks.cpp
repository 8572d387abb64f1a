// SPDX-License-Identifier: BSD-3-Clause
// Warnings of the times of a sequence before an image is looked at: units, and clocks that differ.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/inspect/inspect.hpp"
#include "inspect/measure.hpp"

namespace dynslam::runtime {
namespace {

/// A unit in which stamps are written by mistake, in seconds.
struct TimeUnit {
  double seconds;
  std::string_view name;
};
constexpr std::array<TimeUnit, 5> kTimeUnits{
    {{1e-3, "milliseconds"}, {1e-6, "microseconds"}, {1e-9, "nanoseconds"}, {1e3, ""}, {1e6, ""}}};

/// Whole numbers, most of them one apart.
bool are_numbers(const std::vector<double>& times) {
  const auto whole = [](double t) { return t == std::floor(t); };
  return times.size() > 2 && inspect::median_interval(times) == 1 &&
         std::all_of(times.begin(), times.end(), whole);
}

std::vector<double> scaled(const std::vector<double>& times, double factor) {
  std::vector<double> result(times);
  for (double& t : result) t *= factor;
  return result;
}

/// Stamps that are no seconds, by the rate that they would be; empty: they may be.
std::string unit_doubt(const std::vector<double>& times) {
  constexpr double kSlowest = 0.5, kFastest = 1000, kUsualLow = 4, kUsualHigh = 250;  // Hz
  const double interval = inspect::median_interval(times);
  if (!(interval > 0)) return {};
  if (are_numbers(times))
    return "colour images are 1 s apart by their stamps, all of them whole numbers: numbers of frames? "
           "Stamps "
           "are seconds; a number over the frame rate is one";
  if (interval <= 1 / kSlowest && interval >= 1 / kFastest) return {};
  std::string text =
      fmt::format("colour images are {:.3g} s apart ({:.3g} Hz) by their stamps", interval, 1 / interval);
  for (const TimeUnit& unit : kTimeUnits) {
    const double rate = 1 / (interval * unit.seconds);
    if (rate >= kUsualLow && rate <= kUsualHigh)
      return text + fmt::format(", which are seconds{}: times {} they would be {:.3g} Hz",
                                unit.name.empty() ? "" : fmt::format(", not {}", unit.name), unit.seconds,
                                rate);
  }
  return text;
}

/// What would make a ground truth fit images that it does not cover.
std::string what_fits(const std::vector<StampedPose<double>>& truth, const std::vector<double>& images) {
  constexpr double kMost = 0.5;  // of the images
  for (const TimeUnit& unit : kTimeUnits) {
    if (inspect::covered_share(truth, scaled(images, unit.seconds)) > kMost)
      return fmt::format("the images' stamps times {} would fit it", unit.seconds);
    auto other = truth;
    for (auto& pose : other) pose.t *= unit.seconds;
    if (inspect::covered_share(other, images) > kMost)
      return fmt::format("its stamps times {} would fit the images", unit.seconds);
  }
  const double begin = truth.front().t, length = truth.back().t - begin;
  const double images_length = images.back() - images.front();
  if (are_numbers(images) && length > 0)
    return fmt::format("the images' stamps times {:.6g} and {:.6f} s more would begin and end with it",
                       length / images_length, begin - images.front() * length / images_length);
  const double overlap = std::min(truth.back().t, images.back()) - std::max(begin, images.front());
  if (overlap > kMost * images_length) {
    std::vector<double> times;
    for (const auto& pose : truth) times.push_back(pose.t);
    return fmt::format("its poses are {:.3g} s apart (median)", inspect::median_interval(times));
  }
  return fmt::format("another clock? The images' stamps and {:.3f} s more would begin with it",
                     begin - images.front());
}

}  // namespace

std::vector<std::string> time_doubts(const Sequence& sequence) {
  std::vector<std::string> warnings;
  if (sequence.frames.empty()) return warnings;
  if (sequence.has_stamps) {
    if (std::string doubt = unit_doubt(sequence.colour_times); !doubt.empty())
      warnings.push_back(std::move(doubt));
  }
  const auto& truth = sequence.groundtruth;
  if (truth.empty()) return warnings;
  std::vector<double> images;
  for (const FrameRecord& frame : sequence.frames) images.push_back(frame.t_rgb);
  constexpr double kFew = 0.5;
  const double covered = inspect::covered_share(truth, images);
  if (covered < kFew)
    warnings.push_back(
        fmt::format("the ground truth has a pose for {:.0f} % of the pairs; it is from {:.3f} to "
                    "{:.3f} s, they from {:.3f} to {:.3f} s: {}",
                    100 * covered, truth.front().t, truth.back().t, images.front(), images.back(),
                    what_fits(truth, images)));
  return warnings;
}

}  // namespace dynslam::runtime
