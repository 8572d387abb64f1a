// SPDX-License-Identifier: BSD-3-Clause
// Sequences whose files are numbered: 7-Scenes, Replica, ScanNet, Redwood and Open3D.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "io/formats/format.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, 1> kSceneColour{".color.png"}, kSceneDepth{".depth.png"};
constexpr std::array<std::string_view, 1> kPng{".png"};

bool holds(const fs::path& folder, std::string_view prefix, std::span<const std::string_view> suffixes) {
  return !numbered_files(folder, prefix, suffixes).empty();
}

bool is_seven_scenes(const fs::path& root) {
  return holds(root, "frame-", kSceneColour) && holds(root, "frame-", kSceneDepth);
}

Sequence load_seven_scenes(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  pair_by_number(sequence, numbered_files(root, "frame-", kSceneColour),
                 numbered_files(root, "frame-", kSceneDepth), options);
  read_optional_truth(sequence, root / "frame-*.pose.txt",
                      [&] { return read_pose_files(root, "frame-", ".pose.txt", options.rate); });
  sequence.camera = pinhole_camera("7-scenes", {640, 480, 585, 585, 320, 240, 1000}, "7-scenes");
  sequence.camera->invalid_depth = 65535;
  sequence.camera_source = "the data set's description";
  return sequence;
}

bool is_replica(const fs::path& root) {
  return fs::exists(root / "traj.txt") && holds(root / "results", "frame", kImageSuffixes);
}

Sequence load_replica(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  pair_by_number(sequence, numbered_files(root / "results", "frame", kImageSuffixes),
                 numbered_files(root / "results", "depth", kPng), options);
  const fs::path truth = root / "traj.txt";
  read_optional_truth(sequence, truth, [&] {  // row k is frame k
    std::istringstream in(read_text(truth));
    return parse_pose_rows(in, truth.string(), options.rate);
  });
  for (const fs::path& folder : {root, fs::absolute(root).lexically_normal() / ".."}) {
    const fs::path file = (folder / "cam_params.json").lexically_normal();
    if (!fs::exists(file)) continue;
    sequence.camera = parse_replica_camera(read_text(file), file.string());
    sequence.camera_source = file.string();
    break;
  }
  return sequence;
}

bool is_scannet(const fs::path& root) {
  return fs::is_directory(root / "intrinsic") && holds(root / "color", "", kImageSuffixes) &&
         holds(root / "depth", "", kDepthSuffixes);
}

Eigen::Matrix4d read_intrinsics(const fs::path& file) {
  std::istringstream in(read_text(file));
  const auto K = parse_matrix(in, file.string());
  if (!K) throw InputError(file.string(), 0, "holds a number that is not finite");
  return *K;
}

/// The colour image is the larger one; it is scaled to the depth image, which is what ScanNet's own tools do.
/// That is right only where the two cameras see the same, so their calibrations must agree.
void scale_colour(Sequence& sequence, const fs::path& file) {
  const cv::Size colour = first_size(sequence.frames, false);
  const CameraConfig& camera = *sequence.camera;
  if (colour == cv::Size(camera.width, camera.height)) return;
  if (!fs::exists(file))
    throw InputError(file.string(), 0,
                     fmt::format("is missing: it says how the colour images of {}x{} fit depth of {}x{}",
                                 colour.width, colour.height, camera.width, camera.height));
  const Eigen::Matrix4d K = read_intrinsics(file);
  const double sx = double(camera.width) / colour.width, sy = double(camera.height) / colour.height;
  const auto& depth = camera.model.pinhole();
  constexpr double kAgreement = 0.02;  // of the image's width: 13 px of 640
  const double worst = std::max({std::abs(K(0, 0) * sx - depth.fx()), std::abs(K(1, 1) * sy - depth.fy()),
                                 std::abs((K(0, 2) + 0.5) * sx - 0.5 - depth.cx()),
                                 std::abs((K(1, 2) + 0.5) * sy - 0.5 - depth.cy())});
  if (!(worst <= kAgreement * camera.width))
    throw InputError(
        file.string(), 0,
        fmt::format("scaled to the depth image, it differs by {:.0f} px from the depth camera's: colour and "
                    "depth do not show the same, so depth must be registered to colour first",
                    worst));
  for (FrameRecord& frame : sequence.frames) frame.colour_size = colour;
}

Sequence load_scannet(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  pair_by_number(sequence, numbered_files(root / "color", "", kImageSuffixes),
                 numbered_files(root / "depth", "", kDepthSuffixes), options);
  read_optional_truth(sequence, root / "pose",
                      [&] { return read_pose_files(root / "pose", "", ".txt", options.rate); });
  const fs::path file = root / "intrinsic" / "intrinsic_depth.txt";
  const Eigen::Matrix4d K = read_intrinsics(file);
  const cv::Size size = first_size(sequence.frames, true);
  sequence.camera = pinhole_camera(
      "scannet", {double(size.width), double(size.height), K(0, 0), K(1, 1), K(0, 2), K(1, 2), 1000},
      file.string());
  sequence.camera_source = file.string();
  scale_colour(sequence, root / "intrinsic" / "intrinsic_color.txt");
  return sequence;
}

/// TUM's list beside numbered images: its times are seconds, or numbers of frames where the images have no
/// times.
UsablePoses truth_of_numbers(const fs::path& file, bool has_stamps, double rate) {
  UsablePoses truth = read_usable_poses(file);
  const bool numbers =
      !has_stamps && std::all_of(truth.poses.begin(), truth.poses.end(),
                                 [](const auto& pose) { return pose.t == std::floor(pose.t); });
  for (auto& pose : truth.poses) pose.t = numbers ? pose.t / rate : pose.t;
  return truth;
}

/// Folder of the colour images of a Redwood or Open3D sequence; empty where there is none.
fs::path redwood_colour(const fs::path& root) {
  for (const char* name : {"color", "image", "rgb"}) {
    if (!numbered_images(root / name, kImageSuffixes).files.empty()) return root / name;
  }
  return {};
}

/// The images of a folder of a Redwood sequence; others are left out and said.
std::vector<NumberedFile> redwood_images(Sequence& sequence, const fs::path& folder,
                                         std::span<const std::string_view> suffixes) {
  NumberedImages images = numbered_images(folder, suffixes);
  if (images.others > 0)
    sequence.notes.push_back(
        fmt::format("{} of {} images in {} are left out, the first {}: the others have "
                    "names like {}",
                    images.others, images.others + images.files.size(), folder.string(), images.first_other,
                    images.files.front().path.filename().string()));
  return std::move(images.files);
}

bool is_redwood(const fs::path& root) {
  for (const char* other : {"intrinsic", "rgb.txt", "depth.txt", "associations.txt", "associated.txt"}) {
    if (fs::exists(root / other)) return false;
  }
  return !redwood_colour(root).empty() && !numbered_images(root / "depth", kDepthSuffixes).files.empty();
}

/// Names like 0000001-000000033333.png hold the time in microseconds; colour and depth count on their own.
void pair_by_microseconds(Sequence& sequence, const std::vector<NumberedFile>& colour,
                          const std::vector<NumberedFile>& depth, const SequenceOptions& options) {
  const double max_difference = options.max_association_difference;
  const auto times = [](const std::vector<NumberedFile>& files) {
    std::vector<double> t;
    for (const NumberedFile& file : files) {
      t.push_back(1e-6 * static_cast<double>(file.microseconds.value_or(0)));
      if (t.size() > 1 && t[t.size() - 2] >= t.back())
        throw InputError(file.path.string(), 0, "the time in its name is not above that of the image before");
    }
    return t;
  };
  sequence.colour_times = times(colour);
  sequence.depth_times = times(depth);
  shift_depth_times(sequence, depth_time_offset(sequence, options));
  for (const auto& [i, j] : associate(sequence.colour_times, sequence.depth_times, max_difference)) {
    sequence.frames.push_back({sequence.colour_times[i],
                               sequence.depth_times[j],
                               colour[i].stem,
                               colour[i].path,
                               depth[j].path,
                               {}});
  }
  if (sequence.frames.empty())
    throw InputError(sequence.root.string(), 0,
                     fmt::format("no colour image has a depth image within {} s by the times in their names, "
                                 "such as {} and {}",
                                 max_difference, colour.front().path.filename().string(),
                                 depth.front().path.filename().string()));
}

/// trajectory.log, or the only file *.log; empty where there is none.
fs::path redwood_truth(const fs::path& root) {
  if (fs::exists(root / "trajectory.log")) return root / "trajectory.log";
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(root)) {
    if (entry.path().extension() == ".log") files.push_back(entry.path());
  }
  return files.size() == 1 ? files.front() : fs::path();
}

Sequence load_redwood(const fs::path& root, const SequenceOptions& options) {
  Sequence sequence;
  sequence.root = root;
  if (redwood_colour(root).empty() || numbered_images(root / "depth", kDepthSuffixes).files.empty())
    throw InputError(
        root.string(), 0,
        "has no images of this format: color/, image/ or rgb/ with PNG or JPEG files and depth/ with "
        "PNG, TIFF, OpenEXR or .npy files whose names differ by a number, such as 0001.png or frame-1.png");
  const auto colour = redwood_images(sequence, redwood_colour(root), kImageSuffixes);
  const auto depth = redwood_images(sequence, root / "depth", kDepthSuffixes);
  const auto stamped = [](const NumberedFile& file) { return file.microseconds.has_value(); };
  if (std::all_of(colour.begin(), colour.end(), stamped) &&
      std::all_of(depth.begin(), depth.end(), stamped)) {
    pair_by_microseconds(sequence, colour, depth, options);
  } else {
    pair_by_number(sequence, colour, depth, options);
  }
  for (const char* name : {"camera_intrinsic.json", "intrinsic.json"}) {
    const fs::path file = root / name;
    if (!fs::exists(file)) continue;
    sequence.camera = parse_open3d_camera(read_text(file), file.string());
    sequence.camera_source = file.string();
    break;
  }
  if (const fs::path truth = redwood_truth(root); !truth.empty()) {
    read_optional_truth(sequence, truth, [&] {
      std::istringstream in(read_text(truth));
      return parse_log(in, truth.string(), sequence.colour_times);
    });
  } else if (const fs::path list = root / "groundtruth.txt"; fs::exists(list)) {
    read_optional_truth(sequence, list,
                        [&] { return truth_of_numbers(list, sequence.has_stamps, options.rate); });
  }
  return sequence;
}

}  // namespace

const Format kSevenScenes{"7-scenes", "frame-NNNNNN.color.png, frame-NNNNNN.depth.png", is_seven_scenes,
                          load_seven_scenes};
const Format kReplica{"replica", "results/frameNNNNNN.jpg, results/depthNNNNNN.png, traj.txt", is_replica,
                      load_replica};
const Format kScanNet{"scannet", "color/N.jpg, depth/N.png, pose/N.txt, intrinsic/", is_scannet,
                      load_scannet};
const Format kRedwood{"redwood", "color/, image/ or rgb/ and depth/ with numbered images", is_redwood,
                      load_redwood};

}  // namespace dynslam::runtime::formats
