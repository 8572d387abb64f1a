// SPDX-License-Identifier: BSD-3-Clause
#include "run_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <iostream>

namespace dynslam::app {

namespace rt = dynslam::runtime;

void report_problems(const rt::RunSummary& s, const std::filesystem::path& out, const std::string& prefix) {
  if (s.problems.empty()) return;
  constexpr std::size_t kShown = 2;
  std::string text = fmt::format("dynslam: warning: {}{} broken and {} lost of {} frames: ", prefix, s.broken,
                                 s.lost, s.frames);
  for (std::size_t i = 0; i < std::min(kShown, s.problems.size()); ++i)
    text += (i > 0 ? "; " : "") + s.problems[i];
  if (s.problems.size() > kShown) {
    text += fmt::format("; and {} more, see {}", s.problems.size() - kShown, (out / "summary.json").string());
  }
  std::cerr << text << '\n';
}

std::string separate_report(const rt::RunSummary& summary) {
  std::string text;
  for (const rt::SeparateTrajectory& map : summary.separate) {
    text += fmt::format(
        "{} of the lost frames have poses in a map of their own, whose place was never recognised: "
        "trajectory_map{}.txt\n",
        map.poses.size(), map.map);
  }
  return text;
}

std::string mask_report(const rt::RunOptions& options, const rt::RunSummary& summary) {
  std::string text;
  const bool files = !options.masks.empty();
  if (!summary.masks_from.empty() && (files || options.verbose))
    text = fmt::format("{}: {}\n", files ? "masks" : "network", summary.masks_from);
  if (rt::uses_semantic(options.dynamics) && !summary.live && summary.masked == 0 && summary.tracked > 0)
    text += fmt::format("no a-priori mask marks anything dynamic in any of {} frames\n", summary.frames);
  return text;
}

std::string map_report(const rt::RunOptions& options, const rt::RunSummary& summary) {
  if (summary.nothing_mapped)
    return "map: no voxel is occupied: no keyframe has depth in range outside of the masks\n";
  if (!options.map || rt::uses_semantic(options.dynamics)) return {};
  return options.dynamics == rt::DynamicsMode::none
             ? "map: nothing is masked (--dynamics none), so people and things are part of it, whether they "
               "move or not\n"
             : "map: without a network (--model) or masks, people and things that never move during the run "
               "are part of it\n";
}

std::string live_report(const rt::RunSummary& summary) {
  if (!summary.live) return {};
  const rt::LiveStatistics& s = *summary.live;
  return fmt::format(
      "live: {} of {} frames dropped; latency median {:.1f}, 95 % {:.1f}, max {:.1f} ms. What is dropped "
      "depends "
      "on the machine: another run has other results\n",
      s.dropped, s.pushed, 1000 * s.latency_median, 1000 * s.latency_p95, 1000 * s.latency_max);
}

}  // namespace dynslam::app
