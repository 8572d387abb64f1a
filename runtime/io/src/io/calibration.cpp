// SPDX-License-Identifier: BSD-3-Clause
// Cameras as ROS (sensor_msgs/CameraInfo) and OpenCV (FileStorage) write them.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <span>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/calibration_text.hpp"
#include "io/camera_facts.hpp"

namespace dynslam::runtime {
namespace {

/// ROS publishes depth in millimetres (REP 118).
constexpr double kRosUnits = 1000;

class CalibrationReader {
 public:
  CalibrationReader(const std::vector<NamedWords>& nodes, const std::string& file)
      : nodes_(nodes), file_(file) {}

  CameraFacts read() {
    own_keys();
    orb_slam();
    facts_.numbers.try_emplace("depth_units_per_metre", kRosUnits);
    size("width", {"image_width", "width"});
    size("height", {"image_height", "height"});
    matrix();
    distortion();
    region();
    return std::move(facts_);
  }

 private:
  [[noreturn]] void fail(std::size_t line, const std::string& reason) const {
    throw InputError(file_, line, reason);
  }

  /// The one node with words among these names; null: there is none.
  const NamedWords* find(std::initializer_list<std::string_view> names) const {
    const NamedWords* found = nullptr;
    for (const NamedWords& node : nodes_) {
      if (node.words.empty() || std::find(names.begin(), names.end(), node.name) == names.end()) continue;
      if (found != nullptr)
        fail(node.line,
             fmt::format("'{}' once more, after '{}' in line {}", node.name, found->name, found->line));
      found = &node;
    }
    return found;
  }

  std::vector<double> numbers(const NamedWords& node) const {
    std::vector<double> values;
    for (const std::string& word : node.words) {
      const auto value = parse_number(word);
      if (!value) fail(node.line, fmt::format("'{}' of {} is not a finite number", word, node.name));
      values.push_back(*value);
    }
    return values;
  }
  double number(const NamedWords& node) const {
    if (node.words.size() != 1) fail(node.line, fmt::format("{} is not one number", node.name));
    return numbers(node).front();
  }

  /// What these files do not know stands in them under dynslam's names.
  void own_keys() {
    for (const NamedWords& node : nodes_) {
      const bool word = is_camera_word(node.name) || node.name == "camera_name";
      if (word && node.words.size() == 1)
        facts_.words[node.name == "camera_name" ? "name" : node.name] = node.words[0];
      if (word) continue;
      if (is_camera_number(node.name)) {
        if (!facts_.numbers.emplace(node.name, number(node)).second)
          fail(node.line, fmt::format("'{}' once more", node.name));
      } else if (node.name.starts_with("depth_")) {
        fail(node.line, fmt::format("unknown key '{}'", node.name));
      }
    }
  }

  /// ORB-SLAM's settings: Camera.fx or Camera1.fx, ..., and DepthMapFactor.
  void orb_slam() {
    bool any = false;
    for (const NamedWords& node : nodes_) {
      const bool factor = node.name == "DepthMapFactor" || node.name == "RGBD.DepthMapFactor";
      const auto dot = node.name.find('.');
      const std::string around = node.name.substr(0, dot);
      const std::string key = factor                     ? "depth_units_per_metre"
                              : dot == std::string::npos ? ""
                                                         : node.name.substr(dot + 1);
      const bool of_camera = around == "Camera" || around == "Camera1";
      if (node.words.empty() || !(factor || (of_camera && is_camera_number(key)))) continue;
      const double value = number(node);
      constexpr double kNone = 1e-5;  // as ORB-SLAM: depth in metres
      if (!facts_.numbers.emplace(key, factor && value < kNone ? 1 : value).second)
        fail(node.line, fmt::format("'{}' once more", node.name));
      any = any || of_camera;
    }
    if (!any || facts_.words.contains("model")) return;
    const NamedWords* type = find({"Camera.type"});
    const std::string name = type != nullptr ? type->words[0] : "PinHole";
    const bool fisheye = name == "KannalaBrandt8", lens = name == "PinHole" || name == "Pinhole";
    if (!fisheye && !lens && name != "Rectified")
      fail(type->line, fmt::format("Camera.type '{}' is none of PinHole, KannalaBrandt8, Rectified", name));
    facts_.words["model"] = fisheye                         ? "kannala_brandt"
                            : !lens                         ? "pinhole"
                            : facts_.numbers.contains("k4") ? "rational"
                                                            : "brown_conrady";
  }

  void size(const char* side, std::initializer_list<std::string_view> names) {
    if (const NamedWords* node = find(names)) facts_.numbers[side] = number(*node);
  }

  void matrix() {
    const NamedWords* node =
        find({"camera_matrix.data", "camera_matrix", "cameraMatrix.data", "K.data", "K", "k"});
    if (node == nullptr && facts_.numbers.contains("fx")) return;  // under dynslam's names
    if (node == nullptr) throw InputError(file_, 0, "'camera_matrix' (or 'K') is missing");
    const auto m = numbers(*node);
    if (m.size() != 9) fail(node->line, fmt::format("{} has {} numbers, not 9", node->name, m.size()));
    if (m[1] != 0 || m[3] != 0 || m[6] != 0 || m[7] != 0 || m[8] != 1)
      fail(node->line, fmt::format("{} is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]", node->name));
    facts_.numbers["fx"] = m[0];
    facts_.numbers["cx"] = m[2];
    facts_.numbers["fy"] = m[4];
    facts_.numbers["cy"] = m[5];
  }

  /// The model in dynslam's words; empty: the file names none.
  std::string model() const {
    constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kRos{
        {{"plumb_bob", "brown_conrady"},
         {"rational_polynomial", "rational"},
         {"equidistant", "kannala_brandt"},
         {"fisheye", "kannala_brandt"},
         {"kannala_brandt4", "kannala_brandt"},
         {"none", "pinhole"}}};
    if (const auto named = facts_.words.find("model"); named != facts_.words.end()) return named->second;
    if (const NamedWords* node = find({"distortion_model"})) {
      const auto known = std::find_if(kRos.begin(), kRos.end(),
                                      [&](const auto& pair) { return pair.first == node->words[0]; });
      if (known == kRos.end())
        fail(node->line, fmt::format("distortion_model '{}' is none of plumb_bob, rational_polynomial, "
                                     "equidistant, fisheye",
                                     node->words[0]));
      return std::string(known->second);
    }
    const NamedWords* fisheye = find({"fisheye_model"});
    return fisheye != nullptr && number(*fisheye) != 0 ? "kannala_brandt" : "";
  }

  void distortion() {
    const NamedWords* node = find({"distortion_coefficients.data", "distortion_coefficients",
                                   "dist_coeffs.data", "dist_coeffs", "distCoeffs.data", "D.data", "D", "d"});
    const auto d = node != nullptr ? numbers(*node) : std::vector<double>();
    std::string name = model();
    if (name.empty()) name = d.empty() ? "pinhole" : d.size() <= 5 ? "brown_conrady" : "rational";
    static constexpr std::array<std::string_view, 8> kOpenCv{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
    static constexpr std::array<std::string_view, 4> kFisheye{"k1", "k2", "k3", "k4"};
    const std::span<const std::string_view> order =
        name == "kannala_brandt"  ? std::span<const std::string_view>(kFisheye)
        : name == "brown_conrady" ? std::span<const std::string_view>(kOpenCv).first(5)
        : name == "pinhole"       ? std::span<const std::string_view>()
                                  : std::span<const std::string_view>(kOpenCv);
    facts_.words["model"] = name;
    for (std::size_t i = 0; i < d.size(); ++i) {
      if (i < order.size()) {
        facts_.numbers[std::string(order[i])] = d[i];
      } else if (d[i] != 0) {
        fail(node->line,
             fmt::format("{} has {} coefficients, {} takes {}", node->name, d.size(), name, order.size()));
      }
    }
  }

  /// Images must be what was calibrated.
  void region() const {
    for (const std::string_view name : {"binning_x", "binning_y", "roi.x_offset", "roi.y_offset"}) {
      const NamedWords* node = find({name});
      const double allowed = name.starts_with("b") ? 1 : 0;
      if (node != nullptr && number(*node) > allowed)
        fail(node->line,
             fmt::format("{} is {}: write the camera of the images as they are, without binning or "
                         "region of interest",
                         name, node->words[0]));
    }
  }

  const std::vector<NamedWords>& nodes_;
  const std::string& file_;
  CameraFacts facts_;
};

}  // namespace

CameraFacts facts_of_calibration(const std::vector<NamedWords>& nodes, const std::string& file) {
  return CalibrationReader(nodes, file).read();
}

CameraFacts parse_calibration(const std::string& text, const std::string& file) {
  const auto first = text.find_first_not_of(" \t\r\n");
  const bool xml = first != std::string::npos && text[first] == '<';
  const auto nodes = xml ? parse_xml(text, file) : parse_yaml(text, file);
  return facts_of_calibration(nodes, file);
}

}  // namespace dynslam::runtime
