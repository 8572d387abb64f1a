// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace dynslam::bench {

/// The images of fr1_xyz in their order; empty where DYNSLAM_DATA does not name the data.
/// @param folder  rgb or depth
[[nodiscard]] inline std::vector<std::filesystem::path> recorded_files(const std::string& folder) {
  std::vector<std::filesystem::path> files;
  const char* data = std::getenv("DYNSLAM_DATA");
  if (data == nullptr) return files;
  const auto path = std::filesystem::path(data) / "tum/rgbd_dataset_freiburg1_xyz_first200" / folder;
  if (!std::filesystem::is_directory(path)) return files;
  for (const auto& entry : std::filesystem::directory_iterator(path)) {
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  }
  std::ranges::sort(files);
  return files;
}

}  // namespace dynslam::bench
