// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

// What reads bytes that others wrote. Each target hands its input to one parser or decoder and lets pass what
// that is documented to throw; whatever else happens is a finding. tests/runtime/fuzz_replay_test.cpp replays
// damaged seeds and the corpus, scripts/fuzz.sh searches with libFuzzer.
namespace dynslam::fuzz {

using Bytes = std::span<const std::uint8_t>;

struct Target {
  std::string_view name;
  void (*run)(Bytes);
  std::vector<std::string> (*seeds)();  ///< inputs that are right, to begin with
};

/// All of them.
[[nodiscard]] std::vector<Target> targets();

// One group per file.
void add_text_targets(std::vector<Target>& targets);
void add_bag_targets(std::vector<Target>& targets);
void add_map_targets(std::vector<Target>& targets);
void add_network_targets(std::vector<Target>& targets);
void add_report_targets(std::vector<Target>& targets);

[[nodiscard]] inline std::string text_of(Bytes bytes) {
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

}  // namespace dynslam::fuzz
