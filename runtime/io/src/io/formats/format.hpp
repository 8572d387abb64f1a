// SPDX-License-Identifier: BSD-3-Clause
// What the formats of sequences share. Internal to the runtime.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <istream>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"

namespace dynslam::runtime::formats {

/// A format of sequences: whether a folder has the files that this one alone has, and how it is read.
struct Format {
  std::string_view name, files;
  bool (*matches)(const std::filesystem::path& root);
  /// Fills frames with full paths, times, camera and ground truth. @throws InputError
  Sequence (*load)(const std::filesystem::path& root, const SequenceOptions& options);
};

extern const Format kTum, kBonn, kEth3d, kIclNuim, kSevenScenes, kReplica, kScanNet, kRedwood, kTartanAir,
    kStrayScanner, kBag, kRos2;

/// The name of a folder, also where the path ends in a slash or is a dot.
[[nodiscard]] std::string folder_name(const std::filesystem::path& root);

/// fr1, fr2 or fr3 where a folder's or file's name speaks of it, as TUM's do: rgbd_dataset_freiburg1_xyz,
/// fr1_xyz.
[[nodiscard]] std::string camera_by_name(const std::string& name);

/// What the stamps of depth images are late [s]: by the options, or by the camera that they name, or by the
/// one that the sequence's folder or hint says. @throws as load_camera()
[[nodiscard]] double depth_time_offset(const Sequence& sequence, const SequenceOptions& options);

/// Depth images of pairs that stay as they are were taken `offset` seconds before their times.
void shift_depth_times(Sequence& sequence, double offset);

/// Frames listed by TUM's files: associations in the file of that name where it is there, else rgb.txt and
/// depth.txt. @throws InputError
void read_lists(Sequence& sequence, const std::string& associations, const SequenceOptions& options);

/// A file whose name is PREFIX NUMBER[-MICROSECONDS] SUFFIX.
struct NumberedFile {
  std::uint64_t number = 0;
  std::optional<std::uint64_t> microseconds;
  std::string stem;  ///< prefix and numbers, as the name has them
  std::filesystem::path path;
};
/// The files of a folder by number (10 comes after 9), the suffixes in any case of letters; numbers of at
/// most 9 digits. Empty where there is no such folder. @throws InputError where a number occurs twice
[[nodiscard]] std::vector<NumberedFile> numbered_files(const std::filesystem::path& folder,
                                                       std::string_view prefix,
                                                       std::span<const std::string_view> suffixes);
/// The images of a folder whose names differ by a number alone, whatever stands before and behind it: by
/// number, or by time where the number is one (with a point, or of 10, 13, 16 or 19 digits: seconds to
/// nanoseconds since 1970). Of several patterns the one of most files counts.
struct NumberedImages {
  std::vector<NumberedFile> files;
  std::size_t others = 0;  ///< images of other names
  std::string first_other;
};
/// @throws InputError where a number occurs twice
[[nodiscard]] NumberedImages numbered_images(const std::filesystem::path& folder,
                                             std::span<const std::string_view> suffixes);
inline constexpr std::array<std::string_view, 3> kImageSuffixes{".png", ".jpg", ".jpeg"};
inline constexpr std::array<std::string_view, 5> kDepthSuffixes{".png", ".npy", ".tif", ".tiff", ".exr"};

/// Pairs images of equal numbers; times are number / rate, depth's less depth_time_offset(). Images without a
/// partner are in the times alone. @throws InputError where no two belong together
void pair_by_number(Sequence& sequence, const std::vector<NumberedFile>& colour,
                    const std::vector<NumberedFile>& depth, const SequenceOptions& options);

/// Floats are metres (REP 118). Where the middle of three images is farther than any depth camera sees, they
/// are in the camera's units instead, as 16-bit depth is: millimetres, mostly. Nothing for other depth.
/// @param name  of the depth images, for the note
void judge_float_depth(Sequence& sequence, const std::string& name);

/// Reads a ground truth by `read`; a sequence can do without it, so what is no pose is left out, a file that
/// cannot be read is none, and either is said in `notes`. @param file  that `read` reads
void read_optional_truth(Sequence& sequence, const std::filesystem::path& file,
                         const std::function<UsablePoses()>& read);

/// Turns Bonn's ground truth, which is of the body with the markers, to the camera. @return the line that
/// says so
[[nodiscard]] std::string turn_bonn_truth(std::vector<StampedPose<double>>& truth);

/// A rigid motion from a matrix [R t; 0 0 0 1]; nullopt where it is none (R is orthonormal within 0.02).
[[nodiscard]] std::optional<SE3<double>> rigid_motion(const Eigen::Matrix4d& matrix);

/// A 4x4 matrix of four lines; nullopt where it holds inf or nan: the pose is not known.
/// @throws InputError (line) for anything else that is no matrix
[[nodiscard]] std::optional<Eigen::Matrix4d> parse_matrix(std::istream& in, const std::string& name);
/// One 4x4 matrix of 16 numbers per line, camera to world; times are row / rate. Rows that are no motion are
/// left out. @throws InputError where reading fails
[[nodiscard]] UsablePoses parse_pose_rows(std::istream& in, const std::string& name, double rate);
/// Poses of a .log file: three whole numbers, of which the first is the frame's index from 0, and a matrix;
/// times are those of the indices, and matrices that are no motion are left out.
/// @throws InputError (line) for what has another form, and an index without a time
[[nodiscard]] UsablePoses parse_log(std::istream& in, const std::string& name, std::span<const double> times);
/// The pose in each file PREFIX NUMBER SUFFIX at NUMBER / rate. Files that hold none are left out; those that
/// say so with inf or nan are not even counted.
[[nodiscard]] UsablePoses read_pose_files(const std::filesystem::path& folder, std::string_view prefix,
                                          std::string_view suffix, double rate);

/// Plain pinhole numbers, checked as a camera file's are.
struct PinholeNumbers {
  double width = 0, height = 0, fx = 0, fy = 0, cx = 0, cy = 0, units = 0;
};
/// @throws InputError naming the file
[[nodiscard]] CameraConfig pinhole_camera(const std::string& name, const PinholeNumbers& numbers,
                                          const std::string& file);
/// NICE-SLAM's cam_params.json: {"camera": {"w", "h", "fx", "fy", "cx", "cy", "scale"}}. @throws InputError
[[nodiscard]] CameraConfig parse_replica_camera(const std::string& text, const std::string& file);
/// Open3D's {"width", "height", "intrinsic_matrix": 9 numbers by columns}; 1000 depth units per metre.
/// @throws InputError
[[nodiscard]] CameraConfig parse_open3d_camera(const std::string& text, const std::string& file);
/// ETH3D's "fx fy cx cy"; the size is that of the images. @throws InputError (line)
[[nodiscard]] CameraConfig parse_eth3d_camera(std::istream& in, cv::Size size, const std::string& file);

/// Whether a file holds ETH3D's four numbers: a camera only with the size of a sequence's images. False for
/// what is no file.
[[nodiscard]] bool is_eth3d_camera(const std::string& name_or_file);

/// Size of the first image of these that can be read. @throws InputError of the last one where none can
[[nodiscard]] cv::Size first_size(const std::vector<FrameRecord>& frames, bool depth);

}  // namespace dynslam::runtime::formats
