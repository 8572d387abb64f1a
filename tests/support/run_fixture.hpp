// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "dynslam/runtime/run/run_sequence.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "tum_fixture.hpp"

// What tests of whole runs share: a rendered sequence, the options to run it, its files.
namespace dynslam::test {

inline const std::atomic<bool> kNeverStop{false};

/// People walking along xyz, rendered.
struct WalkingSequence : TemporaryFolder {
  explicit WalkingSequence(int frames) {
    runtime::SynthOptions options;
    options.frames = frames;
    options.path = "xyz";
    options.seed = 2;
    runtime::synthesize(options, path);
  }
};

/// A run over a rendered sequence with its true labels as masks.
inline runtime::RunOptions options_for(const std::filesystem::path& sequence,
                                       const std::filesystem::path& out, runtime::DynamicsMode mode) {
  runtime::RunOptions o;
  o.sequence = sequence;
  o.out = out;
  o.dynamics = mode;
  o.masks = sequence / "label";
  o.save_masks = true;
  return o;
}

/// The whole content of a file.
inline std::string bytes(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(in), {});
}

}  // namespace dynslam::test
