// SPDX-License-Identifier: BSD-3-Clause
// Of one run: times of its stages, its graph of keyframes, what its masks are worth.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <opencv2/imgcodecs.hpp>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "report/payload.hpp"
#include "run/evidence_log.hpp"

namespace dynslam::runtime::reporting {
namespace {

constexpr std::size_t kRows = 3000, kNodes = 3000, kEdges = 6000;

/// p50 and p95 of a column as RunTimings has them.
json percentiles(const RunTable& table, std::size_t column) {
  std::vector<double> values;
  for (const auto& row : table.rows) {
    if (std::isfinite(row[column])) values.push_back(row[column]);
  }
  if (values.empty()) return {nullptr, nullptr};
  std::sort(values.begin(), values.end());
  const auto last = static_cast<double>(values.size() - 1);
  return {number(values[values.size() / 2], 3),
          number(values[static_cast<std::size_t>(last * 0.95 + 0.5)], 3)};
}

Eigen::Vector3d moved(const json& align, const std::array<double, 3>& p) {
  Eigen::Vector3d result;
  for (int i = 0; i < 3; ++i) {
    const auto at = [&](int column) { return align[static_cast<std::size_t>(4 * column + i)].get<double>(); };
    result(i) = at(0) * p[0] + at(1) * p[1] + at(2) * p[2] + at(3);
  }
  return result;
}

}  // namespace

json times_payload(const Source& source, const RunFolder& run, std::vector<std::string>& thinned) {
  const RunTable& table = run.times;
  const std::size_t stride = stride_for(table.rows.size(), kRows);
  if (stride > 1) thinned.push_back(fmt::format("{}: the timeline shows every {}th frame", run.name, stride));
  std::map<std::string, double> time;
  for (const FrameRecord& frame : source.sequence.frames) time.emplace(frame.stamp, frame.t_rgb - source.t0);
  json t = json::array(), cells = json::array(), stages = json::object();
  for (std::size_t i = 0; i < table.rows.size(); i += stride) {
    const auto at = time.find(table.stamps[i]);
    if (at == time.end())
      throw InputError(
          (run.folder / "timings.csv").string(), 0,
          fmt::format("has a frame {} that is not in {}", table.stamps[i], source.sequence.root.string()));
    t.push_back(number(at->second, 4));
  }
  for (std::size_t c = 0; c < table.columns.size(); ++c) {
    json column = json::array();
    for (std::size_t i = 0; i < table.rows.size(); i += stride) column.push_back(number(table.rows[i][c], 2));
    cells.push_back(std::move(column));
    stages[table.columns[c]] = percentiles(table, c);
  }
  return {{"columns", table.columns}, {"t", t}, {"cells", cells}, {"stages", stages}};
}

json graph_payload(const Source& source, const RunFolder& run, const json& align,
                   std::vector<std::string>& thinned) {
  std::vector<GraphNode> nodes;
  std::vector<GraphEdge> edges, loops;
  if (run.evidence) {
    nodes = run.evidence->keyframes;
    edges = run.evidence->edges;
    loops = run.evidence->loops;
  } else {
    for (const auto& pose : run.keyframes) {
      const Eigen::Vector3d& p = pose.T_w_c.translation();
      nodes.push_back({static_cast<int>(nodes.size()), pose.t, {p.x(), p.y(), p.z()}});
    }
  }
  const std::size_t all_nodes = nodes.size(), all_edges = edges.size();
  if (nodes.size() > kNodes) nodes.resize(kNodes);
  std::map<int, std::size_t> place;
  json list = json::array();
  for (const GraphNode& node : nodes) {
    place.emplace(node.id, place.size());
    const Eigen::Vector3d p = moved(align, node.p_w);
    list.push_back(
        {node.id, number(node.t - source.t0, 4), number(p.x(), 4), number(p.y(), 4), number(p.z(), 4)});
  }
  std::stable_sort(edges.begin(), edges.end(),
                   [](const GraphEdge& a, const GraphEdge& b) { return a.points > b.points; });
  if (edges.size() > kEdges) edges.resize(kEdges);
  if (all_nodes > nodes.size() || all_edges > edges.size())
    thinned.push_back(fmt::format("{}: the graph has {} of {} keyframes and the strongest {} of {} edges",
                                  run.name, nodes.size(), all_nodes, edges.size(), all_edges));
  const auto ends = [&](const std::vector<GraphEdge>& of) {
    json result = json::array();
    for (const GraphEdge& edge : of) {
      if (place.contains(edge.a) && place.contains(edge.b))
        result.push_back({place[edge.a], place[edge.b], edge.points});
    }
    return result;
  };
  return {{"nodes", list},
          {"edges", ends(edges)},
          {"loops", ends(loops)},
          {"complete", run.evidence.has_value()}};
}

json mask_payload(const Source& source, const RunFolder& run) {
  const auto folder = source.sequence.root / "dynamic_mask";
  if (!run.evidence || run.options.dynamics == DynamicsMode::none || !std::filesystem::is_directory(folder))
    return nullptr;
  std::size_t both = 0, either = 0, in_truth = 0, found = 0, frames = 0;
  for (const FrameRecord& frame : source.sequence.frames) {
    const auto file = folder / (frame.stamp + ".png");
    const cv::Mat masks = run.evidence->masks(frame.stamp);
    if (masks.empty() || !std::filesystem::exists(file)) continue;
    const cv::Mat truth = read_image(file, cv::IMREAD_GRAYSCALE) != 0;
    if (truth.size() != masks.size())
      throw InputError(file.string(), 0, "is not of the size of the run's images");
    const cv::Mat fused = pixels_with(masks, kFusedBit);
    const auto count = [](const cv::Mat& m) { return static_cast<std::size_t>(cv::countNonZero(m)); };
    both += count(fused & truth);
    either += count(fused | truth);
    in_truth += count(truth);
    found += count(fused);
    ++frames;
  }
  if (frames == 0) return nullptr;
  const auto ratio = [](std::size_t a, std::size_t b) {
    return number(b > 0 ? static_cast<double>(a) / static_cast<double>(b) : 0.0, 4);
  };
  return {{"frames", frames},
          {"iou", ratio(both, either)},
          {"recall", ratio(both, in_truth)},
          {"precision", ratio(both, found)}};
}

}  // namespace dynslam::runtime::reporting
