// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/mask_faults.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "dynslam/image/depth.hpp"
#include "dynslam/robust/consensus.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "io/make_folder.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
constexpr double kLongestGap = 0.05;          // to the next true pose [s]
constexpr double kObjectShare = 0.25;         // of the view halfway through
constexpr double kCovered = 0.9;              // share of the columns
constexpr std::size_t kLate = 5;              // frames
constexpr double kShiftedShare = 40.0 / 640;  // share of the width
constexpr int kBlobs = 6;                     // per frame
constexpr double kLargestBlob = 0.2;          // half axis, share of the width

/// A ball that stays where it is.
struct Ball {
  Eigen::Vector3d centre;
  double radius;
};

class MaskFaults {
 public:
  explicit MaskFaults(const MaskFaultOptions& options)
      : options_(options),
        sequence_(load_sequence(options.sequence, options.reading)),
        camera_(camera_of(sequence_, options.reading.camera)),
        random_(options.seed) {
    check_no_input(sequence_, options.out);
    if (sequence_.groundtruth.empty())
      throw InputError(options.sequence.string(), 0, "has no ground truth to place an object by");
    truth_ = options.sequence / "dynamic_mask";
    has_truth_ = fs::is_directory(truth_);
    check_truth();
    object_ = find_object();
    make_folder(options.out);
  }

  MaskFaultReport write(const std::function<void(std::size_t, std::size_t)>& progress) {
    const std::size_t n = sequence_.frames.size(), before = count_pngs(options_.out);
    for (std::size_t i = 0; i < n; ++i) {
      const cv::Mat made = mask(i);
      report_.marked += cv::countNonZero(made) > 0 ? 1 : 0;
      write_image(options_.out / (sequence_.frames[i].stamp + ".png"), made);
      ++report_.masks;
      progress(i + 1, n);
    }
    const std::size_t after = count_pngs(options_.out);
    report_.left = after - std::min(after, report_.masks);
    report_.replaced = before - std::min(before, report_.left);
    return report_;
  }

 private:
  /// True masks of another sequence would be no marks at all.
  void check_truth() {
    const MaskFault f = options_.fault;
    if (f == MaskFault::cover || f == MaskFault::empty || f == MaskFault::blobs) return;
    report_.no_truth = !has_truth_;
    const auto& frames = sequence_.frames;
    if (has_truth_ &&
        std::none_of(frames.begin(), frames.end(), [&](const auto& r) { return fs::exists(true_file(r)); }))
      throw InputError(truth_.string(), 0,
                       fmt::format("has no mask of any frame of the sequence: {} and the like are looked for",
                                   true_file(frames.front()).filename().string()));
  }

  [[nodiscard]] cv::Mat nothing() const { return cv::Mat::zeros(camera_.height, camera_.width, CV_8UC1); }

  [[nodiscard]] cv::Mat mask(std::size_t i) {
    const std::size_t half = sequence_.frames.size() / 2;
    const auto with_object = [&](bool seen) {
      return seen ? cv::Mat(true_mask(i) | object_mask(i)) : true_mask(i);
    };
    switch (options_.fault) {
      case MaskFault::object_always:
        return with_object(true);
      case MaskFault::object_third:
        return with_object(i % 3 == 0);
      case MaskFault::object_first_half:
        return with_object(i < half);
      case MaskFault::object_second_half:
        return with_object(i >= half);
      case MaskFault::cover: {
        cv::Mat covered = nothing();
        covered.colRange(0, cvRound(kCovered * camera_.width)) = 255;
        return covered;
      }
      case MaskFault::mirrored: {
        cv::Mat mirrored;
        cv::flip(right_mask(i), mirrored, 1);
        return mirrored;
      }
      case MaskFault::late:
        return right_mask(i > kLate ? i - kLate : 0);
      case MaskFault::shifted: {
        const int shift = cvRound(kShiftedShare * camera_.width);
        cv::Mat shifted = nothing();
        right_mask(i).colRange(0, camera_.width - shift).copyTo(shifted.colRange(shift, camera_.width));
        return shifted;
      }
      case MaskFault::empty:
        return nothing();
      case MaskFault::blobs:
        return blobs();
    }
    return nothing();
  }

  [[nodiscard]] cv::Mat blobs() {
    cv::Mat result = nothing();
    const auto within = [&](double low, double high) {
      return cvRound(low + (high - low) * random_.unit<double>());
    };
    for (int k = 0; k < kBlobs; ++k) {
      const double largest = kLargestBlob * camera_.width;
      const int x = within(0, camera_.width), y = within(0, camera_.height), angle = within(0, 180);
      const int a = within(0.1 * largest, largest), b = within(0.1 * largest, largest);
      cv::ellipse(result, {x, y}, {a, b}, angle, 0, 360, 255, cv::FILLED);
    }
    return result;
  }

  /// What moves, or where nothing is known to move the object instead.
  [[nodiscard]] cv::Mat right_mask(std::size_t i) { return has_truth_ ? true_mask(i) : object_mask(i); }
  [[nodiscard]] fs::path true_file(const FrameRecord& frame) const { return truth_ / (frame.stamp + ".png"); }
  [[nodiscard]] cv::Mat true_mask(std::size_t i) {
    const fs::path file = true_file(sequence_.frames[i]);
    if (!has_truth_) return nothing();
    if (!fs::exists(file)) {
      ++report_.without_truth;
      return nothing();
    }
    const cv::Mat mask = read_image(file, cv::IMREAD_GRAYSCALE) != 0;
    if (mask.size() != cv::Size(camera_.width, camera_.height))
      throw InputError(file.string(), 0, "is not of the camera's size");
    return mask;
  }

  /// True pose at a frame's depth image, T_w_c.
  [[nodiscard]] std::optional<SE3<double>> pose(std::size_t i) const {
    const auto& truth = sequence_.groundtruth;
    const double t = sequence_.frames[i].t_depth;
    const auto after =
        std::lower_bound(truth.begin(), truth.end(), t, [](const auto& p, double s) { return p.t < s; });
    std::optional<SE3<double>> nearest;
    double gap = kLongestGap;
    for (auto p = after == truth.begin() ? after : after - 1; p != truth.end() && p <= after; ++p) {
      if (std::abs(p->t - t) >= gap) continue;
      gap = std::abs(p->t - t);
      nearest = p->T_w_c;
    }
    return nearest;
  }

  /// Calls visit(pixel, p_w) for each pixel with depth. @return whether the frame's place is known
  template <class Visit>
  bool visit_surface(std::size_t i, Visit&& visit) const {
    const auto T_w_c = pose(i);
    if (!T_w_c) return false;
    const cv::Mat depth = decode_frame(sequence_.frames[i], i, camera_).depth;
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        const auto z = static_cast<double>(depth.at<float>(v, u));
        if (!is_valid_depth(z)) continue;
        if (const auto p = camera_.model.unproject(Eigen::Vector2d(u, v), z))
          visit(cv::Point(u, v), *T_w_c * *p);
      }
    }
    return true;
  }

  [[nodiscard]] Ball find_object() const {
    const std::size_t middle = sequence_.frames.size() / 2;
    const cv::Point2d image_centre(camera_.width / 2.0, camera_.height / 2.0);
    std::vector<Eigen::Vector3d> surface;
    Ball ball{Eigen::Vector3d::Zero(), 0};
    double nearest = std::numeric_limits<double>::infinity();
    if (!visit_surface(middle,
                       [&](const cv::Point& x, const Eigen::Vector3d& p_w) {
                         surface.push_back(p_w);
                         const double distance = cv::norm(cv::Point2d(x) - image_centre);
                         if (distance >= nearest) return;
                         nearest = distance;
                         ball.centre = p_w;
                       }) ||
        surface.empty())
      throw InputError(options_.sequence.string(), 0, "has neither pose nor depth halfway through");
    std::vector<double> distances(surface.size());
    std::transform(surface.begin(), surface.end(), distances.begin(),
                   [&](const Eigen::Vector3d& p_w) { return (p_w - ball.centre).norm(); });
    const auto wanted =
        std::min(surface.size() - 1, static_cast<std::size_t>(kObjectShare * camera_.width * camera_.height));
    std::nth_element(distances.begin(), distances.begin() + static_cast<std::ptrdiff_t>(wanted),
                     distances.end());
    ball.radius = distances[wanted];
    return ball;
  }

  [[nodiscard]] cv::Mat object_mask(std::size_t i) const {
    cv::Mat mask = nothing();
    visit_surface(i, [&](const cv::Point& x, const Eigen::Vector3d& p_w) {
      if ((p_w - object_.centre).norm() < object_.radius) mask.at<std::uint8_t>(x) = 255;
    });
    constexpr int kClosed = 15;  // pixels: holes without depth
    cv::morphologyEx(mask, mask, cv::MORPH_CLOSE,
                     cv::getStructuringElement(cv::MORPH_RECT, {kClosed, kClosed}));
    return mask;
  }

  const MaskFaultOptions& options_;
  Sequence sequence_;
  CameraConfig camera_;
  SplitMix64 random_;
  fs::path truth_;
  bool has_truth_ = false;
  Ball object_;
  MaskFaultReport report_;
};

}  // namespace

std::optional<MaskFault> parse_mask_fault(std::string_view name) {
  const auto found = std::find(kMaskFaultNames.begin(), kMaskFaultNames.end(), name);
  if (found == kMaskFaultNames.end()) return std::nullopt;
  return static_cast<MaskFault>(found - kMaskFaultNames.begin());
}

MaskFaultReport write_mask_faults(const MaskFaultOptions& options,
                                  const std::function<void(std::size_t, std::size_t)>& progress) {
  return MaskFaults(options).write(progress);
}

}  // namespace dynslam::runtime
