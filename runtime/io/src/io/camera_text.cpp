// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <string>

#include "dynslam/runtime/io/convert.hpp"
#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

std::string lens_text(const AnyCamera<double>& model) {
  std::string text;
  const auto line = [&](const char* key, double value) {
    if (value != 0) text += fmt::format("{} = {}\n", key, value);
  };
  if (const KannalaBrandt<double>* fisheye = model.kannala_brandt()) {
    const auto k = fisheye->coefficients();
    text = "model = kannala_brandt\n";
    line("k1", k(0)), line("k2", k(1)), line("k3", k(2)), line("k4", k(3));
    return text;
  }
  const auto k = model.brown_conrady()->coefficients();
  if (k(5) != 0 || k(6) != 0 || k(7) != 0) text = "model = rational\n";
  line("k1", k(0)), line("k2", k(1)), line("p1", k(2)), line("p2", k(3));
  line("k3", k(4)), line("k4", k(5)), line("k5", k(6)), line("k6", k(7));
  return text;
}

std::string noise_text(const DepthNoise<double>& noise) {
  if (noise.linear != 0)
    return fmt::format("depth_noise = time_of_flight\ndepth_noise_base = {}\ndepth_noise_linear = {}\n",
                       noise.base, noise.linear);
  return fmt::format("depth_noise = structured_light\ndepth_noise_base = {}\ndepth_noise_quad = {}\n",
                     noise.base, noise.quad);
}

}  // namespace

std::string camera_text(const CameraConfig& camera) {
  const Pinhole<double>& pinhole = camera.model.pinhole();
  std::string text;
  if (!camera.name.empty()) text += fmt::format("name = {}\n", printable(camera.name));
  text += fmt::format("width = {}\nheight = {}\nfx = {}\nfy = {}\ncx = {}\ncy = {}\n", camera.width,
                      camera.height, pinhole.fx(), pinhole.fy(), pinhole.cx(), pinhole.cy());
  text += lens_text(camera.model);
  text += fmt::format("depth_units_per_metre = {}\n", camera.depth_units_per_metre);
  if (camera.invalid_depth != 0) text += fmt::format("invalid_depth = {}\n", camera.invalid_depth);
  if (camera.depth_time_offset != 0)
    text += fmt::format("depth_time_offset = {}\n", camera.depth_time_offset);
  if (camera.readout_time != 0) text += fmt::format("readout_time = {}\n", camera.readout_time);
  if (camera.depth_noise) text += noise_text(*camera.depth_noise);
  return text;
}

}  // namespace dynslam::runtime
