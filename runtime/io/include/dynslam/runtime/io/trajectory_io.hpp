// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <filesystem>
#include <istream>
#include <span>
#include <string>
#include <vector>

#include "dynslam/eval/trajectory.hpp"

namespace dynslam::runtime {

/// Reads "timestamp tx ty tz qx qy qz qw" lines (TUM format; commas allowed, # comments).
/// A time of 19 digits is one in nanoseconds; see parse_time(). Sorted by time; of equal stamps the last one
/// counts (as in TUM's tools, whose own data needs it).
/// @param name  of the file, for error messages
/// @throws InputError  with the line: wrong number of columns, a word that is no finite number, a zero
///         quaternion; or an empty file
[[nodiscard]] std::vector<StampedPose<double>> parse_trajectory(std::istream& in, const std::string& name);
/// The same of a file. @throws InputError also where it cannot be read
[[nodiscard]] std::vector<StampedPose<double>> read_trajectory(const std::filesystem::path& path);

/// Poses as people have them: what is no pose is left out and counted.
struct UsablePoses {
  std::vector<StampedPose<double>> poses;
  std::size_t left_out = 0;
  std::string first_fault;  ///< of the first that is left out: place and reason
  /// Leaves one out.
  void leave_out(const std::string& fault);
  /// In a line; empty where nothing is left out.
  [[nodiscard]] std::string note() const;
};
/// As parse_trajectory(), but rows that are no pose (other columns, no number, a zero quaternion, a line that
/// was cut) are left out, as TUM's tools do; there may be no poses. @throws InputError where reading fails
[[nodiscard]] UsablePoses parse_usable_poses(std::istream& in, const std::string& name);
/// The same of a file. @throws InputError also where it has no pose at all
[[nodiscard]] UsablePoses read_usable_poses(const std::filesystem::path& path);

/// Writes TUM format (time with 6 decimals, or with 9 where StampedPose::ns has more; pose with 9), through a
/// temporary file, so that a reader never sees half a trajectory. @throws InputError when it cannot be
/// written
void write_trajectory(const std::filesystem::path& path, std::span<const StampedPose<double>> trajectory);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
