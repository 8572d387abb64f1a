// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/trajectory_io.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>
#include <string>
#include <string_view>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "dynslam/runtime/io/time_stamp.hpp"
#include "io/argument_check.hpp"

namespace dynslam::runtime {
namespace {

constexpr double kFarthest = 1e12;  // metres; squares of differences keep their digits

/// @throws InputError with the line
StampedPose<double> pose_of_row(const LineReader& reader, const std::string& name) {
  const auto words = split_words(reader.line());
  if (words.size() != 8) {
    throw InputError(
        name, reader.number(),
        fmt::format("expected 8 columns (timestamp tx ty tz qx qy qz qw), found {}", words.size()));
  }
  const auto refuse = [&](std::string_view word) {
    throw InputError(name, reader.number(), fmt::format("'{}' is not a finite number", word));
  };
  const auto time = parse_time(words[0]);
  if (!time) refuse(words[0]);
  std::array<double, 8> value{};
  for (std::size_t i = 1; i < value.size(); ++i) {
    const auto number = parse_number(words[i]);
    if (!number) refuse(words[i]);
    value[i] = *number;
  }
  Eigen::Quaterniond q(value[7], value[4], value[5], value[6]);
  const double largest = q.coeffs().cwiseAbs().maxCoeff();
  if (largest > 1) q.coeffs() /= largest;  // its square may be no number any more
  for (std::size_t i = 1; i < 4; ++i) {
    if (std::abs(value[i]) > kFarthest)
      throw InputError(name, reader.number(), fmt::format("'{}' is too far to be a position", words[i]));
  }
  if (!(q.norm() > 1e-6)) throw InputError(name, reader.number(), "the quaternion is zero");
  return {time->t, SE3<double>(q.normalized(), Eigen::Vector3d(value[1], value[2], value[3])), time->ns};
}

/// As TUM's tools: by time, and of equal stamps the last one counts. Published trajectories and TUM's own
/// fr3_walking_static ground truth need it.
void sort_poses(std::vector<StampedPose<double>>& trajectory) {
  std::stable_sort(trajectory.begin(), trajectory.end(),
                   [](const auto& a, const auto& b) { return a.t < b.t; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    if (i + 1 < trajectory.size() && trajectory[i + 1].t == trajectory[i].t) continue;
    trajectory[kept++] = trajectory[i];
  }
  trajectory.erase(trajectory.begin() + static_cast<std::ptrdiff_t>(kept), trajectory.end());
}

}  // namespace

void UsablePoses::leave_out(const std::string& fault) {
  if (left_out++ == 0) first_fault = fault;
}

std::string UsablePoses::note() const {
  if (left_out == 0) return {};
  return fmt::format("{} of {} poses are left out; the first: {}", left_out, left_out + poses.size(),
                     first_fault);
}

std::vector<StampedPose<double>> parse_trajectory(std::istream& in, const std::string& name) {
  std::vector<StampedPose<double>> trajectory;
  LineReader reader(in);
  while (reader.next()) trajectory.push_back(pose_of_row(reader, name));
  if (in.bad()) throw InputError(name, 0, "cannot be read");
  if (trajectory.empty()) throw InputError(name, 0, "holds no poses");
  sort_poses(trajectory);
  return trajectory;
}

UsablePoses parse_usable_poses(std::istream& in, const std::string& name) {
  UsablePoses result;
  LineReader reader(in);
  while (reader.next()) {
    try {
      result.poses.push_back(pose_of_row(reader, name));
    } catch (const InputError& error) {
      result.leave_out(error.what());
    }
  }
  if (in.bad()) throw InputError(name, 0, "cannot be read");
  sort_poses(result.poses);
  return result;
}

std::vector<StampedPose<double>> read_trajectory(const std::filesystem::path& path) {
  std::istringstream in(read_text(path));
  return parse_trajectory(in, path.string());
}

UsablePoses read_usable_poses(const std::filesystem::path& path) {
  std::istringstream in(read_text(path));
  UsablePoses result = parse_usable_poses(in, path.string());
  if (!result.poses.empty()) return result;
  throw InputError(path.string(), 0,
                   result.left_out == 0 ? "holds no poses"
                                        : fmt::format("holds no poses: {} lines are none; the first: {}",
                                                      result.left_out, result.first_fault));
}

void write_trajectory(const std::filesystem::path& path, std::span<const StampedPose<double>> trajectory) {
  for (const StampedPose<double>& pose : trajectory) {
    check_argument(std::isfinite(pose.t), "write_trajectory(): a time is not a number");
    check_pose(pose.T_w_c, "write_trajectory(): a pose");
  }
  // Microseconds, as TUM's files have them, unless a time has more to it.
  const bool exact =
      std::any_of(trajectory.begin(), trajectory.end(), [](const auto& pose) { return pose.ns % 1000 != 0; });
  AtomicFile file(path);
  file.stream() << "# timestamp tx ty tz qx qy qz qw\n";
  for (const StampedPose<double>& pose : trajectory) {
    const auto& p = pose.T_w_c.translation();
    const auto& q = pose.T_w_c.so3().quaternion();
    const std::string time = !exact         ? fmt::format("{:.6f}", pose.t)
                             : pose.ns != 0 ? nanosecond_text(pose.ns)
                                            : fmt::format("{:.9f}", pose.t);
    file.stream() << fmt::format("{} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n", time, p.x(), p.y(),
                                 p.z(), q.x(), q.y(), q.z(), q.w());
  }
  file.commit();
}

}  // namespace dynslam::runtime
