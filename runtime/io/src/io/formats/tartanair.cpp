// SPDX-License-Identifier: BSD-3-Clause
// TartanAir (Wang et al. 2020) and its version 2: rendered images, depth in metres, poses in north-east-down
// axes.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <sstream>
#include <string_view>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/formats/format.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

/// A version of the data set: the files of its front camera, and that camera.
struct TartanVersion {
  std::string_view images, depths, poses;
  std::array<std::string_view, 1> image_suffix, depth_suffix;
  bool float_bytes;  ///< of depth images
  PinholeNumbers camera;
};
const std::array<TartanVersion, 2> kTartanVersions{{
    {"image_left",
     "depth_left",
     "pose_left.txt",
     {"_left.png"},
     {"_left_depth.npy"},
     false,
     {640, 480, 320, 320, 320, 240, 1000}},
    {"image_lcam_front",
     "depth_lcam_front",
     "pose_lcam_front.txt",
     {"_lcam_front.png"},
     {"_lcam_front_depth.png"},
     true,
     {640, 640, 320, 320, 320, 320, 1000}},
}};

bool has_images(const fs::path& root, const TartanVersion& version) {
  return fs::is_directory(root / version.images) && fs::is_directory(root / version.depths);
}

bool is_tartanair(const fs::path& root) {
  return std::any_of(kTartanVersions.begin(), kTartanVersions.end(), [&](const TartanVersion& version) {
    return has_images(root, version) && fs::exists(root / version.poses);
  });
}

/// Row k is frame k: tx ty tz qx qy qz qw of a body that looks along x, with y to its right and z down.
UsablePoses parse_body_rows(const std::string& text, const std::string& name, double rate) {
  std::istringstream rows(text);
  std::string stamped, line;
  for (std::size_t row = 0; std::getline(rows, line); line.clear()) {
    const bool blank = split_words(line).empty();
    stamped += blank ? "\n" : fmt::format("{:.9f} {}\n", static_cast<double>(row) / rate, line);
    row += blank ? 0 : 1;
  }
  std::istringstream in(stamped);
  UsablePoses truth = parse_usable_poses(in, name);
  Eigen::Matrix3d R_body_c;  // columns: the camera's right, down and forward
  R_body_c << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const SE3<double> T_body_c(Eigen::Quaterniond(R_body_c), Eigen::Vector3d::Zero());
  for (auto& pose : truth.poses) pose.T_w_c = pose.T_w_c * T_body_c;
  return truth;
}

Sequence load_tartanair(const fs::path& root, const SequenceOptions& options) {
  const auto found = std::find_if(kTartanVersions.begin(), kTartanVersions.end(),
                                  [&](const TartanVersion& version) { return has_images(root, version); });
  if (found == kTartanVersions.end())
    throw InputError(root.string(), 0,
                     "has no images of this format: image_left/ and depth_left/, or image_lcam_front/ and "
                     "depth_lcam_front/");
  Sequence sequence;
  sequence.root = root;
  pair_by_number(sequence, numbered_files(root / found->images, "", found->image_suffix),
                 numbered_files(root / found->depths, "", found->depth_suffix), options);
  sequence.float_depth = true;
  for (FrameRecord& frame : sequence.frames) frame.float_bytes = found->float_bytes;
  const fs::path truth = root / found->poses;
  read_optional_truth(sequence, truth,
                      [&] { return parse_body_rows(read_text(truth), truth.string(), options.rate); });
  sequence.camera = pinhole_camera("tartanair", found->camera, "tartanair");
  sequence.camera_source = "the data set's description";
  return sequence;
}

}  // namespace

const Format kTartanAir{
    "tartanair",
    "image_left/N_left.png, depth_left/N_left_depth.npy, pose_left.txt; of version 2: "
    "image_lcam_front/N_lcam_front.png, depth_lcam_front/N_lcam_front_depth.png, pose_lcam_front.txt",
    is_tartanair, load_tartanair};

}  // namespace dynslam::runtime::formats
