// SPDX-License-Identifier: BSD-3-Clause
// Cameras, in the ways that formats write them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/camera_facts.hpp"
#include "io/formats/format.hpp"

namespace dynslam::runtime::formats {
namespace {

using nlohmann::json;

json parse_json(const std::string& text, const std::string& file) {
  try {
    return json::parse(text);
  } catch (const json::parse_error& error) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(error.byte, text.size()));
    throw InputError(file, static_cast<std::size_t>(std::count(text.begin(), end, '\n')) + 1,
                     "is not JSON here");
  } catch (const json::out_of_range&) {  // a number beyond double's
    throw InputError(file, 0, "holds a number that is too large");
  }
}

double number(const json& object, const char* key, const std::string& file) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number())
    throw InputError(file, 0, fmt::format("the number \"{}\" is missing", key));
  return found->get<double>();
}

PinholeNumbers replica_numbers(const json& root, const std::string& file) {
  const auto camera = root.is_object() ? root.find("camera") : root.end();
  if (!root.is_object() || camera == root.end() || !camera->is_object())
    throw InputError(file, 0, "the object \"camera\" is missing");
  const auto get = [&](const char* key) { return number(*camera, key, file); };
  return {get("w"), get("h"), get("fx"), get("fy"), get("cx"), get("cy"), get("scale")};
}

PinholeNumbers open3d_numbers(const json& root, const std::string& file) {
  if (!root.is_object()) throw InputError(file, 0, "is no JSON object");
  const auto matrix = root.find("intrinsic_matrix");
  if (matrix == root.end() || !matrix->is_array() || matrix->size() != 9 ||
      !std::all_of(matrix->begin(), matrix->end(), [](const json& x) { return x.is_number(); }))
    throw InputError(file, 0, "\"intrinsic_matrix\" with 9 numbers is missing");
  const auto at = [&](std::size_t row, std::size_t column) {
    return (*matrix)[3 * column + row].get<double>();
  };
  if (at(2, 0) != 0 || at(2, 1) != 0)  // written by rows: fx and cx change places with zeros
    throw InputError(file, 0, "\"intrinsic_matrix\" is not [fx, 0, 0, 0, fy, 0, cx, cy, 1]");
  constexpr double kMillimetres = 1000;
  return {number(root, "width", file),
          number(root, "height", file),
          at(0, 0),
          at(1, 1),
          at(0, 2),
          at(1, 2),
          kMillimetres};
}

}  // namespace

CameraConfig pinhole_camera(const std::string& name, const PinholeNumbers& n, const std::string& file) {
  std::istringstream in(
      fmt::format("width = {}\nheight = {}\nfx = {}\nfy = {}\ncx = {}\ncy = {}\ndepth_units_per_metre = {}\n",
                  n.width, n.height, n.fx, n.fy, n.cx, n.cy, n.units));
  CameraConfig camera = parse_camera(in, file);
  camera.name = name;
  return camera;
}

CameraConfig parse_replica_camera(const std::string& text, const std::string& file) {
  return pinhole_camera("replica", replica_numbers(parse_json(text, file), file), file);
}

CameraConfig parse_open3d_camera(const std::string& text, const std::string& file) {
  return pinhole_camera("open3d", open3d_numbers(parse_json(text, file), file), file);
}

CameraConfig parse_eth3d_camera(std::istream& in, cv::Size size, const std::string& file) {
  LineReader reader(in);
  if (!reader.next()) throw InputError(file, 0, "is empty; expected fx fy cx cy");
  const auto words = split_words(reader.line());
  if (words.size() != 4)
    throw InputError(file, reader.number(),
                     fmt::format("expected 4 numbers (fx fy cx cy), found {} words", words.size()));
  std::array<double, 4> k{};
  for (std::size_t i = 0; i < k.size(); ++i) {
    const auto value = parse_number(words[i]);
    if (!value) throw InputError(file, reader.number(), fmt::format("'{}' is not a finite number", words[i]));
    k[i] = *value;
  }
  if (reader.next()) throw InputError(file, reader.number(), "expected the end after fx fy cx cy");
  if (in.bad()) throw InputError(file, 0, "cannot be read");
  constexpr double kUnits = 5000;
  return pinhole_camera("eth3d", {double(size.width), double(size.height), k[0], k[1], k[2], k[3], kUnits},
                        file);
}

bool is_eth3d_camera(const std::string& name_or_file) {
  constexpr std::uintmax_t kLongest = 4096;
  std::error_code error;
  const auto size = std::filesystem::file_size(name_or_file, error);
  if (error || size > kLongest || !std::filesystem::is_regular_file(name_or_file, error)) return false;
  std::istringstream in(read_text(name_or_file, kLongest));
  LineReader reader(in);
  if (!reader.next()) return false;
  const auto words = split_words(reader.line());
  return words.size() == 4 && std::all_of(words.begin(), words.end(), [](std::string_view word) {
           return parse_number(word).has_value();
         });
}

}  // namespace dynslam::runtime::formats

namespace dynslam::runtime {

CameraFacts parse_json_camera(const std::string& text, const std::string& file) {
  const auto root = formats::parse_json(text, file);
  const bool nice = root.is_object() && root.contains("camera");
  const formats::PinholeNumbers n =
      nice ? formats::replica_numbers(root, file) : formats::open3d_numbers(root, file);
  CameraFacts facts;
  facts.numbers = {{"width", n.width}, {"height", n.height}, {"fx", n.fx},
                   {"fy", n.fy},       {"cx", n.cx},         {"cy", n.cy}};
  for (const auto& [key, value] : root.items()) {
    if (is_camera_number(key) && value.is_number()) facts.numbers[key] = value.get<double>();
  }
  facts.numbers.try_emplace("depth_units_per_metre", n.units);
  return facts;
}

}  // namespace dynslam::runtime
