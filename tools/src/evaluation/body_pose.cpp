// SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/body_pose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "io/formats/format.hpp"

namespace dynslam::runtime {
namespace {

/// "tx ty tz qx qy qz qw", a trajectory's line without its time and as that one is checked; nullopt for lines
/// of another number of words. @throws InputError with the line
std::optional<SE3<double>> pose_of_seven(const LineReader& reader, const std::string& name) {
  constexpr std::size_t kWords = 7;
  if (split_words(reader.line()).size() != kWords) return std::nullopt;
  std::istringstream in(std::string(reader.number() - 1, '\n') + "0 " + reader.line());
  return parse_trajectory(in, name).front().T_w_c;
}

/// The rotation that fits all, and how far the farthest nine tenths of them are from it [rad].
struct MeanTurn {
  Eigen::Quaterniond turn;
  double scatter = 0;
};
MeanTurn mean_of(std::vector<Eigen::Quaterniond> turns) {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (Eigen::Quaterniond& q : turns) {
    if (q.dot(turns.front()) < 0) q.coeffs() = -q.coeffs();
    sum += q.coeffs();
  }
  MeanTurn result{Eigen::Quaterniond(Eigen::Vector4d(sum.normalized())), 0};
  std::vector<double> angles;
  for (const Eigen::Quaterniond& q : turns) angles.push_back(q.angularDistance(result.turn));
  const auto at = angles.begin() + static_cast<std::ptrdiff_t>(9 * (angles.size() - 1) / 10);
  std::nth_element(angles.begin(), at, angles.end());
  result.scatter = *at;
  return result;
}

/// From the camera to the ground truth's body; nullopt where a turn of the world, which the alignment of few
/// or straight positions leaves open, explains the same: the camera did not turn enough.
std::optional<MeanTurn> turn_of_body(std::span<const StampedPose<double>> estimate,
                                     std::span<const StampedPose<double>> groundtruth,
                                     const SE3<double>& T_gt_est) {
  std::vector<double> times_gt, times_est;
  for (const auto& pose : groundtruth) times_gt.push_back(pose.t);
  for (const auto& pose : estimate) times_est.push_back(pose.t);
  std::vector<Eigen::Quaterniond> of_body, of_world;
  for (const auto& [i, j] : associate(times_gt, times_est)) {
    const SO3<double> truth = groundtruth[i].T_w_c.so3(), found = (T_gt_est * estimate[j].T_w_c).so3();
    of_body.push_back((truth.inverse() * found).quaternion());
    of_world.push_back((found * truth.inverse()).quaternion());
  }
  if (of_body.size() < 3) return std::nullopt;
  const MeanTurn body = mean_of(std::move(of_body)), world = mean_of(std::move(of_world));
  constexpr double kClearly = 3;
  if (!(world.scatter > kClearly * body.scatter)) return std::nullopt;
  return body;
}

}  // namespace

SE3<double> read_body_pose(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  std::istringstream lines(text);
  LineReader reader(lines);
  if (!reader.next()) throw InputError(file.string(), 0, "holds no pose");
  if (const auto pose = pose_of_seven(reader, file.string())) return *pose;
  std::istringstream in(text);
  const auto matrix = formats::parse_matrix(in, file.string());
  const auto pose = matrix ? formats::rigid_motion(*matrix) : std::nullopt;
  if (!pose)
    throw InputError(file.string(), 0,
                     "is no pose: four rows of a rigid motion's matrix, or tx ty tz qx qy qz qw");
  return *pose;
}

void apply_body_pose(const SE3<double>& T_body_camera, std::vector<StampedPose<double>>& truth) {
  for (auto& pose : truth) pose.T_w_c = pose.T_w_c * T_body_camera;
}

void turn_bonn_file(const std::filesystem::path& file, std::vector<StampedPose<double>>& truth,
                    std::vector<std::string>& notes) {
  if (file.filename() != "groundtruth.txt") return;
  std::filesystem::path folder = file.parent_path();
  if (folder.empty()) folder = ".";
  const auto found = formats_of(folder);
  if (std::find(found.begin(), found.end(), "bonn") == found.end()) return;
  notes.push_back(formats::turn_bonn_truth(truth));
}

void note_turned_body(std::span<const StampedPose<double>> estimate,
                      std::span<const StampedPose<double>> groundtruth, const AteResult<double>& ate,
                      const RpeResult<double>& rpe, std::vector<std::string>& notes) {
  // Positions agree three times better than motions over a second do.
  constexpr double kContradiction = 3, kDegree = std::numbers::pi / 180, kTurned = 3 * kDegree;
  if (!(rpe.translation.rmse > kContradiction * ate.translation.rmse)) return;
  const auto body = turn_of_body(estimate, groundtruth, ate.T_gt_est);
  if (!body) return;
  const double angle = body->turn.angularDistance(Eigen::Quaterniond::Identity());
  if (angle < kTurned || body->scatter > angle / 3) return;
  const auto& q = body->turn;
  notes.push_back(
      fmt::format("the ground truth is of a body that is turned by {:.1f} degrees against the camera, "
                  "which RPE takes for an error: --body-pose FILE with 0 0 0 {:.4f} {:.4f} {:.4f} {:.4f} "
                  "turns it",
                  angle / kDegree, q.x(), q.y(), q.z(), q.w()));
}

}  // namespace dynslam::runtime
