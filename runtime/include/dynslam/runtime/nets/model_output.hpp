// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "dynslam/runtime/nets/inference_engine.hpp"

namespace dynslam::runtime {

/// What the values of a network's only channel are.
enum class ModelOutput {
  automatic,    ///< found out by the values of the first frames
  labels,       ///< the number of a class
  logits,       ///< of one class: it is there above 0
  probability,  ///< of one class: it is there above 0.5
  mask          ///< 0 to 255: the class is there from 128 on
};
/// A kind of values by its name; empty: there is none of that name.
[[nodiscard]] std::optional<ModelOutput> parse_model_output(std::string_view name);
/// Name of a kind of values.
[[nodiscard]] std::string_view to_string(ModelOutput output);

/// Finds out what the values of a network's only channel are, and keeps watch that all frames agree.
///
/// Negative values: logits. Whole numbers below the number of classes: labels. Within 0 to 1 or 0 to 255,
/// most of them near either end: a probability or a mask. Anything else (depth, a distance, an angle) is
/// refused. A frame of zeros alone says nothing; the next one decides.
class ChannelReader {
 public:
  /// @param asked    automatic, or what the user says it is
  /// @param classes  names of the model, 0 where it has none
  /// @param model    its file, for messages
  ChannelReader(ModelOutput asked, std::size_t classes, std::string model);

  /// Looks at the values of one frame.
  /// @throws InputError where they cannot be known, or contradict those before
  void look(const Tensor& channel);

  /// automatic: nothing but zeros so far.
  [[nodiscard]] ModelOutput reading() const { return reading_; }
  /// Value above which the class is there; empty: the values are labels.
  [[nodiscard]] std::optional<float> threshold() const;
  /// What was found, for the user: "probabilities (0 to 0.98): there above 0.5".
  [[nodiscard]] std::string describe() const;

 private:
  struct Range;
  [[nodiscard]] ModelOutput find_out(const Range& range, const std::string& output) const;
  void check(const Range& range, const std::string& output) const;

  ModelOutput reading_;
  bool asked_ = false, looked_ = false;
  std::size_t classes_;
  std::string model_;
  float low_ = 0, high_ = 0;  // of the frame that decided
};

/// Whether the channels of 1 x C x h x w are no shares of classes: values from 0 to 1 that do not add up to
/// one, as heat maps of key points have them.
[[nodiscard]] bool are_heatmaps(const Tensor& map);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
