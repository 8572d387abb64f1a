// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core/types.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/image_source.hpp"

namespace dynslam::runtime {

/// A path by its text alone: std::filesystem::path keeps an object for each of its components, which is most
/// of the memory of a list with a million images.
class ImagePath {
 public:
  ImagePath() = default;
  ImagePath(const std::filesystem::path& path) : text_(path.string()) {}
  ImagePath(std::string text) : text_(std::move(text)) {}
  operator std::filesystem::path() const { return text_; }
  [[nodiscard]] const std::string& string() const { return text_; }
  [[nodiscard]] std::filesystem::path filename() const { return std::filesystem::path(text_).filename(); }

 private:
  std::string text_;
};

/// One colour image with its depth image.
struct FrameRecord {
  double t_rgb = 0,
         t_depth = 0;      ///< [s]; of depth, when it was taken: CameraConfig::depth_time_offset is off
  std::string stamp;       ///< colour time or number as the folder prints it; names masks and results
  ImagePath rgb, depth;    ///< files; with a `source` names for messages alone
  std::int64_t ns{};       ///< t_rgb in nanoseconds, as it was recorded; 0: unknown
  cv::Size colour_size{};  ///< of the colour file [px] where it is to be scaled to the camera's; else empty
  std::shared_ptr<const ImageSource> source{};      ///< of images that are no files; else null
  std::size_t colour_number = 0, depth_number = 0;  ///< there
  bool float_units = false;  ///< depth of 32-bit floats is in the camera's units, not in metres
  bool float_bytes = false;  ///< depth is an image of four channels: the bytes of a 32-bit float
};

/// A recorded sequence on disk, in a folder or a file: what every format fills.
struct Sequence {
  std::filesystem::path root;
  std::string format{};                            ///< tum, 7-scenes, ...: one of sequence_formats()
  std::vector<FrameRecord> frames{};               ///< by colour time
  std::string camera_hint{};                       ///< fr1, fr2, fr3, the sequence's camera file, or empty
  std::vector<StampedPose<double>> groundtruth{};  ///< empty where there is none
  std::optional<CameraConfig> camera{};            ///< that the format brings; camera_hint goes before it
  std::string camera_source{};                     ///< where `camera` is from, for people
  std::string folder_camera{};         ///< fr1, fr2, fr3, bonn where the folder's name speaks of it
  std::filesystem::path truth_file{};  ///< file or folder of the ground truth
  std::vector<double> colour_times{}, depth_times{};  ///< of all images, those without a partner, too [s]
  std::string topics{};                               ///< of a bag, "COLOUR,DEPTH", as chosen
  std::string truth_missing{};       ///< why there is no ground truth, where the format knows
  std::string truth_turned{};        ///< how poses of a body became the camera's, in a line; empty: they were
  std::vector<std::string> notes{};  ///< what is left out or missing of it, one line each
  double depth_units = 0;    ///< per metre, of a camera that does not say so; 0: as load_camera() has it
  bool float_depth = false;  ///< depth images are 32-bit floats: metres, unless FrameRecord::float_units
  bool has_stamps = true;    ///< times are recorded; else they are frame number / rate
};

/// How a sequence is read.
struct SequenceOptions {
  double max_association_difference = 0.02;  ///< seconds between colour and depth
  std::size_t max_frames = 0;                ///< 0: all
  std::string format{};                      ///< one of sequence_formats(); empty: by looking at the folder
  std::string topics{};                      ///< of a bag, "COLOUR,DEPTH"; empty: by looking at it
  double rate = 30;                          ///< frames per second, of formats without time stamps
  std::string camera{};          ///< as camera_of()'s: its depth_time_offset goes into the pairing of images
  double depth_time_offset = 0;  ///< 0: the camera's
};

/// A format and the files that it is recognised by.
struct SequenceFormat {
  std::string_view name, files;
};
/// All formats: tum, bonn, eth3d, icl-nuim, 7-scenes, replica, scannet, redwood, tartanair,
/// stray-scanner, bag, ros2. See
/// docs/your-own-data.md.
[[nodiscard]] std::vector<SequenceFormat> sequence_formats();
/// The formats that a folder, or a file, looks like; more than one where it holds the files of several.
[[nodiscard]] std::vector<std::string> formats_of(const std::filesystem::path& root);

/// Reads a sequence's lists, camera and ground truth; images are not decoded. A camera file in the folder
/// (camera_file_in()) goes before the camera of the format.
/// @throws InputError  a folder of no known format, or of several, or one that is not yet whole
///         (unfinished.txt); files that are missing or malformed
/// @throws UsageError  an unknown name of a format
[[nodiscard]] Sequence load_sequence(const std::filesystem::path& root, const SequenceOptions& options = {});

/// @throws UsageError where a folder for results holds images of the sequence, or its true masks, which they
/// would replace
void check_no_input(const Sequence& sequence, const std::filesystem::path& folder);

/// The camera of a sequence, or the one named instead (see load_camera(); values that mean "no depth" are
/// the format's where that camera names none).
/// @throws UsageError where neither the sequence nor `name_or_file` says it, InputError for a bad file
[[nodiscard]] CameraConfig camera_of(const Sequence& sequence, const std::string& name_or_file = {});

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
