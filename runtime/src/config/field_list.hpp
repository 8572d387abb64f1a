// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "dynslam/runtime/config/options_file.hpp"

/// The table of fields. For each struct of options there is one function list(FieldList&, STRUCT&) with one
/// call per field. `package.config_fields` compares them with the structs' definitions: a field is listed
/// under its own name, or named in a comment `// left out: NAME: reason` within the function.
namespace dynslam::runtime::config {

[[nodiscard]] constexpr ConfigRange between(double low, double high) {
  return {.low = low, .high = high};
}
[[nodiscard]] constexpr ConfigRange above(double low) {
  return {.low = low, .above = true};
}
/// Whole numbers that nothing else limits: far from where sums of them would overflow.
[[nodiscard]] constexpr ConfigRange from(double low) {
  return between(low, 1e6);
}
inline constexpr ConfigRange kAny{}, kShare = between(0, 1), kPositive = above(0), kNotNegative{.low = 0},
                                     kCosine = between(-1, 1), kCount = from(0), kHamming = between(0, 256);

/// The names of the user fields: what a user sets for camera, network, modes, map, speed and output, and every
/// field with an option of the command line. All other fields are tuning fields.
[[nodiscard]] std::span<const std::string_view> user_field_names();

/// Its functions are not inline: there are hundreds of calls.
class FieldList {
 public:
  /// Adds a field of the table at hand, of a type that ConfigValue has as a pointer.
  template <class T>
  void operator()(std::string_view key, T& value, std::string_view unit, std::string_view meaning,
                  const ConfigRange& range = kAny);
  void operator()(std::string_view key, std::span<double> values, std::string_view unit,
                  std::string_view meaning, const ConfigRange& range);
  void operator()(std::string_view key, const ConfigChoice& choice, std::string_view meaning);
  /// What follows belongs to this table.
  void section(std::string_view name) { table_ = name; }
  /// Adds the fields of a struct as a table within the one at hand.
  template <class T>
  void table(std::string_view key, T& options) {
    const std::size_t outer = enter(key);
    list(*this, options);
    table_.resize(outer);
  }
  [[nodiscard]] ConfigFields take() { return std::move(fields_); }

 private:
  /// @return the length of the outer table's name
  std::size_t enter(std::string_view key);
  void add(std::string_view key, ConfigValue value, std::string_view unit, std::string_view meaning,
           const ConfigRange& range);

  std::string table_;
  ConfigFields fields_;
};

/// A choice of an enumeration with its functions of names.
template <class E, class Parse, class Name>
ConfigChoice choice(E& value, std::initializer_list<E> all, Parse parse, Name name) {
  ConfigChoice result{&value,
                      {},
                      [&value, name] { return std::string(name(value)); },
                      [&value, parse](std::string_view word) { value = *parse(word); }};
  for (const E one : all) result.names.emplace_back(name(one));
  return result;
}

void list(FieldList& f, TrackerOptions& o);
void list(FieldList& f, FeatureOptions& o);
void list(FieldList& f, PoseTrackingOptions<double>& o);
void list(FieldList& f, ImageAlignmentOptions<double>& o);
void list(FieldList& f, MotionSegmenterOptions<double>& o);
void list(FieldList& f, MaskArbitrationOptions<double>& o);
void list(FieldList& f, LocalMatchOptions<double>& o);
void list(FieldList& f, MatchedPoseOptions<double>& o);
void list(FieldList& f, PointMakerOptions<double>& o);
void list(FieldList& f, KeyframeOptions<double>& o);
void list(FieldList& f, CoverageOptions<double>& o);
void list(FieldList& f, LocalBundleOptions& o);
void list(FieldList& f, LoopOptions& o);
void list(FieldList& f, PlaceOptions& o);
void list(FieldList& f, SemanticMapperOptions& o);
void list(FieldList& f, SegmentationStageOptions& o);
void list(FieldList& f, LiveOptions& o);
void list(FieldList& f, SmoothingOptions& o);
void list(FieldList& f, TrajectoryOptions& o);
void list(FieldList& f, NewMapOptions& o);
void list(FieldList& f, RunOptions& o);

template <class S>
void list(FieldList& f, DepthNoise<S>& o) {
  f("base", o.base, "m", "standard deviation of the depth at 0 m", kPositive);
  f("quad", o.quad, "1/m", "growth of the standard deviation with the square of the depth", kNotNegative);
  f("linear", o.linear, "", "growth of the standard deviation with the depth", kNotNegative);
}

}  // namespace dynslam::runtime::config
