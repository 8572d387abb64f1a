// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/bag/recording.hpp"
#include "io/bag/ros_images.hpp"
#include "io/bag/ros_messages.hpp"

namespace dynslam::runtime::bag {

/// The time of a header, in nanoseconds.
[[nodiscard]] std::uint64_t nanoseconds(const Header& header);
/// Seconds with nine digits behind the point, or with six where `micro`.
[[nodiscard]] std::string stamp_text(std::uint64_t nanoseconds, bool micro);

struct Shot {
  std::uint64_t stamp = 0;  ///< of the message's header [ns]
  Place place;
};

/// A topic of images, by its first one.
struct ImageTopic {
  std::string name, type, encoding, frame;
  Serialisation serialisation = Serialisation::ros1;
  bool compressed = false;
  ImageKind kind = ImageKind::not_understood;
  std::vector<Shot> shots;  ///< by time
};

struct InfoTopic {
  CameraInfoMessage info;  ///< the first one
  bool changes = false;    ///< another one says something else
};

/// Poses of one frame in another: an edge of the tree of transforms, or a topic of poses.
struct PoseTrack {
  std::string topic, parent, child;                          ///< child: empty where the messages do not say
  bool transforms = false;                                   ///< of tf; else a topic of its own
  std::vector<std::pair<std::uint64_t, SE3<double>>> poses;  ///< by time [ns]
};

/// What a bag has for a sequence. Of images their places alone.
struct BagSurvey {
  std::string file;
  std::vector<ImageTopic> images;  ///< by name
  std::map<std::string, InfoTopic> infos;
  std::vector<PoseTrack> tracks;
  std::string pose_fault;            ///< why poses cannot be trusted; empty: they can
  std::size_t poses_left_out = 0;    ///< messages that hold none
  std::string first_left_out;        ///< place and reason of the first
  std::set<std::string> not_read;    ///< encodings of messages that are not read
  std::vector<std::string> missing;  ///< of the recording, a line each
};

/// Goes through the whole bag once. @throws InputError
[[nodiscard]] BagSurvey survey(const Recording& bag);

}  // namespace dynslam::runtime::bag
