// SPDX-License-Identifier: BSD-3-Clause
// One short rendered film, written in the layout of each format of sequences.
#pragma once

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "tum_fixture.hpp"

namespace dynslam::test {

struct Shot {
  cv::Mat bgr, depth;  ///< CV_8UC3; CV_16UC1, 5000 per metre, 0 = none
  SE3<double> T_w_c;
};

/// Frames per second of the film, which lasts 1.3 s: enough for an RPE over one second.
inline constexpr double kFilmRate = 10;

/// An office without people, the camera moved along three axes.
inline const std::vector<Shot>& film() {
  static const std::vector<Shot> shots = [] {
    const TemporaryFolder folder;
    runtime::SynthOptions options;
    options.frames = 14;
    options.fps = kFilmRate;
    options.path = "xyz";
    options.scenario = "empty";
    runtime::synthesize(options, folder.path);
    const runtime::Sequence sequence = runtime::load_sequence(folder.path);
    std::vector<Shot> made;
    for (std::size_t i = 0; i < sequence.frames.size(); ++i)
      made.push_back({runtime::read_image(sequence.frames[i].rgb, cv::IMREAD_COLOR),
                      runtime::read_image(sequence.frames[i].depth, cv::IMREAD_UNCHANGED),
                      sequence.groundtruth[i].T_w_c});
    return made;
  }();
  return shots;
}

/// A pinhole camera, and how it codes depth.
struct View {
  int width = 640, height = 480;
  double fx = 535.4, fy = 539.2, cx = 320.1, cy = 247.6;  // the film's own
  double units = 5000;
  int none = 0;
};

/// A shot as another camera in the same place sees it: pixels of one camera are a homography of the other's.
inline Shot seen_by(const Shot& shot, const View& view) {
  const View film_view;
  const cv::Matx33d to(view.fx, 0, view.cx, 0, view.fy, view.cy, 0, 0, 1);
  const cv::Matx33d from(film_view.fx, 0, film_view.cx, 0, film_view.fy, film_view.cy, 0, 0, 1);
  Shot seen{{}, {}, shot.T_w_c};
  const cv::Size size(view.width, view.height);
  cv::warpPerspective(shot.bgr, seen.bgr, to * from.inv(), size, cv::INTER_LINEAR);
  cv::Mat depth;
  cv::warpPerspective(shot.depth, depth, to * from.inv(), size, cv::INTER_NEAREST);
  depth.convertTo(seen.depth, CV_16UC1, view.units / film_view.units);
  if (view.none != 0) seen.depth.setTo(view.none, depth == 0);
  return seen;
}

/// Four rows of a 4x4 matrix, or all on one line.
inline std::string matrix_text(const Eigen::Matrix4d& m, const char* between_rows = "\n") {
  std::string text;
  for (Eigen::Index r = 0; r < 4; ++r)
    text += fmt::format("{:.9f} {:.9f} {:.9f} {:.9f}{}", m(r, 0), m(r, 1), m(r, 2), m(r, 3),
                        r < 3 ? between_rows : "\n");
  return text;
}

/// As numpy.save() writes it, version 1.0: float32 by rows.
inline void write_npy(const std::filesystem::path& file, const cv::Mat& values) {
  std::string head = fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}",
                                 values.rows, values.cols);
  constexpr std::size_t kStart = 10, kBlock = 64;
  head.append(kBlock - (kStart + head.size() + 1) % kBlock, ' ');
  head += '\n';
  std::ofstream out(file, std::ios::binary);
  out << std::string("\x93NUMPY\x01\x00", 8) << static_cast<char>(head.size() % 256)
      << static_cast<char>(head.size() / 256) << head;
  for (int v = 0; v < values.rows; ++v)
    out.write(reinterpret_cast<const char*>(values.ptr<float>(v)),
              static_cast<std::streamsize>(sizeof(float)) * values.cols);
}

/// The film's depth in metres, infinite where there is none.
inline cv::Mat depth_floats(const cv::Mat& depth) {
  cv::Mat metres;
  depth.convertTo(metres, CV_32FC1, 1.0 / View().units);
  metres.setTo(std::numeric_limits<double>::infinity(), depth == 0);
  return metres;
}

inline std::string pose_text(const std::string& stamp, const SE3<double>& T) {
  const auto& p = T.translation();
  const auto& q = T.so3().quaternion();
  return fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", stamp, p.x(), p.y(), p.z(),
                     q.x(), q.y(), q.z(), q.w());
}

/// The bytes of floats as the channels of an image, as TartanAir's tools have it: depth_rgba.view("<f4").
inline cv::Mat channels_of_floats(const cv::Mat& floats) {
  return cv::Mat(floats.rows, floats.cols, CV_8UC4, floats.data, floats.step).clone();
}

/// A folder in one of the formats.
struct FormatFixture : TemporaryFolder {
  std::string format;
  View view;
  std::filesystem::path root;  ///< of the sequence, within `path`

  /// Each format is written once for all tests of the program; what a test gets, and may change, is a copy.
  /// @param name  one of kFormatNames
  explicit FormatFixture(const std::string& name) : format(format_of(name)), root(path / folder_of(name)) {
    static std::map<std::string, std::unique_ptr<const FormatFixture>> written;
    std::unique_ptr<const FormatFixture>& original = written[name];
    if (!original) original.reset(new FormatFixture(name, Written{}));
    view = original->view;
    std::filesystem::copy(original->path, path, std::filesystem::copy_options::recursive);
  }

  [[nodiscard]] bool stamped() const {
    return format == "tum" || format == "bonn" || format == "eth3d" || format == "stray-scanner";
  }

  /// What a reader of the k-th frame gets.
  [[nodiscard]] Shot shot(std::size_t k) const {
    Shot seen = seen_by(film()[k], view);
    if (format == "stray-scanner") {
      cv::Mat small;
      cv::resize(seen.depth, small, kPhoneDepth, 0, 0, cv::INTER_NEAREST_EXACT);
      cv::resize(small, seen.depth, seen.depth.size(), 0, 0, cv::INTER_NEAREST_EXACT);
    }
    return seen;
  }

  static std::string stamp(std::size_t i) { return fmt::format("{:.6f}", 100 + double(i) / kFilmRate); }

 private:
  inline static const cv::Size kPhoneDepth{256, 192};
  struct Written {};
  FormatFixture(const std::string& name, Written) : format(format_of(name)), root(path / folder_of(name)) {
    std::filesystem::create_directories(root);
    if (name == "tum") tum({}, "groundtruth.txt", "associations.txt");
    if (name == "bonn") bonn();
    if (name == "eth3d") eth3d();
    if (name == "icl-nuim") icl();
    if (name == "7-scenes") seven_scenes();
    if (name == "replica") replica();
    if (name == "scannet") scannet();
    if (name == "redwood") redwood();
    if (name == "tartanair") tartanair("left", {640, 480, 320, 320, 320, 240, 5000, 0});
    if (name == "tartanair-2") tartanair("lcam_front", {640, 640, 320, 320, 320, 320, 5000, 0});
    if (name == "stray-scanner") stray_scanner();
  }

  static std::string format_of(const std::string& name) { return name == "tartanair-2" ? "tartanair" : name; }

  /// The names by which TUM's and Bonn's cameras are known.
  static std::string folder_of(const std::string& name) {
    if (name == "bonn") return "rgbd_bonn_office";
    return name == "tum" ? "rgbd_dataset_freiburg3_office" : "sequence";
  }

  template <class Name>
  void images(const char* colour, const char* depth, Name&& name) {
    for (const char* folder : {colour, depth}) std::filesystem::create_directories(root / folder);
    for (std::size_t i = 0; i < film().size(); ++i) {
      const Shot shot = seen_by(film()[i], view);
      const auto [colour_name, depth_name] = name(i);
      runtime::write_image(root / colour / colour_name, shot.bgr);
      runtime::write_image(root / depth / depth_name, shot.depth);
    }
  }

  using Names = std::pair<std::string, std::string>;

  /// @param T_c_body  of what the ground truth is the pose of
  void tum(const View& as, const std::string& truth, const std::string& associations,
           const SE3<double>& T_c_body = {}) {
    view = as;
    images("rgb", "depth", [](std::size_t i) { return Names(stamp(i) + ".png", stamp(i) + ".png"); });
    std::ofstream rgb(root / "rgb.txt"), depth(root / "depth.txt"), pairs(root / associations),
        poses(root / truth);
    for (std::size_t i = 0; i < film().size(); ++i) {
      rgb << stamp(i) << " rgb/" << stamp(i) << ".png\n";
      depth << stamp(i) << " depth/" << stamp(i) << ".png\n";
      // Depth first, as many tools write it.
      pairs << fmt::format("{0} depth/{0}.png {0} rgb/{0}.png\n", stamp(i));
      poses << pose_text(stamp(i), film()[i].T_w_c * T_c_body);
    }
  }

  /// Its ground truth is of a body with markers; the matrices are those of the data set's page.
  void bonn() {
    Eigen::Matrix3d T_ros, T_m;
    T_ros << -1, 0, 0, 0, 0, 1, 0, 1, 0;
    T_m << 1.0157, 0.1828, -0.2389, 0.0009, -0.8431, -0.6413, -0.3009, 0.6147, -0.8085;
    // The nearest rotation; the data set's numbers have four digits and a scale.
    Eigen::Matrix3d R_body_c = T_ros * T_m;
    for (int k = 0; k < 60; ++k) R_body_c = (R_body_c + R_body_c.inverse().transpose()).eval() / 2;
    tum({640, 480, 542.822841, 542.576870, 315.593520, 237.756098, 5000, 0}, "groundtruth.txt",
        "associations.txt",
        SE3<double>(Eigen::Quaterniond(R_body_c).normalized(), Eigen::Vector3d::Zero()).inverse());
  }

  void eth3d() {
    tum({600, 440, 535, 535, 300, 220, 5000, 0}, "groundtruth.txt", "associated.txt");
    std::ofstream(root / "calibration.txt") << "535 535 300 220\n";
  }

  /// y up in camera and world; the images as everybody's.
  void icl() {
    view = {640, 480, 481.2, 480, 319.5, 239.5, 5000, 0};
    images("rgb", "depth", [](std::size_t i) {
      return Names(std::to_string(i + 1) + ".png", std::to_string(i + 1) + ".png");
    });
    std::ofstream pairs(root / "associations.txt"), poses(root / "livingRoom1.gt.freiburg");
    const Eigen::Matrix4d flip = Eigen::Vector4d(1, -1, 1, 1).asDiagonal();
    for (std::size_t i = 0; i < film().size(); ++i) {
      pairs << fmt::format("{0} depth/{0}.png {0} rgb/{0}.png\n", i + 1);
      const Eigen::Matrix4d T = flip * film()[i].T_w_c.matrix() * flip;
      const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
      poses << pose_text(std::to_string(i + 1), SE3<double>(Eigen::Quaterniond(R), T.topRightCorner<3, 1>()));
    }
  }

  void seven_scenes() {
    view = {640, 480, 585, 585, 320, 240, 1000, 65535};
    images(".", ".", [](std::size_t i) {
      return Names(fmt::format("frame-{:06}.color.png", i), fmt::format("frame-{:06}.depth.png", i));
    });
    for (std::size_t i = 0; i < film().size(); ++i)
      std::ofstream(root / fmt::format("frame-{:06}.pose.txt", i)) << matrix_text(film()[i].T_w_c.matrix());
  }

  void replica() {
    view = {640, 360, 500, 500, 319.5, 179.5, 6553.5, 0};
    images("results", "results", [](std::size_t i) {
      return Names(fmt::format("frame{:06}.jpg", i), fmt::format("depth{:06}.png", i));
    });
    std::ofstream poses(root / "traj.txt");
    for (const Shot& shot : film()) poses << matrix_text(shot.T_w_c.matrix(), " ");
    std::ofstream(path / "cam_params.json")
        << R"({"camera": {"w": 640, "h": 360, "fx": 500.0, "fy": 500.0, "cx": 319.5, "cy": 179.5,
               "scale": 6553.5}})";
  }

  /// Colour of twice the size; names without leading zeros, so that 10 must come after 9.
  void scannet() {
    view = {640, 480, 540, 540, 319.5, 239.5, 1000, 0};
    const View large{1280, 960, 1080, 1080, 639.5, 479.5, 1000, 0};
    for (const char* folder : {"color", "depth", "pose", "intrinsic"})
      std::filesystem::create_directories(root / folder);
    for (std::size_t i = 0; i < film().size(); ++i) {
      const std::string name = std::to_string(i);
      runtime::write_image(root / "color" / (name + ".jpg"), seen_by(film()[i], large).bgr);
      runtime::write_image(root / "depth" / (name + ".png"), seen_by(film()[i], view).depth);
      std::ofstream(root / "pose" / (name + ".txt")) << matrix_text(film()[i].T_w_c.matrix());
    }
    for (const auto& [name, v] : {std::pair("depth", view), std::pair("color", large)}) {
      Eigen::Matrix4d K = Eigen::Matrix4d::Identity();
      K(0, 0) = v.fx;
      K(1, 1) = v.fy;
      K(0, 2) = v.cx;
      K(1, 2) = v.cy;
      std::ofstream(root / "intrinsic" / fmt::format("intrinsic_{}.txt", name)) << matrix_text(K);
    }
  }

  void redwood() {
    view = {640, 480, 525, 525, 319.5, 239.5, 1000, 0};
    images("color", "depth",
           [](std::size_t i) { return Names(fmt::format("{:05}.jpg", i), fmt::format("{:05}.png", i)); });
    std::ofstream(root / "camera_intrinsic.json")
        << "{\"width\": 640, \"height\": 480,\n"
           " \"intrinsic_matrix\": [525, 0, 0, 0, 525, 0, 319.5, 239.5, 1]}\n";
    std::ofstream poses(root / "trajectory.log");
    for (std::size_t i = 0; i < film().size(); ++i)
      poses << fmt::format("{0} {0} {1}\n", i, i + 1) << matrix_text(film()[i].T_w_c.matrix());
  }

  /// Poses of a body that looks along x with z down.
  /// @param seen_from  the camera's name: left in version 1, lcam_front in version 2
  void tartanair(const std::string& seen_from, const View& as) {
    view = as;
    const std::filesystem::path images = root / ("image_" + seen_from),
                                depths = root / ("depth_" + seen_from);
    for (const auto& folder : {images, depths}) std::filesystem::create_directories(folder);
    std::ofstream poses(root / fmt::format("pose_{}.txt", seen_from));
    for (std::size_t i = 0; i < film().size(); ++i) {
      const Shot shot = seen_by(film()[i], view);
      const std::string name = fmt::format("{:06}_{}", i, seen_from);
      const cv::Mat metres = depth_floats(shot.depth);
      runtime::write_image(images / (name + ".png"), shot.bgr);
      if (seen_from == "left") {
        write_npy(depths / (name + "_depth.npy"), metres);
      } else {
        runtime::write_image(depths / (name + "_depth.png"), channels_of_floats(metres));
      }
      const Eigen::Matrix3d R = film()[i].T_w_c.so3().matrix();
      Eigen::Matrix3d R_w_body;  // forward, right, down
      R_w_body << R.col(2), R.col(0), R.col(1);
      const std::string row =
          pose_text("0", SE3<double>(Eigen::Quaterniond(R_w_body), film()[i].T_w_c.translation()));
      poses << row.substr(2);
    }
  }

  /// A video of twice the size, depth of 256 x 192 with the lowest confidence where there is none.
  void stray_scanner() {
    view = {640, 480, 500, 500, 319.5, 239.5, 1000, 0};
    const View large{1280, 960, 1000, 1000, 639.5, 479.5, 1000, 0};
    for (const char* folder : {"depth", "confidence"}) std::filesystem::create_directories(root / folder);
    cv::VideoWriter video((root / "rgb.mp4").string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), kFilmRate,
                          cv::Size(large.width, large.height));
    if (!video.isOpened()) throw std::runtime_error("OpenCV cannot write a video");
    std::ofstream rows(root / "odometry.csv");
    rows << "timestamp, frame, x, y, z, qx, qy, qz, qw\n";
    for (std::size_t i = 0; i < film().size(); ++i) {
      video.write(seen_by(film()[i], large).bgr);
      cv::Mat depth;
      cv::resize(seen_by(film()[i], view).depth, depth, kPhoneDepth, 0, 0, cv::INTER_NEAREST_EXACT);
      cv::Mat confidence(depth.size(), CV_8UC1, cv::Scalar(2));
      confidence.setTo(0, depth == 0);
      depth.setTo(65, depth == 0);  // what the sensor is not sure of
      runtime::write_image(root / "depth" / fmt::format("{:06}.png", i), depth);
      runtime::write_image(root / "confidence" / fmt::format("{:06}.png", i), confidence);
      std::string pose = pose_text("", film()[i].T_w_c);
      pose.pop_back();
      std::replace(pose.begin(), pose.end(), ' ', ',');
      rows << fmt::format("{},{:06}{}\n", stamp(i), i, pose);
    }
    std::ofstream(root / "camera_matrix.csv") << "1000.0,0.0,639.5\n0.0,1000.0,479.5\n0.0,0.0,1.0\n";
  }
};

/// The formats, and the version of one that differs.
inline constexpr const char* kFormatNames[] = {"tum",       "bonn",        "eth3d",        "icl-nuim",
                                               "7-scenes",  "replica",     "scannet",      "redwood",
                                               "tartanair", "tartanair-2", "stray-scanner"};

}  // namespace dynslam::test
