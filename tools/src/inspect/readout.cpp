// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/inspect/readout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynslam/optim/readout_measurement.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "median.hpp"

namespace dynslam::runtime {
namespace {

constexpr double kTooVague = 0.001;  // standard deviation by scatter [s]: the camera hardly moves
constexpr double kBeside = 0.008;  // of a trial from the time that it is to bracket [s]: over less, what two
                                   // runs differ by at random outweighs what they are to differ by

struct Run {
  ReadoutTrial trial;
  ReadoutMeasurement<double> measurement;
};

Run run_as_if(const Sequence& sequence, CameraConfig camera, double assumed) {
  camera.readout_time = assumed;
  TrackerOptions options;
  options.dynamics = DynamicsMode::geometric;
  Tracker tracker(camera, options);
  tracker.measure_readout();
  Run run;
  run.trial.assumed = assumed;
  FrameStream stream(sequence, camera);
  while (const auto frame = stream.next()) {
    if (!frame->frame) continue;  // broken ones are `info`'s to tell of
    const TrackResult result = tracker.track(*frame->frame, std::nullopt);
    run.trial.tracked += result.ok() ? 1 : 0;
  }
  tracker.finish();
  run.measurement = *tracker.readout();
  run.trial.correction = run.measurement.correction();
  run.trial.sigma = run.measurement.sigma();
  run.trial.measured = run.measurement.images().size();
  return run;
}

/// Median time between frames [s].
double interval_of(const Sequence& sequence) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < sequence.frames.size(); ++i)
    intervals.push_back(sequence.frames[i].t_rgb - sequence.frames[i - 1].t_rgb);
  return median_of(intervals);
}

/// Why a run says nothing, whatever the others do; empty where it says something.
std::string what_is_missing(const ReadoutTrial& now, std::size_t frames) {
  if (2 * now.tracked < frames) return fmt::format("only {} of {} frames are tracked", now.tracked, frames);
  if (now.measured > 0 && !(now.sigma < kTooVague)) return "the camera moves too little";
  constexpr std::size_t kFewest = 12;  // two per segment of the shortest interval
  if (now.measured < kFewest)
    return fmt::format("only {} frames follow close enough on another to tell of their rows", now.measured);
  return {};
}

}  // namespace

ReadoutReport measure_readout(const Sequence& sequence, const CameraConfig& camera,
                              const std::function<void(const ReadoutTrial&)>& progress) {
  ReadoutReport report;
  report.frames = sequence.frames.size();
  const double interval = interval_of(sequence);
  constexpr double kRounded = 0.99;  // stamps are: at 5 Hz half of the frames would be measured by chance
  const double farthest = kRounded * TrackerOptions().search.longest_motion();
  if (!(interval < farthest)) {
    report.why_not = fmt::format(
        "frames are {:.2f} s apart, too far to tell how the camera moves while it reads its rows: record at "
        "more "
        "than {:.0f} frames per second",
        interval, 1 / farthest);
    return report;
  }
  const double longest = interval;  // rows are read before the next frame's are
  const auto tried = [&](double assumed) {
    Run run = run_as_if(sequence, camera, assumed);
    report.trials.push_back(run.trial);
    if (progress) progress(run.trial);
    report.why_not = what_is_missing(run.trial, report.frames);
    return run;
  };
  Run low = tried(0);
  if (!report.why_not.empty()) return report;
  Run high = tried(std::copysign(longest, low.trial.correction));
  // Too short a time asks for more, too long a one for less, though not in proportion: from the line between
  // the two the next two are chosen, on either side and nearer.
  constexpr int kRounds = 3;
  for (int round = 0; report.why_not.empty(); ++round) {
    if (high.trial.assumed < low.trial.assumed) std::swap(low, high);
    const auto found =
        readout_between<double>(low.measurement, low.trial.assumed, high.measurement, high.trial.assumed);
    if (!found || !(std::abs(found->time) < 2 * longest)) {
      report.why_not = "rows say nothing of it: turn the camera quicker, in all directions";
      break;
    }
    const double middle = (low.trial.assumed + high.trial.assumed) / 2;
    if (round > 0 && (std::abs(found->time - middle) <= kBeside || round == kRounds)) {
      const double vague = interval / 4;
      if (found->half_width < vague) {
        report.readout = found->time;
        report.half_width = found->half_width;
      } else {
        report.why_not = fmt::format(
            "rows leave it open between {:.3f} and {:.3f} s: record longer, and turn "
            "the camera quicker, in all directions",
            found->time - found->half_width, found->time + found->half_width);
      }
      break;
    }
    const double next = std::clamp(found->time, -longest, longest);
    low = tried(next - kBeside);
    if (report.why_not.empty()) high = tried(next + kBeside);
  }
  return report;
}

std::optional<std::string> readout_doubt(const Sequence& sequence, const CameraConfig& camera) {
  constexpr std::size_t kFewest = 30;  // frames
  constexpr double kShort = 0.004;     // seconds: little depends on less
  if (camera.readout_time != 0 || sequence.frames.size() < kFewest) return std::nullopt;
  const ReadoutReport measured = measure_readout(sequence, camera);
  if (!measured.readout || std::abs(*measured.readout) < std::max(kShort, measured.half_width))
    return std::nullopt;
  return fmt::format(
      "the rows of colour images are read in {:.3f} +- {:.3f} s, of which {} "
      "says nothing: a camera file with readout_time = {:.3f} does",
      *measured.readout, measured.half_width,
      camera.name == "camera" ? "the camera's file" : "the camera " + camera.name, *measured.readout);
}

std::vector<std::string> readout_doubts(const ReadoutMeasurement<double>& run, const Sequence& sequence,
                                        const CameraConfig& camera) {
  // The map has taken most of the shear: what is left of it is a suspicion, no measurement.
  constexpr double kSuspicious = 0.001;  // seconds: a twentieth of what most cameras take is left
  constexpr std::size_t kFewest = 50;    // frames: fewer leave it open
  if (camera.readout_time != 0 || run.images().size() < kFewest ||
      !(std::abs(run.correction()) > kSuspicious))
    return {};
  // Asked of those frames of a few seconds that say most.
  constexpr std::size_t kFrames = 90;
  const std::span<const ReadoutImage<double>> images = run.images();
  const std::size_t length = std::min(kFrames, images.size());
  double information = 0, most = 0;
  std::size_t best = length;  // one behind the last
  for (std::size_t i = 0; i < images.size(); ++i) {
    information += images[i].information - (i >= length ? images[i - length].information : 0);
    if (i + 1 < length || information <= most) continue;
    most = information;
    best = i + 1;
  }
  Sequence part = sequence;
  std::erase_if(part.frames, [&](const FrameRecord& frame) {
    return frame.t_rgb < images[best - length].t || frame.t_rgb > images[best - 1].t;
  });
  const std::optional<std::string> doubt = readout_doubt(part, camera);
  return doubt ? std::vector<std::string>{*doubt} : std::vector<std::string>();
}

}  // namespace dynslam::runtime
