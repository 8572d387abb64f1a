// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/convert.hpp"

#include <fmt/format.h>

#include <array>
#include <map>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/time_stamp.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "io/argument_check.hpp"
#include "io/make_folder.hpp"

namespace fs = std::filesystem;

namespace dynslam::runtime {
namespace {

/// The lines of the lists of a sequence.
struct Lists {
  std::string colour, depth, pairs;
  /// Which depth image, by name and number, a new file is of.
  std::map<std::string, std::pair<std::string, std::size_t>> depth_files{};
};

std::string seconds(double t, std::int64_t ns) {
  return ns % 1000 != 0 ? nanosecond_text(ns) : fmt::format("{:.6f}", t);
}

cv::Mat scaled_colour(const cv::Mat& image, cv::Size size) {
  if (image.size() == size) return image;
  cv::Mat scaled;
  const bool smaller = size.width <= image.cols && size.height <= image.rows;
  cv::resize(image, scaled, size, 0, 0, smaller ? cv::INTER_AREA : cv::INTER_CUBIC);
  return scaled;
}

/// 16-bit depth in the camera's units; what is none, or does not fit into 16 bits, is 0 and counted.
cv::Mat scaled_depth(const cv::Mat& metres, cv::Size size, double units, ConvertReport& report) {
  cv::Mat raw(metres.size(), CV_16UC1), scaled;
  for (int v = 0; v < metres.rows; ++v) {
    const auto* z = metres.ptr<float>(v);
    auto* out = raw.ptr<std::uint16_t>(v);
    for (int u = 0; u < metres.cols; ++u) {
      const double value = static_cast<double>(z[u]) * units + 0.5;
      const bool fits = value >= 1 && value < 65536;  // NaN: no
      out[u] = fits ? static_cast<std::uint16_t>(value) : std::uint16_t(0);
      report.depth_pixels += z[u] > 0 ? 1 : 0;
      report.too_far += z[u] > 0 && !fits ? 1 : 0;
    }
  }
  report.without_depth += cv::countNonZero(raw) == 0 ? 1 : 0;
  if (raw.size() == size) return raw;
  cv::resize(raw, scaled, size, 0, 0, cv::INTER_NEAREST_EXACT);
  return scaled;
}

/// The new file of a frame's depth: under the time of depth or, where that is another image's, too, under
/// both times. Colour's alone might be another image's time of depth.
/// @return the file, and whether no frame before has it
std::pair<std::string, bool> depth_file_of(const FrameRecord& record, const std::string& t,
                                           const std::string& t_depth, Lists& lists) {
  const std::pair image(record.depth.string(), record.depth_number);
  std::string file = "depth/" + t_depth + ".png";
  const auto [place, added] = lists.depth_files.emplace(file, image);
  if (added || place->second == image) return {std::move(file), added};
  file = fmt::format("depth/{}_{}.png", t_depth, t);
  lists.depth_files.emplace(file, image);
  return {std::move(file), true};
}

void write_frame(const RgbdFrame& frame, const FrameRecord& record, cv::Size size, double units,
                 const fs::path& out, Lists& lists, ConvertReport& report) {
  const std::string t = seconds(record.t_rgb, record.ns), t_depth = seconds(record.t_depth, 0);
  const std::string colour = "rgb/" + t + ".png";
  const auto [depth, is_new] = depth_file_of(record, t, t_depth, lists);
  write_image(out / colour, scaled_colour(frame.bgr, size));
  write_image(out / depth, scaled_depth(frame.depth, size, units, report));
  lists.colour += fmt::format("{} {}\n", t, colour);
  if (is_new) lists.depth += fmt::format("{} {}\n", t_depth, depth);
  lists.pairs += fmt::format("{} {} {} {}\n", t, colour, t_depth, depth);
}

void check(const fs::path& out, cv::Size size, std::size_t every) {
  check_argument(every >= 1, "convert: `every` must be 1 or more");
  const auto fits = [](int side) { return side >= 64 && side <= kLongestSide; };
  if (!fits(size.width) || !fits(size.height))
    throw UsageError(
        fmt::format("images of {}x{}: each side must be from 64 to 8192 pixels", size.width, size.height));
  std::error_code error;
  const bool begun = fs::is_regular_file(out / kUnfinished, error) &&
                     !fs::exists(out / "synth.json", error);  // which `synth` has begun
  if (!begun && fs::exists(out, error) && !(fs::is_directory(out, error) && fs::is_empty(out, error)))
    throw InputError(out.string(), 0, "is not an empty folder: choose another one");
}

}  // namespace

CameraConfig scaled_camera(const CameraConfig& camera, cv::Size size) {
  CameraConfig scaled = camera;
  if (cv::Size(camera.width, camera.height) == size) return scaled;
  scaled.width = size.width;
  scaled.height = size.height;
  const double x = static_cast<double>(size.width) / camera.width,
               y = static_cast<double>(size.height) / camera.height;
  const Pinhole<double>& p = camera.model.pinhole();
  // The centre of the first pixel is 0, its left end -0.5.
  const double fx = p.fx() * x, fy = p.fy() * y, cx = (p.cx() + 0.5) * x - 0.5, cy = (p.cy() + 0.5) * y - 0.5;
  if (const KannalaBrandt<double>* fisheye = camera.model.kannala_brandt()) {
    scaled.model = KannalaBrandt<double>(fx, fy, cx, cy, fisheye->coefficients());
  } else {
    scaled.model =
        PinholeBrownConrady<double>(Pinhole<double>(fx, fy, cx, cy), *camera.model.brown_conrady());
  }
  return scaled;
}

ConvertReport convert_sequence(const Sequence& sequence, const CameraConfig& camera, const fs::path& out,
                               const ConvertOptions& options,
                               const std::function<void(std::size_t, std::size_t)>& progress) {
  const cv::Size size = options.size.empty() ? cv::Size(camera.width, camera.height) : options.size;
  check(out, size, options.every);
  make_folder(out);
  const FileHandle lock = lock_folder(out);
  begin_sequence(out, std::array{"rgb", "depth"});
  Sequence taken;
  for (std::size_t i = 0; i < sequence.frames.size(); i += options.every)
    taken.frames.push_back(sequence.frames[i]);
  const std::size_t total = taken.frames.size();
  ConvertReport report;
  Lists lists;
  FrameStream stream(taken, camera);
  while (const std::optional<FrameResult> next = stream.next()) {
    if (next->frame) {
      write_frame(*next->frame, next->record, size, camera.depth_units_per_metre, out, lists, report);
      ++report.written;
    } else {
      report.broken.push_back(next->error);
    }
    if (progress) progress(next->index + 1, total);
  }
  check_readable(sequence.root.string(), total, report.broken);
  write_file(out / "rgb.txt", lists.colour);
  write_file(out / "depth.txt", lists.depth);
  CameraConfig written = scaled_camera(camera, size);
  written.invalid_depth = 0;      // it is 0 here
  written.depth_time_offset = 0;  // times of depth are when it was taken
  write_file(out / "camera.txt", camera_text(written));
  if (!sequence.groundtruth.empty()) write_trajectory(out / "groundtruth.txt", sequence.groundtruth);
  write_file(out / "associations.txt", lists.pairs);
  fs::remove(out / kUnfinished);
  return report;
}

}  // namespace dynslam::runtime
