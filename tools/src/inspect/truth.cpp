// SPDX-License-Identifier: BSD-3-Clause
// Depth against ground truth: points followed from one image to another, placed by depth in both, tell how
// far the camera went in the depth images' metres; the ground truth tells how far it went.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>
#include <vector>

#include "dynslam/geometry/rigid_alignment.hpp"
#include "dynslam/robust/consensus.hpp"
#include "inspect/measure.hpp"

namespace dynslam::runtime::inspect {
namespace {

/// The true pose at a time, between its neighbours in time; nullopt where these are far.
std::optional<SE3<double>> pose_at(const std::vector<StampedPose<double>>& truth, double t) {
  constexpr double kFarthest = 0.05, kSame = 1e-4;  // seconds
  const auto after =
      std::lower_bound(truth.begin(), truth.end(), t, [](const auto& p, double s) { return p.t < s; });
  if (after != truth.end() && after->t - t < kSame) return after->T_w_c;
  if (after == truth.begin()) return std::nullopt;
  const auto before = after - 1;
  if (t - before->t < kSame) return before->T_w_c;
  if (after == truth.end() || after->t - before->t > 2 * kFarthest) return std::nullopt;
  const double share = (t - before->t) / (after->t - before->t);
  const auto& a = before->T_w_c;
  const auto& b = after->T_w_c;
  return SE3<double>(a.so3().quaternion().slerp(share, b.so3().quaternion()).normalized(),
                     Eigen::Vector3d((1 - share) * a.translation() + share * b.translation()));
}

/// Points of the first image of a burst and where they are in its last one; lost ones left out.
void follow(const Burst& burst, std::vector<cv::Point2f>& first, std::vector<cv::Point2f>& last) {
  constexpr int kPoints = 400;
  constexpr double kQuality = 0.01;
  const double apart = burst.front().gray.cols / 80.0;
  cv::goodFeaturesToTrack(burst.front().gray, first, kPoints, kQuality, apart);
  last = first;
  for (std::size_t i = 1; i < burst.size() && !last.empty(); ++i) {
    std::vector<cv::Point2f> next, back;
    std::vector<std::uint8_t> found, found_back;
    std::vector<float> error;
    cv::calcOpticalFlowPyrLK(burst[i - 1].gray, burst[i].gray, last, next, found, error);
    cv::calcOpticalFlowPyrLK(burst[i].gray, burst[i - 1].gray, next, back, found_back, error);
    std::size_t kept = 0;
    for (std::size_t k = 0; k < next.size(); ++k) {
      const bool returns = cv::norm(back[k] - last[k]) < 0.5;  // pixels
      const bool inside = next[k].x >= 0 && next[k].y >= 0 && next[k].x < float(burst[i].gray.cols - 1) &&
                          next[k].y < float(burst[i].gray.rows - 1);
      if (found[k] == 0 || found_back[k] == 0 || !returns || !inside) continue;
      first[kept] = first[k];
      next[kept] = next[k];
      ++kept;
    }
    first.resize(kept);
    next.resize(kept);
    last = std::move(next);
  }
}

/// Depth at a point whose neighbours lie on the same surface; nullopt elsewhere.
std::optional<double> smooth_depth(const cv::Mat& depth, const cv::Point2f& p) {
  const int u = static_cast<int>(std::lround(p.x)), v = static_cast<int>(std::lround(p.y));
  constexpr int kAround = 2;
  constexpr float kFlat = 0.03F;  // of the depth
  if (u < kAround || v < kAround || u >= depth.cols - kAround || v >= depth.rows - kAround)
    return std::nullopt;
  const float z = depth.at<float>(v, u);
  for (int dv = -kAround; dv <= kAround; ++dv) {
    for (int du = -kAround; du <= kAround; ++du) {
      if (!(std::abs(depth.at<float>(v + dv, u + du) - z) <= kFlat * z)) return std::nullopt;
    }
  }
  return double(z);
}

using Points = std::vector<Eigen::Vector3d>;

/// Points of a burst's first and last image, in metres of the depth images.
std::pair<Points, Points> points_of(const Burst& burst, const CameraConfig& camera) {
  std::vector<cv::Point2f> first, last;
  follow(burst, first, last);
  std::pair<Points, Points> points;
  const auto place = [&](const RgbdFrame& frame, const cv::Point2f& p) -> std::optional<Eigen::Vector3d> {
    const auto z = smooth_depth(frame.depth, p);
    if (!z) return std::nullopt;
    return camera.model.unproject(Eigen::Vector2d(double(p.x), double(p.y)), *z);
  };
  for (std::size_t k = 0; k < first.size(); ++k) {
    const auto a = place(burst.front(), first[k]), b = place(burst.back(), last[k]);
    if (!a || !b) continue;
    points.first.push_back(*a);
    points.second.push_back(*b);
  }
  return points;
}

/// T_b_a that most points agree with, within 2 % of their distance; nullopt where fewer than half do: the
/// rest may be people. Threes are drawn from a fixed seed: the same images give the same motion.
std::optional<SE3<double>> motion_of(const Points& a, const Points& b) {
  constexpr std::size_t kFewest = 20, kDraws = 300;
  constexpr double kClose = 0.02;
  const std::size_t n = a.size();
  if (n < kFewest) return std::nullopt;
  const auto agree = [&](const SE3<double>& T) {
    std::pair<Points, Points> kept;
    for (std::size_t k = 0; k < n; ++k) {
      if ((T * a[k] - b[k]).norm() > kClose * b[k].norm()) continue;
      kept.first.push_back(a[k]);
      kept.second.push_back(b[k]);
    }
    return kept;
  };
  std::pair<Points, Points> best;
  SplitMix64 random(1);
  std::array<std::size_t, 3> k{};
  for (std::size_t trial = 0; trial < kDraws; ++trial) {
    draw_distinct(random, n, k);
    const Points three_a{a[k[0]], a[k[1]], a[k[2]]}, three_b{b[k[0]], b[k[1]], b[k[2]]};
    const auto T = horn_alignment<double>(three_a, three_b);
    if (!T) continue;
    auto kept = agree(*T);
    if (kept.first.size() > best.first.size()) best = std::move(kept);
  }
  if (2 * best.first.size() < n) return std::nullopt;
  const auto T = horn_alignment<double>(best.first, best.second);
  if (!T) return std::nullopt;
  best = agree(*T);
  return horn_alignment<double>(best.first, best.second);
}

/// Whether a motion is about the true one: stamps of the ground truth may be off by some 20 ms, depth by a
/// factor.
bool about_same(const SE3<double>& measured, const SE3<double>& truth, bool has_moved) {
  constexpr double kDegree = 3.14159265358979 / 180;
  constexpr double kTurn = 2 * kDegree, kTurnShare = 0.3, kDirection = 40 * kDegree;
  const double turn = (measured.so3().inverse() * truth.so3()).log().norm();
  if (turn > kTurn + kTurnShare * truth.so3().log().norm()) return false;
  const Eigen::Vector3d a = measured.translation(), b = truth.translation();
  return !has_moved || std::atan2(a.cross(b).norm(), a.dot(b)) < kDirection;
}

}  // namespace

double covered_share(const std::vector<StampedPose<double>>& truth, std::span<const double> times) {
  const auto covered =
      std::count_if(times.begin(), times.end(), [&](double t) { return pose_at(truth, t).has_value(); });
  return times.empty() ? 0 : static_cast<double>(covered) / static_cast<double>(times.size());
}

TruthReport measure_truth(const Sequence& sequence, const CameraConfig& camera,
                          std::span<const Burst> bursts) {
  TruthReport report;
  report.poses = sequence.groundtruth.size();
  if (report.poses == 0) return report;
  std::vector<double> times;
  for (const FrameRecord& frame : sequence.frames) times.push_back(frame.t_rgb);
  report.covered = covered_share(sequence.groundtruth, times);
  std::vector<double> ratios;
  for (const Burst& burst : bursts) {
    if (burst.size() < 2) continue;
    const auto T_w_first = pose_at(sequence.groundtruth, burst.front().t),
               T_w_last = pose_at(sequence.groundtruth, burst.back().t);
    if (!T_w_first || !T_w_last) continue;
    ++report.bursts;
    const auto [a, b] = points_of(burst, camera);
    const auto measured = motion_of(a, b);
    if (!measured) continue;
    const SE3<double> truth = T_w_last->inverse() * *T_w_first;
    // Metres, and share of the points' middle distance; a share of how far a turn moves these, as depth that
    // comes some milliseconds late takes turns for steps.
    constexpr double kShortest = 0.04, kOfTurn = 0.5;
    std::vector<double> distances;
    for (const Eigen::Vector3d& p : a) distances.push_back(p.norm());
    const double middle = quantile(distances, 0.5), step = measured->translation().norm();
    const bool has_moved = truth.translation().norm() > kShortest && step > kShortest * middle &&
                           step > kOfTurn * middle * measured->so3().log().norm();
    ++report.motions;
    const bool same = about_same(*measured, truth, has_moved);
    report.agreeing += same ? 1 : 0;
    if (has_moved && same) ratios.push_back(truth.translation().norm() / measured->translation().norm());
  }
  if (!ratios.empty()) report.scale = quantile(ratios, 0.5);
  return report;
}

}  // namespace dynslam::runtime::inspect
