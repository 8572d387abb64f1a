// SPDX-License-Identifier: BSD-3-Clause
// Sequences with lists: TUM RGB-D, Bonn RGB-D Dynamic, ETH3D SLAM, ICL-NUIM.
#include <fmt/format.h>

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <sstream>
#include <system_error>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "io/formats/format.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

std::vector<ListEntry> read_list(const fs::path& path, std::vector<std::string>& notes) {
  std::istringstream in(read_text(path));
  auto list = parse_unsorted_list(in, path.string(), notes);
  if (list.empty()) throw InputError(path.string(), 0, "lists no images");
  return list;
}

bool has_lists(const fs::path& root) {
  return fs::exists(root / "rgb.txt") || fs::exists(root / "depth.txt") ||
         fs::exists(root / "associations.txt");
}

void read_truth(Sequence& sequence) {
  const fs::path path = sequence.root / "groundtruth.txt";
  // A link that leads nowhere is there, and cannot be read.
  std::error_code unreadable;
  if (fs::symlink_status(path, unreadable).type() == fs::file_type::not_found) return;
  read_optional_truth(sequence, path, [&] { return read_usable_poses(path); });
}

bool is_eth3d(const fs::path& root) {
  return fs::exists(root / "calibration.txt") && (has_lists(root) || fs::exists(root / "associated.txt"));
}

Sequence load_eth3d(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  read_lists(sequence, "associated.txt", options);
  read_truth(sequence);
  const fs::path file = root / "calibration.txt";
  std::istringstream in(read_text(file));
  sequence.camera = parse_eth3d_camera(in, first_size(sequence.frames, false), file.string());
  sequence.camera_source = file.string();
  return sequence;
}

/// The ground truth that ICL-NUIM puts beside its images: *.gt.freiburg; empty where there is none.
std::vector<fs::path> icl_truths(const fs::path& root) {
  std::vector<fs::path> files;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root, error)) {
    if (entry.path().filename().string().ends_with(".gt.freiburg")) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// Whether the list begins as ICL-NUIM's does: "0 depth/0.png 0 rgb/0.png", frames by number, depth first.
bool is_icl_list(const fs::path& path) {
  if (!fs::is_regular_file(path)) return false;
  std::istringstream in(read_text(path));
  LineReader reader(in);
  if (!reader.next()) return false;
  const auto words = split_words(reader.line());
  const auto whole = [](std::string_view word) { return word.find_first_not_of("0123456789") == word.npos; };
  return words.size() == 4 && whole(words[0]) && words[0] == words[2] &&
         fs::path(words[1]).parent_path().filename() == "depth" && fs::path(words[1]).stem() == words[0];
}

bool is_icl(const fs::path& root) {
  const fs::path list = root / "associations.txt";
  return !is_eth3d(root) && fs::exists(list) && (!icl_truths(root).empty() || is_icl_list(list));
}

/// ICL-NUIM's camera and world have the y axis up (which is why its fy is -480), the images are stored with
/// their rows downwards as everybody's. With y turned in the camera and in the world the camera is a usual
/// one (fy = 480), and a true pose T becomes M T M, M = diag(1, -1, 1): no mirror image of the room, but
/// the same room in right-handed coordinates.
SE3<double> with_y_down(const SE3<double>& T) {
  const Eigen::Quaterniond& q = T.so3().quaternion();
  const Eigen::Vector3d& t = T.translation();
  return {Eigen::Quaterniond(q.w(), -q.x(), q.y(), -q.z()), Eigen::Vector3d(t.x(), -t.y(), t.z())};
}

Sequence load_icl(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  sequence.has_stamps = false;
  read_lists(sequence, "associations.txt", options);
  const fs::path list = root / "associations.txt";
  for (FrameRecord& frame : sequence.frames) {
    if (frame.t_rgb != std::floor(frame.t_rgb) || frame.t_depth != std::floor(frame.t_depth))
      throw InputError(list.string(), 0,
                       fmt::format("'{}' is not the number of a frame, as ICL-NUIM's are", frame.stamp));
    frame.t_rgb /= options.rate;
    frame.ns = 0;
    frame.t_depth /= options.rate;
  }
  for (auto* times : {&sequence.colour_times, &sequence.depth_times}) {
    for (double& t : *times) t /= options.rate;
  }
  shift_depth_times(sequence, depth_time_offset(sequence, options));
  const auto truths = icl_truths(root);
  if (!truths.empty()) {
    read_optional_truth(sequence, truths.front(), [&] {
      if (truths.size() > 1)
        throw InputError(root.string(), 0,
                         fmt::format("has two ground truths, {} and {}", truths[0].filename().string(),
                                     truths[1].filename().string()));
      UsablePoses truth = read_usable_poses(truths.front());  // numbers of frames for times
      for (auto& pose : truth.poses) pose = {pose.t / options.rate, with_y_down(pose.T_w_c)};
      return truth;
    });
  }
  sequence.camera = pinhole_camera("icl-nuim", {640, 480, 481.2, 480, 319.5, 239.5, 5000}, "icl-nuim");
  sequence.camera_source = "the data set's description (its fy of -480 means that y points up in the truth)";
  return sequence;
}

Sequence load_tum(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  sequence.folder_camera = camera_by_name(folder_name(root));
  sequence.camera_hint = sequence.folder_camera;
  read_lists(sequence, "associations.txt", options);
  read_truth(sequence);
  return sequence;
}

bool is_bonn(const fs::path& root) {
  return has_lists(root) && !is_eth3d(root) && !is_icl(root) && folder_name(root).starts_with("rgbd_bonn");
}

Sequence load_bonn(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence = load_tum(root, options);
  sequence.folder_camera = "bonn";
  sequence.camera_hint = "bonn";
  if (!sequence.groundtruth.empty()) sequence.truth_turned = turn_bonn_truth(sequence.groundtruth);
  return sequence;
}

bool is_tum(const fs::path& root) {
  return has_lists(root) && !is_eth3d(root) && !is_icl(root) && !is_bonn(root);
}

}  // namespace

std::string turn_bonn_truth(std::vector<StampedPose<double>>& truth) {
  // The data set's page: camera = T_ros T_markers T_ros T_m. T_ros on the left turns the world, which nobody
  // sees; T_m was solved for with a scale, so the nearest rotation counts. Positions stay those of the body,
  // with which results are published; it is 2 cm beside the camera.
  Eigen::Matrix3d T_ros, T_m;
  T_ros << -1, 0, 0, 0, 0, 1, 0, 1, 0;
  T_m << 1.0157, 0.1828, -0.2389, 0.0009, -0.8431, -0.6413, -0.3009, 0.6147, -0.8085;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(T_ros * T_m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  const SE3<double> turn(Eigen::Quaterniond(nearest).normalized(), Eigen::Vector3d::Zero());
  for (auto& pose : truth) pose.T_w_c = pose.T_w_c * turn;
  return "ground truth: of the body with the markers, turned to the camera by Bonn's published rotation";
}

std::string folder_name(const fs::path& root) {
  fs::path folder = fs::absolute(root).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  return folder.filename().string();
}

std::string camera_by_name(const std::string& name) {
  for (const char digit : {'1', '2', '3'}) {
    if (name.find(std::string("freiburg") + digit) != std::string::npos ||
        name.starts_with(std::string("fr") + digit)) {
      return std::string("fr") + digit;
    }
  }
  return {};
}

/// Images are paired by when they were taken.
double depth_time_offset(const Sequence& sequence, const SequenceOptions& options) {
  if (options.depth_time_offset != 0) return options.depth_time_offset;
  std::string camera = options.camera;
  if (camera.empty()) camera = camera_file_in(sequence.root).string();
  if (camera.empty()) camera = sequence.camera_hint;
  if (camera.empty() || is_eth3d_camera(camera)) return 0;
  return load_camera(camera).depth_time_offset;
}

void shift_depth_times(Sequence& sequence, double offset) {
  for (FrameRecord& frame : sequence.frames) frame.t_depth -= offset;
  for (double& t : sequence.depth_times) t -= offset;
}

void read_lists(Sequence& sequence, const std::string& associations, const SequenceOptions& options) {
  const fs::path& root = sequence.root;
  const double offset = sequence.has_stamps ? depth_time_offset(sequence, options) : 0;
  if (const fs::path path = root / associations; fs::exists(path)) {
    std::istringstream in(read_text(path));
    sequence.frames = parse_unsorted_associations(in, path.string(), sequence.notes);
    if (sequence.frames.empty()) throw InputError(path.string(), 0, "lists no images");
    for (FrameRecord& record : sequence.frames) {
      record.t_depth -= offset;
      sequence.colour_times.push_back(record.t_rgb);
      sequence.depth_times.push_back(record.t_depth);
    }
  } else {
    auto rgb = read_list(root / "rgb.txt", sequence.notes),
         depth = read_list(root / "depth.txt", sequence.notes);
    for (const auto& e : rgb) sequence.colour_times.push_back(e.t);
    for (const auto& e : depth) sequence.depth_times.push_back(e.t - offset);
    for (const auto& [i, j] :
         associate(sequence.colour_times, sequence.depth_times, options.max_association_difference)) {
      sequence.frames.push_back({rgb[i].t, sequence.depth_times[j], std::move(rgb[i].stamp),
                                 std::move(rgb[i].path), std::move(depth[j].path), rgb[i].ns});
    }
    if (sequence.frames.empty()) {
      throw InputError(
          root.string(), 0,
          fmt::format("no colour image has a depth image within {} s; rgb.txt is from {:.3f} to {:.3f} s, "
                      "depth.txt from {:.3f} to {:.3f} s",
                      options.max_association_difference, rgb.front().t, rgb.back().t, depth.front().t,
                      depth.back().t));
    }
  }
  for (FrameRecord& record : sequence.frames) {
    record.rgb = root / fs::path(record.rgb);
    record.depth = root / fs::path(record.depth);
  }
}

const Format kTum{"tum", "rgb.txt and depth.txt, or associations.txt", is_tum, load_tum};
const Format kBonn{"bonn", "TUM's files in a folder rgbd_bonn_*", is_bonn, load_bonn};
const Format kEth3d{"eth3d", "calibration.txt with rgb.txt, depth.txt or associated.txt", is_eth3d,
                    load_eth3d};
const Format kIclNuim{"icl-nuim", "associations.txt by frame number, *.gt.freiburg", is_icl, load_icl};

}  // namespace dynslam::runtime::formats
