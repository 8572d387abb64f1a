// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>

#include "dynslam/eval/trajectory.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "report/payload.hpp"

namespace dynslam::runtime::reporting {
namespace {

using Poses = std::span<const StampedPose<double>>;

constexpr std::size_t kPoints = 3000;  // of a curve: more than a screen has columns
constexpr double kDegrees = 180 / std::numbers::pi;

/// Pan, tilt and roll [deg]: about the camera's y axis (down), then its x axis (right), then its view, R = Ry
/// Rx Rz. Jumps of a whole turn are taken out.
class Angles {
 public:
  explicit Angles(const SO3<double>& first) : R_first_w_(first.inverse().matrix()) {}
  Eigen::Vector3d operator()(const SO3<double>& R_w_c) {
    const Eigen::Matrix3d R = R_first_w_ * R_w_c.matrix();
    Eigen::Vector3d now(std::atan2(R(0, 2), R(2, 2)), -std::asin(std::clamp(R(1, 2), -1.0, 1.0)),
                        std::atan2(R(1, 0), R(1, 1)));
    now *= kDegrees;
    if (begun_) {
      for (int i = 0; i < 3; ++i) now(i) += 360 * std::round((last_(i) - now(i)) / 360);
    }
    begun_ = true;
    last_ = now;
    return now;
  }

 private:
  Eigen::Matrix3d R_first_w_;
  Eigen::Vector3d last_ = Eigen::Vector3d::Zero();
  bool begun_ = false;
};

json curve(const Source& source, Poses poses, const SE3<double>& T, std::size_t stride) {
  json t = json::array(), p = json::array(), a = json::array();
  Angles angles(source.R_first);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const SE3<double> pose = T * poses[i].T_w_c;
    const Eigen::Vector3d degrees = angles(pose.so3());  // of each, so that no turn is missed
    if (i % stride != 0 && i + 1 != poses.size()) continue;
    t.push_back(number(poses[i].t - source.t0, 4));
    for (int k = 0; k < 3; ++k) {
      p.push_back(number(pose.translation()(k), 4));
      a.push_back(number(degrees(k), 3));
    }
  }
  return {{"t", t}, {"p", p}, {"a", a}};
}

/// Position [m] and rotation [deg] off the truth, at each pair's time.
json errors(const Source& source, Poses poses, const SE3<double>& T) {
  const auto& truth = source.sequence.groundtruth;
  const auto times = [](Poses list) { return dynslam::detail::stamps(list); };
  const auto t_truth = times(truth), t_run = times(poses);
  const auto pairs = associate(t_truth, t_run);
  json t = json::array(), e = json::array(), r = json::array();
  const std::size_t stride = stride_for(pairs.size(), kPoints);
  for (std::size_t k = 0; k < pairs.size(); k += stride) {
    const SE3<double>& is = truth[pairs[k].first].T_w_c;
    const SE3<double> found = T * poses[pairs[k].second].T_w_c;
    t.push_back(number(t_run[pairs[k].second] - source.t0, 4));
    e.push_back(number((found.translation() - is.translation()).norm(), 5));
    r.push_back(number((is.so3().inverse() * found.so3()).log().norm() * kDegrees, 4));
  }
  return {{"t", t}, {"e", e}, {"r", r}};
}

}  // namespace

json truth_payload(const Source& source) {
  const auto& all = source.sequence.groundtruth;
  constexpr double kMargin = 0.05;  // seconds before and behind the frames
  const auto before = [](const auto& pose, double time) { return pose.t < time; };
  const auto begin = std::lower_bound(all.begin(), all.end(), source.t0 - kMargin, before);
  const auto end = std::lower_bound(begin, all.end(), source.t1 + kMargin, before);
  const std::vector<StampedPose<double>> truth(begin, end);
  if (truth.empty()) return nullptr;
  return curve(source, truth, {}, stride_for(truth.size(), kPoints));
}

json view_payload(const Source& source) {
  const auto& truth = source.sequence.groundtruth;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const auto& pose : truth.empty() ? source.runs.front().trajectory : truth)
    up -= pose.T_w_c.rotation_matrix().col(1);
  if (up.norm() < 1e-9) up = -Eigen::Vector3d::UnitY();
  up.normalize();
  json first = json::array(), direction = json::array();
  const Eigen::Matrix3d R = source.R_first.matrix();
  for (int i = 0; i < 9; ++i) first.push_back(number(R(i / 3, i % 3), 6));
  for (int i = 0; i < 3; ++i) direction.push_back(number(up(i), 4));
  return {{"up", direction}, {"first", first}};
}

json trajectory_payload(const Source& source, const RunFolder& run, std::vector<std::string>& thinned) {
  const auto& truth = source.sequence.groundtruth;
  json result{{"table", nullptr}, {"why", ""}, {"error", nullptr}, {"aligned", false}};
  SE3<double> T;
  if (truth.empty()) {
    result["why"] = source.sequence.truth_missing.empty()
                        ? "no ATE and RPE: the sequence has no ground truth"
                        : "no ATE and RPE, for want of a ground truth: " + source.sequence.truth_missing;
  } else {
    if (const auto ate = absolute_trajectory_error<double>(run.trajectory, truth)) {
      T = ate->T_gt_est;
      result["aligned"] = true;
      result["error"] = errors(source, run.trajectory, T);
    }
    try {
      const TrajectoryReport report =
          evaluate_trajectory(run.trajectory, truth, (run.folder / "trajectory.txt").string(),
                              source.sequence.truth_file.string());
      result["table"] = to_json(report);
      result["why"] = fmt::format("{}", fmt::join(report.notes, "; "));
    } catch (const InputError& error) {
      result["why"] = std::string("no ATE and RPE: ") + error.what();
    }
  }
  const std::size_t stride = stride_for(run.trajectory.size(), kPoints);
  if (stride > 1) thinned.push_back(fmt::format("{}: curves show every {}th pose", run.name, stride));
  result["trajectory"] = curve(source, run.trajectory, T, stride);
  json align = json::array();
  const Eigen::Matrix4d M = T.matrix();
  for (int i = 0; i < 16; ++i) align.push_back(number(M(i % 4, i / 4), 7));
  result["align"] = std::move(align);
  return result;
}

}  // namespace dynslam::runtime::reporting
