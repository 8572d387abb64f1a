// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <fstream>
#include <iomanip>

#include "dynslam/runtime/io/tum_reader.hpp"

namespace dynslam::test {

/// A rendered sequence played back and forth into an existing folder: `frames` of them at 30 a second, as
/// links.
inline void replay(const std::filesystem::path& sequence, const std::filesystem::path& folder, int frames) {
  const runtime::Sequence once = runtime::load_sequence(sequence);
  const int n = static_cast<int>(once.frames.size());
  for (const char* name : {"rgb", "depth", "camera.txt"})
    std::filesystem::create_symlink(sequence / name, folder / name);
  std::ofstream rgb(folder / "rgb.txt"), depth(folder / "depth.txt");
  for (int k = 0; k < frames; ++k) {
    const int i = k % (2 * n - 2);
    const runtime::FrameRecord& record = once.frames[static_cast<std::size_t>(i < n ? i : 2 * n - 2 - i)];
    const double t = 1 + k / 30.0;
    rgb << std::fixed << std::setprecision(6) << t << ' ' << record.rgb.string() << '\n';
    depth << std::fixed << std::setprecision(6) << t << ' ' << record.depth.string() << '\n';
  }
}

}  // namespace dynslam::test
