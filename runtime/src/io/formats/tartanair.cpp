// SPDX-License-Identifier: BSD-3-Clause
// TartanAir (Wang et al. 2020): rendered images, depth as arrays of metres, poses in north-east-down axes.
#include <fmt/format.h>

#include <sstream>
#include <string_view>

#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/formats/format.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 1> kTartanColour{"_left.png"}, kTartanDepth{"_left_depth.npy"};

bool is_tartanair(const fs::path& root) {
  return fs::exists(root / "pose_left.txt") && fs::is_directory(root / "image_left") &&
         fs::is_directory(root / "depth_left");
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
  Sequence sequence;
  sequence.root = root;
  pair_by_number(sequence, numbered_files(root / "image_left", "", kTartanColour),
                 numbered_files(root / "depth_left", "", kTartanDepth), options);
  sequence.float_depth = true;
  const fs::path truth = root / "pose_left.txt";
  read_optional_truth(sequence, truth,
                      [&] { return parse_body_rows(read_text(truth), truth.string(), options.rate); });
  sequence.camera = pinhole_camera("tartanair", {640, 480, 320, 320, 320, 240, 1000}, "tartanair");
  sequence.camera_source = "the data set's description";
  return sequence;
}

}  // namespace

const Format kTartanAir{"tartanair", "image_left/N_left.png, depth_left/N_left_depth.npy, pose_left.txt",
                        is_tartanair, load_tartanair};

}  // namespace dynslam::runtime::formats
