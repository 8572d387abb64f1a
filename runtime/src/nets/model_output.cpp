// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/model_output.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {

constexpr float kMaskTop = 255;         // of grey values
constexpr float kRounding = 1e-3F;      // by which half precision leaves 0 to 1
constexpr double kDecidedShare = 0.75;  // of the values of a segmentation that are near either end
constexpr float kNear = 0.1F;           // of the range, from either end
constexpr std::size_t kMostClasses = 255;

constexpr std::array kOutputs{ModelOutput::automatic, ModelOutput::labels, ModelOutput::logits,
                              ModelOutput::probability, ModelOutput::mask};

}  // namespace

std::optional<ModelOutput> parse_model_output(std::string_view name) {
  for (const ModelOutput output : kOutputs)
    if (name == to_string(output)) return output;
  return std::nullopt;
}

std::string_view to_string(ModelOutput output) {
  constexpr std::array<std::string_view, 5> kNames{"auto", "labels", "logits", "probability", "mask"};
  return kNames[static_cast<std::size_t>(output)];
}

/// Of the values of a frame.
struct ChannelReader::Range {
  explicit Range(const Tensor& channel) {
    if (channel.data.empty()) return;
    const auto [low_at, high_at] = std::minmax_element(channel.data.begin(), channel.data.end());
    low = *low_at;
    high = *high_at;
    whole = channel.whole || std::all_of(channel.data.begin(), channel.data.end(),
                                         [](float x) { return x == std::nearbyint(x); });
    const float top = high <= 1 + kRounding ? 1 : kMaskTop;
    const auto near = std::count_if(channel.data.begin(), channel.data.end(),
                                    [top](float x) { return x <= kNear * top || x >= (1 - kNear) * top; });
    decided = static_cast<double>(near) >= kDecidedShare * static_cast<double>(channel.data.size());
  }
  float low = 0, high = 0;
  bool whole = true;
  bool decided = true;  // most values are near 0 or the top
};

ChannelReader::ChannelReader(ModelOutput asked, std::size_t classes, std::string model)
    : reading_(asked), asked_(asked != ModelOutput::automatic), classes_(classes), model_(std::move(model)) {}

void ChannelReader::look(const Tensor& channel) {
  looked_ = true;
  const Range range(channel);
  if (reading_ == ModelOutput::automatic) {
    reading_ = find_out(range, channel.name);
    low_ = range.low;
    high_ = range.high;
  }
  check(range, channel.name);
}

ModelOutput ChannelReader::find_out(const Range& r, const std::string& output) const {
  if (r.low == 0 && r.high == 0) return ModelOutput::automatic;
  const bool one_class = classes_ <= 2;  // with or without its background
  if (one_class && r.low < -kRounding) return ModelOutput::logits;
  if (r.whole && r.low >= 0 && r.high < static_cast<float>(std::min(classes_, kMostClasses)))
    return ModelOutput::labels;
  if (one_class && r.decided && r.high <= 1 + kRounding) return ModelOutput::probability;
  if (one_class && r.decided && r.high > kMaskTop / 2 && r.high <= kMaskTop + kRounding)
    return ModelOutput::mask;
  std::string seems = "which is neither a label map nor a mask (perhaps depth)";
  if (r.whole && classes_ == 0)
    seems = "labels without names: put one name per line into a file beside it, FILE.names";
  if (r.whole && classes_ > 2) seems = fmt::format("which are no labels of its {} classes", classes_);
  throw InputError(model_, 0,
                   fmt::format("output '{}' has {} from {:.4g} to {:.4g}, {}; --model-output labels, logits, "
                               "probability or mask says what it is",
                               output, r.whole ? "whole numbers" : "values", r.low, r.high, seems));
}

void ChannelReader::check(const Range& r, const std::string& output) const {
  const auto contradict = [&](const std::string& expected) {
    throw InputError(
        model_, 0,
        fmt::format(
            "output '{}' has values from {:.4g} to {:.4g}, not {}{}", output, r.low, r.high, expected,
            asked_ ? " as --model-output says" : " as in the frames before; --model-output says what it is"));
  };
  switch (reading_) {
    case ModelOutput::labels: {
      const std::size_t most = std::min(std::max<std::size_t>(classes_, 2), kMostClasses);
      if (!r.whole || r.low < 0 || r.high >= static_cast<float>(most))
        contradict(fmt::format("labels of {} classes", most));
      return;
    }
    case ModelOutput::probability:
      if (r.low < -kRounding || r.high > 1 + kRounding) contradict("probabilities");
      return;
    case ModelOutput::mask:
      if (r.low < -kRounding || r.high > kMaskTop + kRounding) contradict("grey values of a mask");
      return;
    case ModelOutput::logits:
    case ModelOutput::automatic:
      return;
  }
}

std::optional<float> ChannelReader::threshold() const {
  switch (reading_) {
    case ModelOutput::logits:
      return 0.0F;
    case ModelOutput::probability:
      return 0.5F;
    case ModelOutput::mask:
      return 127.5F;
    case ModelOutput::labels:
    case ModelOutput::automatic:
      return std::nullopt;
  }
  return std::nullopt;
}

std::string ChannelReader::describe() const {
  if (reading_ == ModelOutput::automatic) return looked_ ? "zeros alone" : "whose values were not needed";
  std::string text(to_string(reading_));
  if (const auto above = threshold()) text += fmt::format(", the class where above {:g}", *above);
  return text + (asked_ ? " (--model-output)" : fmt::format(" (values from {:.4g} to {:.4g})", low_, high_));
}

bool are_heatmaps(const Tensor& map) {
  const auto channels = static_cast<std::size_t>(map.dim(1));
  const std::size_t pixels = channels > 0 ? map.data.size() / channels : 0;
  if (pixels == 0 || std::any_of(map.data.begin(), map.data.end(),
                                 [](float x) { return x < -kRounding || x > 1 + kRounding; }))
    return false;
  constexpr float kOfOne = 0.05F;
  std::size_t shares = 0;
  for (std::size_t p = 0; p < pixels; ++p) {
    float sum = 0;
    for (std::size_t c = 0; c < channels; ++c) sum += map.data[c * pixels + p];
    shares += std::abs(sum - 1) < kOfOne ? 1 : 0;
  }
  return 2 * shares < pixels;
}

}  // namespace dynslam::runtime
