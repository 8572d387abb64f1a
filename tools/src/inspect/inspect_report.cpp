// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "dynslam/runtime/inspect/inspect.hpp"

namespace dynslam::runtime {
namespace {

std::string size_text(cv::Size size) {
  return size.empty() ? "unknown" : fmt::format("{}x{}", size.width, size.height);
}

std::string_view lens_text(const AnyCamera<double>& model) {
  if (model.is_ideal()) return "no distortion";
  if (model.kannala_brandt() != nullptr) return "Kannala-Brandt fisheye";
  return model.brown_conrady()->is_rational() ? "rational distortion" : "Brown-Conrady distortion";
}

std::string camera_text(const CameraConfig& c, const std::string& source) {
  const auto& k = c.model.pinhole();
  return fmt::format(
      "{} ({}): {}x{}, fx {:.2f} fy {:.2f} cx {:.2f} cy {:.2f}, {}, {} depth units per metre{}", c.name,
      source, c.width, c.height, k.fx(), k.fy(), k.cx(), k.cy(), lens_text(c.model), c.depth_units_per_metre,
      c.invalid_depth > 0 ? fmt::format(", {} means none", c.invalid_depth) : "");
}

std::string truth_text(const SequenceReport& r) {
  const TruthReport& t = r.truth;
  if (t.poses == 0) return r.sequence.truth_missing.empty() ? "none" : "none: " + r.sequence.truth_missing;
  std::string text = fmt::format("{}: {} poses, for {:.0f} % of the pairs", r.sequence.truth_file.string(),
                                 t.poses, 100 * t.covered);
  if (t.motions > 0)
    text += fmt::format("; {} of {} motions measured in the images are its own", t.agreeing, t.motions);
  if (t.scale) text += fmt::format(", with depth times {:.3f}", *t.scale);
  return text;
}

std::string edges_text(const EdgeReport& e) {
  if (!e.measured) return "too few to tell";
  return fmt::format(
      "of depth fit those of colour when moved by {:.1f} px right and {:.1f} px down, and come "
      "{:.2f} frames late",
      e.shift_x, e.shift_y, e.late);
}

}  // namespace

std::string to_text(const SequenceReport& r) {
  std::string text;
  const auto row = [&](std::string_view name, const std::string& value) {
    text += fmt::format("{:<9} {}\n", name, value);
  };
  const StampReport& s = r.stamps;
  row("sequence", r.sequence.root.string());
  row("format", r.sequence.format);
  if (!r.sequence.topics.empty()) row("topics", r.sequence.topics);
  row("frames", fmt::format("{} pairs of {} colour and {} depth images, {:.2f} s", s.pairs, s.colour_images,
                            s.depth_images, s.duration));
  if (r.sequence.has_stamps) {
    row("rates", fmt::format("colour {:.2f} Hz, depth {:.2f} Hz", s.colour_rate, s.depth_rate));
    row("stamps", fmt::format("depth {:.1f} ms after colour (median), 95 % within {:.1f} ms",
                              1000 * s.delay_median, 1000 * s.delay_p95));
  } else {
    row("rates", fmt::format("no time stamps; frame numbers at {:.2f} Hz", s.colour_rate));
  }
  row("images", fmt::format("colour {}, depth {}", size_text(r.colour_size), size_text(r.depth_size)));
  row("camera", r.camera ? camera_text(*r.camera, r.camera_source) : "not known");
  if (r.camera && r.sampled > 0) {
    const auto& q = r.depth_quantiles;
    row("depth",
        fmt::format("{:.0f} % of the pixels; 5, 25, 50, 75, 95 % within {:.2f}, {:.2f}, {:.2f}, {:.2f}, "
                    "{:.2f} m",
                    100 * r.depth_valid, q[0], q[1], q[2], q[3], q[4]));
  }
  row("edges", edges_text(r.edges));
  row("truth", truth_text(r));
  if (r.warnings.empty()) row("warnings", "none");
  for (std::size_t i = 0; i < r.warnings.size(); ++i) row(i == 0 ? "warnings" : "", r.warnings[i]);
  row("run", r.command.empty() ? "not before its frames can be decoded" : r.command);
  return text;
}

nlohmann::json to_json(const SequenceReport& r) {
  const auto size = [](cv::Size s) { return nlohmann::json::array({s.width, s.height}); };
  const StampReport& s = r.stamps;
  nlohmann::json j{
      {"sequence", r.sequence.root.string()},
      {"format", r.sequence.format},
      {"topics", r.sequence.topics},
      {"has_stamps", r.sequence.has_stamps},
      {"pairs", s.pairs},
      {"colour_images", s.colour_images},
      {"depth_images", s.depth_images},
      {"duration_s", s.duration},
      {"colour_hz", s.colour_rate},
      {"depth_hz", s.depth_rate},
      {"delay_s", {{"median", s.delay_median}, {"spread", s.delay_spread}, {"p95", s.delay_p95}}},
      {"colour_size", size(r.colour_size)},
      {"depth_size", size(r.depth_size)},
      {"frames_sampled", r.sampled},
      {"warnings", r.warnings},
      {"command", r.command}};
  j["gaps"] = nlohmann::json::array();
  for (const auto& gap : s.gaps)
    j["gaps"].push_back({{"t_s", gap.t}, {"length_s", gap.length}, {"missing", gap.missing}});
  if (r.camera) {
    const auto& k = r.camera->model.pinhole();
    j["camera"] = {{"name", r.camera->name},
                   {"source", r.camera_source},
                   {"size", size({r.camera->width, r.camera->height})},
                   {"fx", k.fx()},
                   {"fy", k.fy()},
                   {"cx", k.cx()},
                   {"cy", k.cy()},
                   {"depth_units_per_metre", r.camera->depth_units_per_metre},
                   {"invalid_depth", r.camera->invalid_depth}};
    j["depth"] = {{"valid", r.depth_valid}, {"quantiles_m", r.depth_quantiles}};
  }
  if (r.edges.measured)
    j["edges"] = {{"shift_px", {r.edges.shift_x, r.edges.shift_y}},
                  {"shift_gain", r.edges.shift_gain},
                  {"lag_frames", r.edges.lag},
                  {"late_frames", r.edges.late},
                  {"lag_gain", r.edges.lag_gain}};
  if (r.truth.poses > 0) {
    j["truth"] = {{"from", r.sequence.truth_file.string()},
                  {"poses", r.truth.poses},
                  {"covered", r.truth.covered},
                  {"motions", r.truth.motions},
                  {"agreeing", r.truth.agreeing}};
    if (r.truth.scale) j["truth"]["scale"] = *r.truth.scale;
  }
  return j;
}

}  // namespace dynslam::runtime
