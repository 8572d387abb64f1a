// SPDX-License-Identifier: BSD-3-Clause
//
// Example 6: MotionSegmenter inside a system that is not ours, OpenCV's RGB-D odometry from frame to frame.
//
//   example_06_rgbd_odometry SEQUENCE [LIMIT]
//   example_06_rgbd_odometry SEQUENCE [--rim PIXELS] --masks FOLDER...
//
// runs a TUM RGB-D folder three times, as OpenCV does it and with what moves masked out, and prints the absolute
// trajectory errors; or with the masks of folders (STAMP.png, 0 where nothing moves, as of `run
// --save-masks`), kept PIXELS (3) off their rim. What moves spoils the odometry's pose. Either the segmenter finds
// one from its reference keypoints (locate); or it is given the odometry's own, without masks, and tells by itself
// what of it to believe. Both ways the odometry starts from the segmenter's pose. Fails where the error of either is above
// LIMIT [m]; "third" stands for a third of the error without masks.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/rgbd.hpp>

#include <dynslam/dynamics/motion_segmenter.hpp>
#include <dynslam/eval/trajectory.hpp>
#include <dynslam/geometry/pinhole.hpp>

namespace {

using dynslam::SE3d;
using Trajectory = std::vector<dynslam::StampedPose<double>>;

struct Frame {
  double t = 0;
  std::string stamp;
  cv::Mat gray, depth;  // 8 bit; metres, NaN where there is none
};

/// Lines of numbers and words that do not begin with '#'.
std::vector<std::vector<std::string>> read_lines(const std::string& path) {
  std::vector<std::vector<std::string>> lines;
  std::ifstream in(path);
  for (std::string line, word; std::getline(in, line);) {
    if (line.empty() || line.front() == '#') continue;
    std::istringstream words(line);
    lines.emplace_back();
    while (words >> word) lines.back().push_back(word);
  }
  return lines;
}

double number(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0') throw std::runtime_error("`" + text + "' is not a number");
  return value;
}

/// fx, fy, cx, cy and depth units: of camera.txt ("key = value"), or of the TUM camera fr1 or fr3, by the
/// folder's name.
std::map<std::string, double> read_camera(const std::string& folder) {
  std::map<std::string, double> camera{
      {"fx", 535.4}, {"fy", 539.2}, {"cx", 320.1}, {"cy", 247.6}, {"depth_units_per_metre", 5000.0}};
  if (folder.find("freiburg1") != std::string::npos || folder.find("fr1") != std::string::npos)
    camera = {{"fx", 517.3}, {"fy", 516.5}, {"cx", 318.6}, {"cy", 255.3}, {"depth_units_per_metre", 5000.0}};
  for (const auto& line : read_lines(folder + "/camera.txt")) {
    if (line.size() == 3 && camera.count(line[0]) > 0) camera[line[0]] = number(line[2]);
  }
  return camera;
}

std::vector<Frame> read_frames(const std::string& folder, double units) {
  const auto colours = read_lines(folder + "/rgb.txt"), depths = read_lines(folder + "/depth.txt");
  const auto stamps = [](const auto& list) {
    std::vector<double> t;
    for (const auto& line : list) t.push_back(number(line.front()));
    return t;
  };
  const auto t_colour = stamps(colours), t_depth = stamps(depths);
  std::vector<Frame> frames;
  for (const auto& [i, k] : dynslam::associate(t_colour, t_depth, 0.02)) {
    Frame f;
    f.t = t_colour[i];
    f.stamp = colours[i][0];
    f.gray = cv::imread(folder + "/" + colours[i][1], cv::IMREAD_GRAYSCALE);
    cv::imread(folder + "/" + depths[k][1], cv::IMREAD_UNCHANGED).convertTo(f.depth, CV_32F, 1.0 / units);
    f.depth.setTo(std::numeric_limits<double>::quiet_NaN(), f.depth <= 0);
    frames.push_back(std::move(f));
  }
  return frames;
}

Trajectory read_groundtruth(const std::string& folder) {
  Trajectory trajectory;
  for (const auto& w : read_lines(folder + "/groundtruth.txt")) {
    if (w.size() < 8) continue;
    const auto n = [&](std::size_t i) { return number(w[i]); };
    const Eigen::Quaterniond q(n(7), n(4), n(5), n(6));
    trajectory.push_back({n(0), SE3d(dynslam::SO3d(q), Eigen::Vector3d(n(1), n(2), n(3)))});
  }
  return trajectory;
}

/// Motion from one frame to the next: T_next_last. Points on the masks (empty: all) are used.
std::optional<SE3d> motion(cv::rgbd::Odometry& odometry, const Frame& last, const cv::Mat& last_mask,
                           const Frame& next, const cv::Mat& next_mask, const SE3d& guess) {
  cv::Mat Rt, guess_Rt(4, 4, CV_64F);
  const Eigen::Matrix4d T = guess.matrix();
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) guess_Rt.at<double>(r, c) = T(r, c);
  }
  if (!odometry.compute(last.gray, last.depth, last_mask, next.gray, next.depth, next_mask, Rt, guess_Rt))
    return std::nullopt;
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R(r, c) = Rt.at<double>(r, c);
    t[r] = Rt.at<double>(r, 3);
  }
  return SE3d(dynslam::SO3d(Eigen::Quaterniond(R)), t);
}

enum class Masks { none, located, own_pose, folder };

class MaskedOdometry {
 public:
  MaskedOdometry(const std::map<std::string, double>& camera, Masks masks, std::string folder, int rim)
      : masks_(masks),
        folder_(std::move(folder)),
        rim_(rim),
        segmenter_(
            dynslam::Pinhole<double>(camera.at("fx"), camera.at("fy"), camera.at("cx"), camera.at("cy"))) {
    const cv::Mat K = (cv::Mat_<double>(3, 3) << camera.at("fx"), 0, camera.at("cx"), 0, camera.at("fy"),
                       camera.at("cy"), 0, 0, 1);
    odometry_ = cv::rgbd::RgbdOdometry::create(K);
  }

  SE3d track(const Frame& frame) {
    cv::Mat still;  // what the odometry may use
    SE3d guess;
    if (masks_ == Masks::folder) {
      const cv::Mat mask = cv::imread(folder_ + "/" + frame.stamp + ".png", cv::IMREAD_GRAYSCALE);
      if (mask.empty()) throw std::runtime_error(folder_ + "/" + frame.stamp + ".png: no mask");
      still = off_the_rim(mask == 0);
    }
    if (masks_ == Masks::located) {
      const SE3d T_located = segmenter_.locate(gray(frame), depth(frame), velocity_ * T_located_).T_c_w;
      still = segment(frame, T_located);
      segmenter_.remember(T_located, segmenter_.motion().mask);
      guess = T_located * T_located_.inverse();
      T_located_ = T_located;
      velocity_ = guess;
    }
    if (masks_ == Masks::own_pose) {
      still = segment(frame, step(frame, cv::Mat(), velocity_) * T_c_w_);
      // The odometry minimises from a start: from its own it stays with what moves.
      guess = segmenter_.motion().T_c_w * T_located_.inverse();
    }
    if (!last_.gray.empty()) {
      velocity_ = step(frame, still, guess);
      T_c_w_ = velocity_ * T_c_w_;
    }
    if (masks_ == Masks::own_pose) {
      segmenter_.remember(T_c_w_, segmenter_.motion().mask);
      T_located_ = segmenter_.motion().own_pose ? segmenter_.motion().T_c_w : T_c_w_;
    }
    last_ = frame;
    last_still_ = still;
    return T_c_w_;
  }

 private:
  static dynslam::ImageView<const unsigned char> gray(const Frame& f) { return {f.gray.ptr(), f.gray.cols, f.gray.rows}; }
  static dynslam::ImageView<const float> depth(const Frame& f) {
    return {f.depth.ptr<float>(), f.depth.cols, f.depth.rows};
  }

  /// The odometry's motion since the last frame.
  [[nodiscard]] SE3d step(const Frame& frame, const cv::Mat& still, const SE3d& guess) {
    if (last_.gray.empty()) return {};
    return motion(*odometry_, last_, last_still_, frame, still, guess).value_or(guess);
  }

  /// The pixels that do not move.
  [[nodiscard]] cv::Mat segment(const Frame& frame, const SE3d& T_c_w) {
    const auto& moving = segmenter_.segment(gray(frame), depth(frame), frame.t, T_c_w);
    cv::Mat still(frame.gray.size(), CV_8UC1);
    for (int v = 0; v < still.rows; ++v) {
      for (int u = 0; u < still.cols; ++u) still.at<unsigned char>(v, u) = moving.mask(u, v) != 0 ? 0 : 255;
    }
    return off_the_rim(still);
  }

  [[nodiscard]] cv::Mat off_the_rim(const cv::Mat& still) const {  // of the moving objects
    cv::Mat inner;
    cv::erode(still, inner, cv::getStructuringElement(cv::MORPH_RECT, {2 * rim_ + 1, 2 * rim_ + 1}));
    return inner;
  }

  Masks masks_;
  std::string folder_;
  int rim_;  // [px]
  dynslam::MotionSegmenter<double, dynslam::Pinhole<double>> segmenter_;
  cv::Ptr<cv::rgbd::RgbdOdometry> odometry_;
  Frame last_;
  cv::Mat last_still_;
  SE3d T_c_w_;      // of the odometry
  SE3d T_located_;  // of the segmenter
  SE3d velocity_;   // since the last frame
};

double trajectory_error(const std::vector<Frame>& frames, const std::map<std::string, double>& camera,
                        const Trajectory& groundtruth, Masks masks, const std::string& folder = {},
                        int rim = 3) {
  MaskedOdometry odometry(camera, masks, folder, rim);
  Trajectory trajectory;
  for (const Frame& frame : frames) trajectory.push_back({frame.t, odometry.track(frame).inverse()});
  const auto ate = dynslam::absolute_trajectory_error<double>(trajectory, groundtruth);
  return ate ? ate->translation.rmse : std::numeric_limits<double>::infinity();
}

}  // namespace

int main(int argc, char** argv) try {
  const bool has_rim = argc > 3 && std::string(argv[2]) == "--rim";
  const int rim = has_rim ? static_cast<int>(number(argv[3])) : 3;
  const int option = has_rim ? 4 : 2;
  const bool has_masks = argc > option + 1 && std::string(argv[option]) == "--masks";
  if (argc < 2 || rim < 0 || (has_rim && !has_masks)) {
    std::puts("usage: example_06_rgbd_odometry SEQUENCE [LIMIT | [--rim PIXELS] --masks FOLDER...]");
    return 2;
  }
  const std::string folder = argv[1];
  const auto camera = read_camera(folder);
  const auto frames = read_frames(folder, camera.at("depth_units_per_metre"));
  const auto groundtruth = read_groundtruth(folder);
  const double alone = trajectory_error(frames, camera, groundtruth, Masks::none);
  if (has_masks) {
    std::printf("%zu frames: absolute trajectory error %.2f cm alone", frames.size(), 100 * alone);
    for (int i = option + 1; i < argc; ++i)
      std::printf(", %.2f cm with %s",
                  100 * trajectory_error(frames, camera, groundtruth, Masks::folder, argv[i], rim), argv[i]);
    std::puts("");
    return 0;
  }
  const double located = trajectory_error(frames, camera, groundtruth, Masks::located);
  const double own_pose = trajectory_error(frames, camera, groundtruth, Masks::own_pose);
  std::printf("%zu frames: absolute trajectory error %.2f cm alone, with MotionSegmenter %.2f cm by its own pose, "
              "%.2f cm by the odometry's\n",
              frames.size(), 100 * alone, 100 * located, 100 * own_pose);
  const double worse = std::max(located, own_pose);
  if (argc < 3) return std::isfinite(worse) ? 0 : 1;
  return worse <= (std::string(argv[2]) == "third" ? alone / 3 : number(argv[2])) ? 0 : 1;
} catch (const std::exception& error) {
  std::fprintf(stderr, "example_06_rgbd_odometry: %s\n", error.what());
  return 1;
}
