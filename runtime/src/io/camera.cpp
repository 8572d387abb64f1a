// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>
#include <string_view>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

CameraConfig make(std::string name, const std::array<double, 4>& k, const std::array<double, 5>& d,
                  double units, double depth_time_offset = 0) {
  CameraConfig camera;
  camera.name = std::move(name);
  camera.model = PinholeBrownConrady<double>(Pinhole<double>(k[0], k[1], k[2], k[3]),
                                             BrownConrady<double>(d[0], d[1], d[2], d[3], d[4]));
  camera.depth_units_per_metre = units;
  camera.depth_time_offset = depth_time_offset;
  return camera;
}

std::string_view trim(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r\"");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\"") - first + 1);
}

}  // namespace

CameraConfig parse_camera(std::istream& in, const std::string& file) {
  std::map<std::string, double, std::less<>> value{{"k1", 0},
                                                   {"k2", 0},
                                                   {"p1", 0},
                                                   {"p2", 0},
                                                   {"k3", 0},
                                                   {"depth_units_per_metre", 5000},
                                                   {"invalid_depth", 0},
                                                   {"depth_time_offset", 0}};
  std::string name = std::filesystem::path(file).stem().string();
  constexpr std::array<std::string_view, 14> keys{"width",
                                                  "height",
                                                  "fx",
                                                  "fy",
                                                  "cx",
                                                  "cy",
                                                  "k1",
                                                  "k2",
                                                  "p1",
                                                  "p2",
                                                  "k3",
                                                  "depth_units_per_metre",
                                                  "invalid_depth",
                                                  "depth_time_offset"};
  LineReader reader(in);
  while (reader.next()) {
    const std::string_view whole = reader.line(), line = whole.substr(0, whole.find('#'));
    const auto equals = line.find('=');
    if (equals == std::string_view::npos) throw InputError(file, reader.number(), "expected 'key = value'");
    const std::string_view key = trim(line.substr(0, equals)), text = trim(line.substr(equals + 1));
    if (key == "name") {
      name = text;
      continue;
    }
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      throw InputError(file, reader.number(), fmt::format("unknown key '{}'", key));
    }
    const auto number = parse_number(text);
    if (!number) throw InputError(file, reader.number(), fmt::format("'{}' is not a finite number", text));
    value[std::string(key)] = *number;
  }
  if (in.bad()) throw InputError(file, 0, "cannot be read");
  for (const auto key : keys) {
    if (!value.contains(key)) throw InputError(file, 0, fmt::format("'{}' is missing", key));
  }
  const double width = value["width"], height = value["height"];
  for (const double size : {width, height}) {
    if (!(size >= 64 && size <= 8192) || size != static_cast<int>(size))
      throw InputError(file, 0, "width and height must be whole numbers from 64 to 8192");
  }
  if (!(value["fx"] > 0 && value["fy"] > 0)) throw InputError(file, 0, "fx and fy must be positive");
  // Beyond, pixels at the rim are metres wide: a map of them fills the memory.
  constexpr double kWidest = 20;  // tangent of 87 degrees
  const double across = std::max(std::abs(value["cx"]), std::abs(width - value["cx"])) / value["fx"];
  const double down = std::max(std::abs(value["cy"]), std::abs(height - value["cy"])) / value["fy"];
  if (!(std::max(across, down) <= kWidest))
    throw InputError(file, 0, "fx, fy, cx and cy let a pixel look more than 87 degrees aside");
  if (!(value["depth_units_per_metre"] > 0))
    throw InputError(file, 0, "depth_units_per_metre must be positive");
  const double invalid = value["invalid_depth"];
  if (!(invalid >= 0 && invalid <= 65535) || invalid != static_cast<int>(invalid))
    throw InputError(file, 0, "invalid_depth must be a whole number from 0 to 65535");
  const double late = value["depth_time_offset"];
  if (!(std::abs(late) <= 1)) throw InputError(file, 0, "depth_time_offset must be from -1 to 1 s");
  CameraConfig camera = make(name, {value["fx"], value["fy"], value["cx"], value["cy"]},
                             {value["k1"], value["k2"], value["p1"], value["p2"], value["k3"]},
                             value["depth_units_per_metre"], late);
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  camera.invalid_depth = static_cast<int>(invalid);
  return camera;
}

CameraConfig load_camera(const std::string& name_or_file) {
  // Calibrations published with the TUM RGB-D data set; the offsets of the depth images' stamps are those
  // with which static scenes stand still (docs/method.md, When depth was taken). None was measured of fr2.
  if (name_or_file == "fr1") {
    return make("fr1", {517.306, 516.469, 318.643, 255.314},
                {0.262383, -0.953104, -0.005358, 0.002628, 1.163314}, 5000, 0.018);
  }
  if (name_or_file == "fr2") {
    return make("fr2", {520.909, 521.007, 325.141, 249.702},
                {0.231222, -0.784899, -0.003257, -0.000105, 0.917205}, 5208);
  }
  if (name_or_file == "fr3") return make("fr3", {535.4, 539.2, 320.1, 247.6}, {0, 0, 0, 0, 0}, 5000, 0.012);
  // Published with the Bonn RGB-D Dynamic data set.
  if (name_or_file == "bonn") {
    return make("bonn", {542.822841, 542.576870, 315.593520, 237.756098},
                {0.039903, -0.099343, -0.000730, -0.000144, 0}, 5000);
  }
  if (name_or_file.empty())
    throw UsageError("the camera is not known from the sequence: give --camera fr1|fr2|fr3|bonn|FILE");
  std::error_code error;
  if (!std::filesystem::exists(name_or_file, error) || std::filesystem::is_directory(name_or_file, error)) {
    throw UsageError(
        fmt::format("unknown camera '{}': neither fr1, fr2, fr3, bonn nor a readable file", name_or_file));
  }
  std::istringstream in(read_file(name_or_file));
  return parse_camera(in, name_or_file);
}

}  // namespace dynslam::runtime
