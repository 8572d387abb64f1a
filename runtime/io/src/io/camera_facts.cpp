// SPDX-License-Identifier: BSD-3-Clause
#include "io/camera_facts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <sstream>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/text_lines.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::array<std::string_view, 6> kNeeded{"width", "height", "fx", "fy", "cx", "cy"};
constexpr std::array<std::string_view, 8> kCoefficients{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
constexpr std::array<std::string_view, 4> kImages{"depth_units_per_metre", "invalid_depth",
                                                  "depth_time_offset", "readout_time"};
constexpr std::array<std::string_view, 6> kNoise{"depth_noise_base", "depth_noise_linear", "depth_noise_quad",
                                                 "baseline",         "disparity_noise",    "stereo_focal"};
constexpr std::array<std::string_view, 3> kWords{"name", "model", "depth_noise"};

template <class Names>
bool is_among(std::string_view key, const Names& names) {
  return std::find(names.begin(), names.end(), key) != names.end();
}

/// A model of lenses or of noise, and the numbers that it knows.
struct NamedModel {
  std::string_view name;
  std::array<std::string_view, 8> numbers;
};
constexpr std::array<NamedModel, 4> kLenses{{{"pinhole", {}},
                                             {"brown_conrady", {"k1", "k2", "p1", "p2", "k3"}},
                                             {"rational", kCoefficients},
                                             {"kannala_brandt", {"k1", "k2", "k3", "k4"}}}};
constexpr std::array<NamedModel, 3> kNoises{
    {{"structured_light", {"depth_noise_base", "depth_noise_quad"}},
     {"stereo", {"baseline", "disparity_noise", "stereo_focal", "depth_noise_base"}},
     {"time_of_flight", {"depth_noise_base", "depth_noise_linear"}}}};

/// The facts of one file with what is said where they are wrong.
class FactReader {
 public:
  FactReader(const CameraFacts& facts, const std::string& file) : facts_(facts), file_(file) {}

  [[noreturn]] void fail(const std::string& reason) const { throw InputError(file_, 0, reason); }
  [[nodiscard]] bool has(std::string_view key) const { return facts_.numbers.contains(key); }
  [[nodiscard]] double get(std::string_view key) const {
    const auto found = facts_.numbers.find(key);
    if (found == facts_.numbers.end()) fail(fmt::format("'{}' is missing", key));
    return found->second;
  }
  [[nodiscard]] double get(std::string_view key, double otherwise) const {
    return has(key) ? get(key) : otherwise;
  }
  [[nodiscard]] int whole(std::string_view key, double otherwise) const {
    const double value = get(key, otherwise);
    if (!(value >= 0 && value <= 65535) || value != static_cast<int>(value))
      fail(fmt::format("{} must be a whole number from 0 to 65535", key));
    return static_cast<int>(value);
  }
  [[nodiscard]] std::string word(std::string_view key, std::string_view otherwise) const {
    const auto found = facts_.words.find(key);
    return found == facts_.words.end() ? std::string(otherwise) : found->second;
  }

  /// The model of that name; each of `numbers` that is given must be one of its own.
  template <class Models, class Numbers>
  [[nodiscard]] std::string_view choose(std::string_view what, std::string_view name, const Models& models,
                                        const Numbers& numbers, std::string_view hint) const {
    const auto model =
        std::find_if(models.begin(), models.end(), [&](const auto& m) { return m.name == name; });
    if (model == models.end()) {
      std::string names;
      for (const auto& m : models) names += fmt::format("{}{}", names.empty() ? "" : ", ", m.name);
      fail(fmt::format("{} '{}' is none of {}", what, name, names));
    }
    for (const std::string_view key : numbers) {
      if (has(key) && !is_among(key, model->numbers))
        fail(fmt::format("'{}' is not a number of {} {}{}", key, what, name, hint));
    }
    return model->name;
  }

 private:
  const CameraFacts& facts_;
  const std::string& file_;
};

/// Beyond, pixels at the rim are metres wide: a map of them fills the memory.
constexpr double kWidest = 20;  // tangent of 87 degrees

AnyCamera<double> model_of(const FactReader& facts, int width, int height) {
  const double fx = facts.get("fx"), fy = facts.get("fy"), cx = facts.get("cx"), cy = facts.get("cy");
  if (!(fx > 0 && fy > 0)) facts.fail("fx and fy must be positive");
  constexpr double kLongest = 1000;  // widths of the image: a twentieth of a degree is seen
  if (fx > kLongest * width || fy > kLongest * width)
    facts.fail("fx and fy must be at most a thousand widths of the image");
  const double across = std::max(std::abs(cx), std::abs(width - cx)) / fx;
  const double down = std::max(std::abs(cy), std::abs(height - cy)) / fy;
  if (!(std::max(across, down) <= kWidest))
    facts.fail("fx, fy, cx and cy let a pixel look more than 87 degrees aside");
  const bool named = !facts.word("model", "").empty();
  const auto lens = facts.choose("model", facts.word("model", "brown_conrady"), kLenses, kCoefficients,
                                 named ? "" : ": say model = rational or model = kannala_brandt");
  const auto k = [&](std::string_view key) { return facts.get(key, 0); };
  if (lens == "kannala_brandt") {
    constexpr double kFieldEnds = 80 * std::numbers::pi / 180;  // depth along the axis says little beyond
    return KannalaBrandt<double>(fx, fy, cx, cy, {k("k1"), k("k2"), k("k3"), k("k4")}, kFieldEnds);
  }
  return PinholeBrownConrady<double>(
      Pinhole<double>(fx, fy, cx, cy),
      BrownConrady<double>(k("k1"), k("k2"), k("p1"), k("p2"), k("k3"), k("k4"), k("k5"), k("k6")));
}

/// Coefficients of another model or order mostly leave an image without rays, or with wild ones.
void check_lens(const CameraConfig& camera, const FactReader& facts) {
  if (camera.model.is_ideal()) return;
  constexpr int kColumns = 32, kRows = 24;
  int seen = 0;
  for (int j = 0; j <= kRows; ++j) {
    for (int i = 0; i <= kColumns; ++i) {
      const Eigen::Vector2d x((camera.width - 1.0) * i / kColumns, (camera.height - 1.0) * j / kRows);
      const auto p = camera.model.unproject(x, 1.0);
      if (!p) continue;
      ++seen;
      if (!(p->head<2>().cwiseAbs().maxCoeff() <= kWidest))
        facts.fail("the distortion lets a pixel look more than 87 degrees aside");
    }
  }
  constexpr int kAll = (kColumns + 1) * (kRows + 1);
  if (4 * seen < kAll)
    facts.fail(
        fmt::format("the distortion leaves all but {} % of the image without a viewing ray: wrong "
                    "coefficients, their order, or the model",
                    100 * seen / kAll));
}

std::optional<DepthNoise<double>> noise_of(const FactReader& facts) {
  const std::string name = facts.word("depth_noise", "");
  if (name.empty()) {
    for (const std::string_view key : kNoise) {
      if (facts.has(key))
        facts.fail(fmt::format("'{}' needs depth_noise = structured_light, stereo or time_of_flight", key));
    }
    return std::nullopt;
  }
  const auto model = facts.choose("depth_noise", name, kNoises, kNoise, "");
  for (const std::string_view key : kNoise) {
    if (facts.has(key) && !(facts.get(key) >= 0)) facts.fail(fmt::format("{} must not be negative", key));
  }
  const DepthNoise<double> usual;
  const double base = facts.get("depth_noise_base", usual.base);
  if (!(base > 0)) facts.fail("depth_noise_base must be positive");
  if (model == "structured_light")
    return DepthNoise<double>::structured_light(base, facts.get("depth_noise_quad", usual.quad));
  if (model == "time_of_flight")
    return DepthNoise<double>::time_of_flight(base, facts.get("depth_noise_linear"));
  const double baseline = facts.get("baseline"), disparity = facts.get("disparity_noise");
  if (!(baseline >= 1e-3 && baseline <= 100)) facts.fail("baseline must be from 0.001 to 100 m");
  const double focal = facts.get("stereo_focal", facts.get("fx"));
  if (!(focal > 0)) facts.fail("stereo_focal must be positive");
  return DepthNoise<double>::stereo(baseline, focal, disparity, base);
}

}  // namespace

bool is_camera_number(std::string_view key) {
  return is_among(key, kNeeded) || is_among(key, kCoefficients) || is_among(key, kImages) ||
         is_among(key, kNoise);
}

bool is_camera_word(std::string_view key) {
  return is_among(key, kWords);
}

CameraFacts parse_own_camera(const std::string& text, const std::string& file) {
  CameraFacts facts;
  std::istringstream in(text);
  LineReader reader(in);
  while (reader.next()) {
    const std::string_view whole = reader.line(), line = whole.substr(0, whole.find('#'));
    const auto equals = line.find('=');
    if (equals == std::string_view::npos) throw InputError(file, reader.number(), "expected 'key = value'");
    const std::string key(trim(line.substr(0, equals)));
    const std::string_view value = unquoted(trim(line.substr(equals + 1)));
    if (facts.words.contains(key) || facts.numbers.contains(key))
      throw InputError(file, reader.number(), fmt::format("'{}' once more", key));
    if (is_camera_word(key)) {
      facts.words[key] = value;
      continue;
    }
    if (!is_camera_number(key)) throw InputError(file, reader.number(), fmt::format("unknown key '{}'", key));
    const auto number = parse_number(value);
    if (!number) throw InputError(file, reader.number(), fmt::format("'{}' is not a finite number", value));
    facts.numbers[key] = *number;
  }
  return facts;
}

CameraConfig camera_of_facts(const CameraFacts& given, const std::string& file) {
  const FactReader facts(given, file);
  for (const std::string_view key : kNeeded) (void)facts.get(key);
  CameraConfig camera;
  camera.name = facts.word("name", std::filesystem::path(file).stem().string());
  for (const std::string_view side : {"width", "height"}) {
    const double size = facts.get(side);
    if (!(size >= 64 && size <= 8192) || size != static_cast<int>(size))
      facts.fail("width and height must be whole numbers from 64 to 8192");
    (side == "width" ? camera.width : camera.height) = static_cast<int>(size);
  }
  camera.model = model_of(facts, camera.width, camera.height);
  check_lens(camera, facts);
  camera.depth_units_per_metre = facts.get("depth_units_per_metre", camera.depth_units_per_metre);
  if (!(camera.depth_units_per_metre > 0)) facts.fail("depth_units_per_metre must be positive");
  camera.invalid_depth = facts.whole("invalid_depth", 0);
  camera.depth_time_offset = facts.get("depth_time_offset", 0);
  if (!(std::abs(camera.depth_time_offset) <= 1)) facts.fail("depth_time_offset must be from -1 to 1 s");
  camera.readout_time = facts.get("readout_time", 0);
  if (!(std::abs(camera.readout_time) <= 0.2)) facts.fail("readout_time must be from -0.2 to 0.2 s");
  camera.depth_noise = noise_of(facts);
  return camera;
}

}  // namespace dynslam::runtime
