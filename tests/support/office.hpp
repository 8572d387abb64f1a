// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

#include "dynslam/runtime/io/camera.hpp"
#include "run_fixture.hpp"

namespace dynslam::test {

/// 40 frames of an empty office and the map of the first 20 of them, made once per program.
struct Office {
  TemporaryFolder folder;
  std::filesystem::path sequence = folder.path / "sequence", map = folder.path / "map";
  Office() {
    runtime::SynthOptions synth;
    synth.frames = 40;
    synth.scenario = "empty";
    synth.path = "xyz";
    runtime::synthesize(synth, sequence);
    (void)runtime::run_sequence(options("first", 20, {}, map), kNeverStop);
  }
  [[nodiscard]] runtime::RunOptions options(const char* out, std::size_t frames,
                                            const std::filesystem::path& load,
                                            const std::filesystem::path& save) const {
    runtime::RunOptions o;
    o.sequence = sequence;
    o.out = folder.path / out;
    o.dynamics = runtime::DynamicsMode::geometric;
    o.max_frames = frames;
    o.load_map = load;
    o.save_map = save;
    return o;
  }
  [[nodiscard]] runtime::CameraConfig camera() const {
    return runtime::load_camera((sequence / "camera.txt").string());
  }
};

inline const Office& office() {
  static const Office made;
  return made;
}

}  // namespace dynslam::test
