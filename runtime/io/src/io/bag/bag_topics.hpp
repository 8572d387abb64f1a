// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <string>

#include "dynslam/runtime/io/camera.hpp"
#include "io/bag/bag_survey.hpp"

namespace dynslam::runtime::bag {

struct ChosenTopics {
  const ImageTopic *colour = nullptr, *depth = nullptr;  ///< of the survey
};

/// The two topics of a sequence.
/// @param topics  "COLOUR,DEPTH" by the user; empty: the only ones there are. Of several, one in colour goes
///                before grey ones, 16UC1 and 32FC1 before mono16, an image before the same compressed, and
///                one in the other image's frame (registered depth) before those in frames of their own.
/// @throws InputError where that leaves several or none; it lists the topics. UsageError for topics that
///         the bag has not
[[nodiscard]] ChosenTopics choose_topics(const BagSurvey& survey, const std::string& topics);

/// The camera of a topic's images, and the topic that it is from: camera_info beside the images.
struct InfoCamera {
  std::optional<CameraConfig> camera;  ///< empty: no such topic, or it says that nobody calibrated
  std::string topic;
};
/// @throws InputError (topic): a camera that is none, or one that changes
[[nodiscard]] InfoCamera camera_beside(const BagSurvey& survey, const ImageTopic& images);

}  // namespace dynslam::runtime::bag
