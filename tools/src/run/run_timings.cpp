// SPDX-License-Identifier: BSD-3-Clause
#include "run/run_timings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <ostream>
#include <utility>

#include "dynslam/runtime/io/atomic_file.hpp"

namespace dynslam::runtime {

void RunTimings::write(const std::filesystem::path& path) const {
  AtomicFile file(path);
  std::ostream& out = file.stream();
  out << "timestamp";
  for (const auto name : kStageNames) out << ',' << name;
  const bool live = !rows.empty() && rows.front().latency_ms;
  out << ",network,mask_keeper,frame," << (live ? "latency,mask_age_s," : "") << "rss_mb,keyframes,points\n";
  for (const Row& row : rows) {
    out << row.stamp;
    for (const double ms : row.times) out << fmt::format(",{:.3f}", ms);
    out << fmt::format(",{:.3f},{:.3f},{:.3f}", row.network_ms, row.keeper_ms, row.frame_ms);
    if (live)
      out << fmt::format(",{:.3f},{}", row.latency_ms.value_or(0),
                         row.mask_age ? fmt::format("{:.3f}", *row.mask_age) : std::string());
    out << fmt::format(",{:.1f},{},{}\n", row.rss_mb, row.map.keyframes, row.map.points);
  }
  file.commit();
}

std::map<std::string, StageStatistics> RunTimings::statistics() const {
  std::map<std::string, StageStatistics> result;
  if (rows.empty()) return result;
  std::vector<double> values(rows.size());
  const auto add = [&](std::string name, auto&& value) {
    for (std::size_t i = 0; i < rows.size(); ++i) values[i] = value(rows[i]);
    std::sort(values.begin(), values.end());
    const auto last = static_cast<double>(values.size() - 1);
    result[std::move(name)] = {values[values.size() / 2],
                               values[static_cast<std::size_t>(last * 0.95 + 0.5)]};
  };
  for (std::size_t s = 0; s < kStageNames.size(); ++s) {
    add(std::string(kStageNames[s]), [s](const Row& row) { return row.times[s]; });
  }
  add("network", [](const Row& row) { return row.network_ms; });
  add("mask_keeper", [](const Row& row) { return row.keeper_ms; });
  add("frame", [](const Row& row) { return row.frame_ms; });
  return result;
}

}  // namespace dynslam::runtime
