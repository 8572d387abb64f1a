// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <filesystem>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/camera_facts.hpp"

namespace dynslam::runtime {
namespace {

CameraConfig make(std::string name, const std::array<double, 4>& k, const std::array<double, 5>& d,
                  double units, double depth_time_offset = 0) {
  // PrimeSense's design, which all of these are (Kinect, Xtion PRO LIVE): docs/cameras.md, Rolling shutter.
  constexpr double kReadout = 0.024;
  CameraConfig camera;
  camera.name = std::move(name);
  camera.model = PinholeBrownConrady<double>(Pinhole<double>(k[0], k[1], k[2], k[3]),
                                             BrownConrady<double>(d[0], d[1], d[2], d[3], d[4]));
  camera.depth_units_per_metre = units;
  camera.depth_time_offset = depth_time_offset;
  camera.readout_time = kReadout;
  return camera;
}

/// Whether a text is YAML or XML: its first line with content names a key before a colon, not before an =.
bool is_calibration(const std::string& text) {
  std::istringstream in(text);
  LineReader reader(in);
  if (!reader.next()) return false;
  const std::string_view line = trim(reader.line());
  if (line.starts_with('<') || line.starts_with('%') || line.starts_with("---")) return true;
  const auto colon = line.find(':');
  return colon != std::string_view::npos && colon < line.find('=');
}

CameraFacts facts_of(std::istream& in, const std::string& file) {
  std::string text;
  for (std::array<char, 4096> part{}; in.read(part.data(), part.size()) || in.gcount() > 0;)
    text.append(part.data(), static_cast<std::size_t>(in.gcount()));
  if (in.bad()) throw InputError(file, 0, "cannot be read");
  text = as_utf8(std::move(text), file);
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first != std::string::npos && text[first] == '{') return parse_json_camera(text, file);
  return is_calibration(text) ? parse_calibration(text, file) : parse_own_camera(text, file);
}

bool is_name(const std::string& name_or_file) {
  return name_or_file == "fr1" || name_or_file == "fr2" || name_or_file == "fr3" || name_or_file == "bonn";
}

/// Where the presets of well-known sensors lie: beside the program, built or installed, wherever its prefix
/// is.
std::filesystem::path preset_folder() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  return program.parent_path().parent_path() / "share" / "dynslam" / "cameras";
}

/// The names of the presets, in order, each with a comma and a space behind it.
std::string preset_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator at(preset_folder(), error), end; !error && at != end;
       at.increment(error)) {
    std::string name = at->path().stem().string();
    if (at->path().extension() == ".txt" && !is_name(name)) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end());
  std::string all;
  for (const std::string& name : names) all += name + ", ";
  return all;
}

/// A file as it is named, else the preset of that name. @throws UsageError where there is neither
std::string file_of(const std::string& name_or_file) {
  const auto is_file = [](const std::filesystem::path& path) {
    std::error_code error;
    return std::filesystem::exists(path, error) && !std::filesystem::is_directory(path, error);
  };
  if (is_file(name_or_file)) return name_or_file;
  if (name_or_file.find('/') == std::string::npos) {
    const std::filesystem::path preset = preset_folder() / (name_or_file + ".txt");
    if (is_file(preset)) return preset.string();
  }
  throw UsageError(fmt::format("unknown camera '{}': neither fr1, fr2, fr3, bonn, {}nor a readable file",
                               name_or_file, preset_names()));
}

}  // namespace

CameraConfig parse_camera(std::istream& in, const std::string& file) {
  return camera_of_facts(facts_of(in, file), file);
}

CameraConfig load_camera(const std::string& name_or_file, double usual_units) {
  CameraConfig camera = load_camera(name_or_file);
  if (is_name(name_or_file)) {
    camera.depth_units_per_metre = usual_units;
    return camera;
  }
  const std::string file = file_of(name_or_file);
  std::istringstream in(read_text(file));
  CameraFacts facts = facts_of(in, file);
  facts.numbers.try_emplace("depth_units_per_metre", usual_units);
  return camera_of_facts(facts, file);
}

std::filesystem::path camera_file_in(const std::filesystem::path& folder) {
  std::filesystem::path found;
  for (const char* name : {"camera.txt", "camera.yaml", "camera.yml", "camera.xml"}) {
    if (!std::filesystem::exists(folder / name)) continue;
    if (!found.empty())
      throw InputError(folder.string(), 0,
                       fmt::format("has {} and {}: keep one of them", found.filename().string(), name));
    found = folder / name;
  }
  return found;
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
  const std::string file = file_of(name_or_file);
  std::istringstream in(read_text(file));
  return parse_camera(in, file);
}

}  // namespace dynslam::runtime
