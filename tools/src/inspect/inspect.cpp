// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/inspect/inspect.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/inspect/readout.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "inspect/measure.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
using inspect::Burst;

/// Frames that cannot be decoded.
struct Undecoded {
  std::size_t count = 0;
  std::string first;  // place and reason
};

/// Bursts of consecutive frames, spread over the sequence.
std::vector<Burst> take_bursts(const Sequence& sequence, const CameraConfig& camera,
                               const InspectOptions& options, Undecoded& undecoded) {
  const std::size_t n = sequence.frames.size(), length = std::min(std::max<std::size_t>(1, options.burst), n);
  const std::size_t count = std::clamp<std::size_t>(n / length, 1, std::max<std::size_t>(1, options.bursts));
  std::vector<Burst> bursts(count);
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t start = count > 1 ? (n - length) * k / (count - 1) : 0;
    for (std::size_t i = start; i < start + length; ++i) {
      try {
        bursts[k].push_back(decode_frame(sequence.frames[i], i, camera));
      } catch (const InputError& error) {
        if (undecoded.count++ == 0) undecoded.first = error.what();
      }
    }
  }
  return bursts;
}

/// Depth statistics over the frames at the ends of the bursts and in their middle.
void measure_depth(const std::vector<Burst>& bursts, const CameraConfig& camera, SequenceReport& report) {
  std::vector<double> depths;
  std::size_t pixels = 0, valid = 0, largest = 0;
  const float most = static_cast<float>(65535 / camera.depth_units_per_metre);
  for (const Burst& burst : bursts) {
    report.sampled += burst.size();
    for (std::size_t i = 0; i < burst.size(); i += std::max<std::size_t>(1, burst.size() / 2)) {
      const cv::Mat& depth = burst[i].depth;
      constexpr int kStep = 3;  // pixels
      for (int v = 0; v < depth.rows; v += kStep) {
        for (int u = 0; u < depth.cols; u += kStep) {
          const float z = depth.at<float>(v, u);
          ++pixels;
          if (!(z > 0)) continue;
          ++valid;
          largest += z >= most * 0.99999F ? 1 : 0;
          depths.push_back(double(z));
        }
      }
    }
  }
  if (pixels == 0) return;
  report.depth_valid = static_cast<double>(valid) / static_cast<double>(pixels);
  constexpr std::array<double, 5> kShares{0.05, 0.25, 0.5, 0.75, 0.95};
  for (std::size_t k = 0; k < kShares.size(); ++k)
    report.depth_quantiles[k] = inspect::quantile(depths, kShares[k]);
  constexpr double kMany = 0.02, kSparse = 0.2;  // shares of the pixels
  if (!report.sequence.float_depth && static_cast<double>(largest) > kMany * static_cast<double>(pixels))
    report.warnings.push_back(
        fmt::format("{:.0f} % of the depth pixels are 65535, which is no measurement: a camera file with "
                    "invalid_depth = 65535 says so",
                    100 * static_cast<double>(largest) / static_cast<double>(pixels)));
  if (report.depth_valid < kSparse)
    report.warnings.push_back(
        fmt::format("only {:.0f} % of the pixels have depth", 100 * report.depth_valid));
}

void judge_scale(const CameraConfig& camera, SequenceReport& report) {
  const bool metres = report.sequence.float_depth && !report.sequence.frames.front().float_units;
  constexpr double kNearest = 0.1, kFarthest = 50;  // metres
  const double middle = report.depth_quantiles[2];
  if (middle > 0 && (middle < kNearest || middle > kFarthest))
    report.warnings.push_back(fmt::format(
        "half of the depth is {} {:.3g} m: {}", middle < kNearest ? "below" : "beyond", middle,
        metres
            ? "it is stored as floats, which are metres"
            : fmt::format("the camera's {} depth units per metre are wrong", camera.depth_units_per_metre)));
  const TruthReport& truth = report.truth;
  constexpr double kScaleError = 0.2;
  // Where people fill the view, few motions can be measured, and these are not the camera's.
  if (2 * truth.agreeing < truth.motions && 2 * truth.motions >= truth.bursts)
    report.warnings.push_back(fmt::format(
        "{} of {} motions measured in the images are not the ground truth's: other times, other axes "
        "or another camera",
        truth.motions - truth.agreeing, truth.motions));
  if (truth.scale && std::abs(*truth.scale - 1) > kScaleError)
    report.warnings.push_back(fmt::format(
        "depth times {:.3f} is what the ground truth's motion asks for{}", *truth.scale,
        metres ? ": it is stored as floats, which are metres"
               : fmt::format(": about {:.0f} depth units per metre, not {}",
                             camera.depth_units_per_metre / *truth.scale, camera.depth_units_per_metre)));
}

/// The line of a camera file that mends stamps of depth. @param offset  [s]
std::string offset_key(double offset) {
  return fmt::format("; a camera file with depth_time_offset = {:.3f} says so", offset);
}

void judge_edges(const CameraConfig& camera, SequenceReport& report) {
  const EdgeReport& edges = report.edges;
  if (!edges.measured) return;
  constexpr double kGain = 1.1;
  const double rate = report.stamps.colour_rate;
  if (edges.lag != 0 && edges.lag_gain > kGain) {
    report.warnings.push_back(fmt::format(
        "depth comes {:.1f} frames {}{}: its edges fit the colour image {} frame{} {} {:.2f} times better{}",
        std::abs(edges.late), edges.lag > 0 ? "late" : "early",
        rate > 0 ? fmt::format(" ({:.0f} ms)", 1000 * std::abs(edges.late) / rate) : "", std::abs(edges.lag),
        std::abs(edges.lag) > 1 ? "s" : "", edges.lag > 0 ? "before" : "behind", edges.lag_gain,
        rate > 0 ? offset_key(camera.depth_time_offset + report.stamps.delay_median + edges.late / rate)
                 : ""));
  }
  constexpr double kShift = 0.01;  // of the width
  if (std::hypot(edges.shift_x, edges.shift_y) > kShift * camera.width && edges.shift_gain > kGain)
    report.warnings.push_back(
        fmt::format("depth is not registered to colour: its edges fit best when moved by {:.0f} px to the "
                    "{} and {:.0f} px {}",
                    std::abs(edges.shift_x), edges.shift_x < 0 ? "left" : "right", std::abs(edges.shift_y),
                    edges.shift_y < 0 ? "up" : "down"));
}

/// @param depth_offset  the camera's, which is off the times already [s]
void judge_stamps(double depth_offset, SequenceReport& report) {
  const StampReport& s = report.stamps;
  const double interval = s.colour_rate > 0 ? 1 / s.colour_rate : 0;
  constexpr double kLate = 0.3, kSteady = 0.1;  // of an interval
  // Where the camera says when depth is taken, it was; and the images themselves say more than their stamps.
  const bool edges_say = report.edges.measured && report.edges.lag != 0;
  if (report.sequence.has_stamps && depth_offset == 0 && !edges_say &&
      std::abs(s.delay_median) > kLate * interval && s.delay_spread < kSteady * interval)
    report.warnings.push_back(fmt::format("depth stamps are {:.1f} ms {} those of colour throughout{}",
                                          1000 * std::abs(s.delay_median),
                                          s.delay_median > 0 ? "after" : "before",
                                          ": if the images were taken at once" + offset_key(s.delay_median)));
  constexpr double kPaired = 0.8;
  if (static_cast<double>(s.pairs) < kPaired * static_cast<double>(s.colour_images))
    report.warnings.push_back(fmt::format("{} of {} colour images have no depth image{}",
                                          s.colour_images - s.pairs, s.colour_images,
                                          report.sequence.has_stamps ? " within 20 ms" : ""));
  if (s.gaps.empty()) return;
  const auto longest = std::max_element(s.gaps.begin(), s.gaps.end(),
                                        [](const auto& a, const auto& b) { return a.length < b.length; });
  std::size_t missing = 0;
  for (const auto& gap : s.gaps) missing += gap.missing;
  report.warnings.push_back(
      fmt::format("{} gap{}: {} frames are missing; the longest is {:.3f} s, {:.3f} s after "
                  "the start",
                  s.gaps.size(), s.gaps.size() > 1 ? "s" : "", missing, longest->length, longest->t));
}

/// Rows that are read one after the other, of a camera that does not say so.
void judge_readout(const CameraConfig& camera, SequenceReport& report) {
  constexpr std::size_t kMost = 150;  // frames: some seconds of computing
  if (report.undecodable) return;
  Sequence part = report.sequence;
  part.frames.resize(std::min(part.frames.size(), kMost));
  if (const auto doubt = readout_doubt(part, camera)) report.warnings.push_back(*doubt);
}

std::string quoted(const std::string& text) {
  const bool plain = !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("/._-+,:@%").find(static_cast<char>(c)) != std::string::npos;
  });
  if (plain) return text;
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

std::string command_for(const fs::path& root, const InspectOptions& options, const SequenceReport& report) {
  std::string command = "dynslam run " + quoted(root.string());
  if (!options.reading.format.empty()) command += " --format " + options.reading.format;
  if (!options.reading.topics.empty()) command += " --topics " + quoted(options.reading.topics);
  if (!report.sequence.has_stamps) command += fmt::format(" --rate {}", options.reading.rate);
  if (!options.camera.empty()) command += " --camera " + quoted(options.camera);
  if (!report.camera) command += " --camera FILE";
  return command;
}

/// Of the right size, for what needs no calibration.
CameraConfig any_camera(cv::Size size) {
  CameraConfig camera;
  camera.width = size.width;
  camera.height = size.height;
  camera.model = Pinhole<double>(size.width, size.width, size.width / 2.0, size.height / 2.0);
  return camera;
}

void find_camera(const InspectOptions& options, SequenceReport& report) {
  const Sequence& sequence = report.sequence;
  if (options.camera.empty() && sequence.camera_hint.empty() && !sequence.camera) {
    report.warnings.push_back("the camera is not known: give --camera, or put a camera.txt into the folder");
    return;
  }
  report.camera = camera_of(sequence, options.camera);
  if (!options.camera.empty()) {
    report.camera_source = "--camera " + options.camera;
  } else if (sequence.camera_hint.empty()) {
    report.camera_source = sequence.camera_source;
  } else {
    report.camera_source =
        sequence.camera_hint == sequence.folder_camera ? "the folder's name" : sequence.camera_hint;
  }
}

}  // namespace

SequenceReport inspect_sequence(const fs::path& root, const InspectOptions& options) {
  SequenceReport report;
  SequenceOptions reading = options.reading;
  reading.camera = options.camera;
  report.sequence = load_sequence(root, reading);
  const Sequence& sequence = report.sequence;
  report.warnings = sequence.notes;
  find_camera(options, report);
  report.stamps = inspect::measure_stamps(sequence);
  report.colour_size =
      inspect::image_size(sequence.frames.front(), ImageSource::Kind::colour).value_or(cv::Size());
  report.depth_size =
      inspect::image_size(sequence.frames.front(), ImageSource::Kind::depth).value_or(cv::Size());
  for (std::string& warning : inspect::check_files(sequence, report.camera ? &*report.camera : nullptr))
    report.warnings.push_back(std::move(warning));
  if (report.camera) {
    for (std::string& warning : camera_doubts(sequence, *report.camera))
      report.warnings.push_back(std::move(warning));
  }
  if (report.camera || !report.depth_size.empty()) {
    const CameraConfig camera = report.camera ? *report.camera : any_camera(report.depth_size);
    Undecoded undecoded;
    const std::vector<Burst> bursts = take_bursts(sequence, camera, options, undecoded);
    measure_depth(bursts, camera, report);
    if (undecoded.count > 0)
      report.warnings.push_back(fmt::format("{} of {} frames looked at cannot be decoded, the first: {}",
                                            undecoded.count, undecoded.count + report.sampled,
                                            undecoded.first));
    report.undecodable = report.sampled == 0;
    report.edges = inspect::measure_edges(bursts);
    report.truth = inspect::measure_truth(sequence, camera, bursts);
    if (report.camera) judge_scale(camera, report);
    judge_edges(camera, report);
    if (report.camera) judge_readout(camera, report);
  }
  for (std::string& warning : time_doubts(sequence)) report.warnings.push_back(std::move(warning));
  judge_stamps(report.camera ? report.camera->depth_time_offset : 0, report);
  if (!report.undecodable) report.command = command_for(root, options, report);
  return report;
}

}  // namespace dynslam::runtime
