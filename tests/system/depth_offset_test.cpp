// SPDX-License-Identifier: BSD-3-Clause
// How late the stamps of recorded depth images are, without ground truth: depth images agree with one another
// when they are moved by the poses that the colour images have had when depth was taken.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "recorded_scans.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

struct DepthImageThen {
  double stamp;  // [s]
  cv::Mat z;     // dynamic pixels have none
};

class RecordedDepth {
 public:
  RecordedDepth(const Sequence& sequence, const CameraConfig& camera) : camera_(camera) {
    TrackerOptions options;
    options.dynamics = DynamicsMode::geometric;
    Tracker tracker(camera, options);
    FrameStream stream(sequence, camera);
    while (const auto frame = stream.next()) {
      if (!frame->frame) continue;
      const TrackResult result = tracker.track(*frame->frame, std::nullopt);
      if (!result.ok()) continue;
      t_.push_back(frame->frame->t);
      T_c_w_.push_back(result.T_w_c.inverse());
      DepthImageThen& made = depth_.emplace_back(
          DepthImageThen{frame->frame->t + frame->frame->depth_delay + camera.depth_time_offset,
                         frame->frame->depth.clone()});
      cv::Mat dynamic;
      cv::dilate(result.dynamic_mask, dynamic, cv::Mat::ones(25, 25, CV_8U));
      made.z.setTo(0, dynamic);
    }
    tracker.finish();
  }

  /// Mean of how little depth images 4, 8 and 13 frames apart agree, squared in units of their noise, if each
  /// was taken so long before its stamp [s].
  [[nodiscard]] double disagreement(double late) const {
    double sum = 0, count = 0;
    for (const std::size_t apart : {4U, 8U, 13U}) {
      for (std::size_t i = 0; i + apart < depth_.size(); ++i) {
        const DepthImageThen &a = depth_[i], &b = depth_[i + apart];
        if (a.stamp - 0.08 < t_.front() || b.stamp + 0.08 > t_.back()) continue;
        for (int v = 8; v < a.z.rows; v += 16) {
          const SE3<double> T_w_a = pose(time_of(a, v, late)).inverse();
          for (int u = 8; u < a.z.cols; u += 16) {
            if (const auto error = compare(a, u, v, T_w_a, b, late)) {
              sum += std::min(*error * *error, 9.0);
              count += 1;
            }
          }
        }
      }
    }
    return sum / count;
  }

  /// Where disagreement() is least, in steps of 5 ms and by the parabola through the least [s].
  [[nodiscard]] double measured() const {
    constexpr double kStep = 0.005;
    constexpr int kFirst = -2, kLast = 10;
    std::array<double, kLast - kFirst + 1> at{};
    for (std::size_t k = 0; k < at.size(); ++k) at[k] = disagreement((static_cast<int>(k) + kFirst) * kStep);
    const auto least = static_cast<std::size_t>(std::min_element(at.begin(), at.end()) - at.begin());
    if (least == 0 || least + 1 == at.size()) return NAN;
    const double before = at[least - 1], after = at[least + 1];
    const double top = 0.5 * (before - after) / (before - 2 * at[least] + after);
    return (static_cast<double>(least) + kFirst + top) * kStep;
  }

 private:
  /// When a row of a depth image was read: alike to colour.
  [[nodiscard]] double time_of(const DepthImageThen& image, double v, double late) const {
    return image.stamp - late + (v / (camera_.height - 1) - 0.5) * camera_.readout_time;
  }
  [[nodiscard]] SE3<double> pose(double t) const {
    const auto next = std::clamp<std::ptrdiff_t>(std::upper_bound(t_.begin(), t_.end(), t) - t_.begin(), 1,
                                                 static_cast<std::ptrdiff_t>(t_.size()) - 1);
    const auto i = static_cast<std::size_t>(next);
    const double share = (t - t_[i - 1]) / (t_[i] - t_[i - 1]);
    return SE3<double>::exp(share * (T_c_w_[i] * T_c_w_[i - 1].inverse()).log()) * T_c_w_[i - 1];
  }
  /// Depth of `b` less that of a pixel of `a` moved there, in standard deviations.
  [[nodiscard]] std::optional<double> compare(const DepthImageThen& a, int u, int v, const SE3<double>& T_w_a,
                                              const DepthImageThen& b, double late) const {
    const double z = static_cast<double>(a.z.at<float>(v, u));
    if (!(z > 0.3 && z < 4)) return std::nullopt;
    const auto p = camera_.model.unproject(Eigen::Vector2d(u, v), z);
    if (!p) return std::nullopt;
    const Eigen::Vector3d p_w = T_w_a * *p;
    Eigen::Vector3d p_b = pose(time_of(b, v, late)) * p_w;
    for (int i = 0; i < 2; ++i) {  // the row that it is in
      const auto x = camera_.model.project(p_b);
      if (!x) return std::nullopt;
      p_b = pose(time_of(b, std::clamp(x->y(), 0.0, camera_.height - 1.0), late)) * p_w;
    }
    const auto x = camera_.model.project(p_b);
    if (!x || !(x->minCoeff() >= 0 && x->x() < b.z.cols - 1 && x->y() < b.z.rows - 1)) return std::nullopt;
    const int u0 = static_cast<int>(x->x()), v0 = static_cast<int>(x->y());
    std::array<double, 4> z_b{};
    for (int k = 0; k < 4; ++k)
      z_b[static_cast<std::size_t>(k)] = static_cast<double>(b.z.at<float>(v0 + k / 2, u0 + k % 2));
    if (!std::all_of(z_b.begin(), z_b.end(), [](double d) { return d > 0; }))
      return std::nullopt;  // NaN: none
    if (*std::max_element(z_b.begin(), z_b.end()) > 1.1 * *std::min_element(z_b.begin(), z_b.end()))
      return std::nullopt;  // an edge
    const double right = x->x() - u0, down = x->y() - v0;
    const double there =
        (1 - down) * ((1 - right) * z_b[0] + right * z_b[1]) + down * ((1 - right) * z_b[2] + right * z_b[3]);
    return (there - p_b.z()) / (0.002 + 0.0025 * z * z);
  }

  CameraConfig camera_;
  std::vector<double> t_;
  std::vector<SE3<double>> T_c_w_;
  std::vector<DepthImageThen> depth_;
};

}  // namespace

// Of fr3 alone, whose preset was chosen otherwise (docs/method.md), 32 ms are measured.
TEST_CASE("the presets' depth_time_offset is the one at which depth images agree with one another") {
  struct Case {
    std::string sequence, camera;
  };
  for (const Case& c : {Case{"rgbd_dataset_freiburg1_rpy_500_649", "fr1"},
                        Case{"rgbd_bonn_crowd_380_479", "bonn"}}) {
    CAPTURE(c.sequence);
    const auto folder = test::recorded_sequence(c.sequence);
    if (!folder) {
      MESSAGE("skipped: DYNSLAM_DATA does not name a folder with tum/" << c.sequence);
      continue;
    }
    SequenceOptions reading;
    reading.camera = c.camera;
    const Sequence sequence = load_sequence(*folder, reading);
    const CameraConfig camera = camera_of(sequence, c.camera);
    const double measured = RecordedDepth(sequence, camera).measured();
    MESSAGE(c.camera << ": depth stamps are " << measured << " s late");
    CHECK(std::abs(measured - camera.depth_time_offset) < 0.005);
  }
}
