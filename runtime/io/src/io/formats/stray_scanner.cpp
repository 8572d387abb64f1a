// SPDX-License-Identifier: BSD-3-Clause
// Stray Scanner, an app that records RGB-D with phones: a video, depth of a lower resolution, the phone's own
// odometry.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/convert.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/formats/format.hpp"
#include "io/video_images.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 2> kPhoneDepth{".png", ".npy"};
constexpr std::array<std::string_view, 1> kPhoneConfidence{".png"};

bool is_stray_scanner(const fs::path& root) {
  return fs::exists(root / "camera_matrix.csv") && fs::exists(root / "odometry.csv") &&
         fs::is_directory(root / "depth");
}

std::string without_commas(std::string text) {
  std::replace(text.begin(), text.end(), ',', ' ');
  return text;
}

/// The video's camera, scaled to the images that are returned.
CameraConfig phone_camera(const fs::path& file, cv::Size video, cv::Size size) {
  std::istringstream in(without_commas(read_text(file)));
  LineReader reader(in);
  std::array<double, 9> k{};
  for (std::size_t row = 0; row < 3; ++row) {
    if (!reader.next()) throw InputError(file.string(), reader.number(), "ends before the matrix of 3 x 3");
    const auto words = split_words(reader.line());
    if (words.size() != 3) throw InputError(file.string(), reader.number(), "expected 3 numbers");
    for (std::size_t c = 0; c < 3; ++c) {
      const auto value = parse_number(words[c]);
      if (!value)
        throw InputError(file.string(), reader.number(), fmt::format("'{}' is not a number", words[c]));
      k[3 * row + c] = *value;
    }
  }
  constexpr double kMillimetres = 1000;
  return scaled_camera(
      pinhole_camera("stray-scanner",
                     {double(video.width), double(video.height), k[0], k[4], k[2], k[5], kMillimetres},
                     file.string()),
      size);
}

/// A row of the odometry.
struct PhoneFrame {
  double t = 0;
  std::size_t number = 0;
  std::string pose;  ///< time and pose, as TUM's lists have them
};

std::vector<PhoneFrame> parse_phone_frames(const fs::path& file) {
  std::istringstream in(without_commas(read_text(file)));
  LineReader reader(in);
  std::vector<PhoneFrame> frames;
  constexpr std::size_t kColumns =
      9;  // timestamp, frame, x, y, z, qx, qy, qz, qw; some have the camera's after them
  while (reader.next()) {
    const auto words = split_words(reader.line());
    if (frames.empty() && !words.empty() && words.front() == "timestamp") continue;
    const auto fail = [&](const std::string& what) {
      return InputError(file.string(), reader.number(), what);
    };
    if (words.size() < kColumns)
      throw fail(fmt::format("expected {} columns, found {}", kColumns, words.size()));
    const auto t = parse_number(words[0]), number = parse_number(words[1]);
    constexpr double kMost = 1e8;
    if (!t || !number || !(*number >= 0 && *number <= kMost) || *number != std::floor(*number))
      throw fail("does not begin with a time and the number of a frame");
    if (!frames.empty() && (*t <= frames.back().t || *number <= double(frames.back().number)))
      throw fail("times and numbers do not increase");
    PhoneFrame frame{*t, static_cast<std::size_t>(*number), std::string(words[0])};
    for (std::size_t k = 2; k < kColumns; ++k) frame.pose += fmt::format(" {}", words[k]);
    frames.push_back(std::move(frame));
  }
  if (frames.empty()) throw InputError(file.string(), 0, "lists no frames");
  return frames;
}

/// At most 640 wide: the sensor measures 256 x 192, and the video has 1920 x 1440.
cv::Size handed_out(cv::Size video) {
  constexpr int kWidth = 640;
  if (video.width <= kWidth) return video;
  return {kWidth, static_cast<int>(std::lround(double(video.height) * kWidth / video.width))};
}

Sequence load_stray_scanner(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  const fs::path video = root / "rgb.mp4", odometry = root / "odometry.csv";
  const cv::Size stored = VideoImages::stored_size(video), size = handed_out(stored);
  sequence.camera = phone_camera(root / "camera_matrix.csv", stored, size);
  sequence.camera_source = (root / "camera_matrix.csv").string();
  if (size != stored)
    sequence.camera_source += fmt::format(", scaled from the video's {}x{}", stored.width, stored.height);
  std::map<std::size_t, fs::path> depth, confidence;
  for (const auto& file : numbered_files(root / "depth", "", kPhoneDepth)) depth[file.number] = file.path;
  for (const auto& file : numbered_files(root / "confidence", "", kPhoneConfidence))
    confidence[file.number] = file.path;
  const std::vector<PhoneFrame> rows = parse_phone_frames(odometry);
  std::vector<VideoDepth> files(rows.back().number + 1);
  std::string poses;
  for (const PhoneFrame& row : rows) {
    sequence.colour_times.push_back(row.t);
    poses += row.pose + "\n";
    const auto found = depth.find(row.number);
    if (found == depth.end()) continue;
    sequence.depth_times.push_back(row.t);
    const auto sure = confidence.find(row.number);
    files[row.number] = {found->second, sure == confidence.end() ? fs::path() : sure->second};
    FrameRecord frame;
    frame.t_rgb = frame.t_depth = row.t;
    frame.stamp = fmt::format("{:.6f}", row.t);
    frame.rgb = fs::path(fmt::format("{}: frame {}", video.string(), row.number));
    frame.depth = found->second;
    frame.colour_number = frame.depth_number = row.number;
    sequence.frames.push_back(std::move(frame));
  }
  if (sequence.frames.empty())
    throw InputError(root.string(), 0, "depth/ has no image of a frame that odometry.csv lists");
  const auto images = std::make_shared<const VideoImages>(video, std::move(files), size);
  for (FrameRecord& frame : sequence.frames) frame.source = images;
  shift_depth_times(sequence, depth_time_offset(sequence, options));
  read_optional_truth(sequence, odometry, [&] {
    std::istringstream in(poses);
    return parse_usable_poses(in, odometry.string());
  });
  sequence.truth_turned = "ground truth: the phone's own odometry stands for it";
  return sequence;
}

}  // namespace

const Format kStrayScanner{"stray-scanner", "rgb.mp4, depth/N.png, odometry.csv, camera_matrix.csv",
                           is_stray_scanner, load_stray_scanner};

}  // namespace dynslam::runtime::formats
