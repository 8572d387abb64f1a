// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/bag_survey.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <tuple>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime::bag {
namespace {

/// By their bits: what is not a number is the same as itself.
template <class Numbers>
bool same_bits(const Numbers& a, const Numbers& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
}

bool same(const CameraInfoMessage& a, const CameraInfoMessage& b) {
  const auto rest = [](const CameraInfoMessage& i) {
    return std::tie(i.height, i.width, i.distortion_model, i.binning_x, i.binning_y, i.roi_x, i.roi_y);
  };
  return rest(a) == rest(b) && same_bits(a.d, b.d) && same_bits(a.k, b.k) && same_bits(a.p, b.p);
}

class Surveyor {
 public:
  explicit Surveyor(const Recording& bag) : bag_(bag) { result_.file = bag.name(); }

  BagSurvey survey() {
    result_.missing =
        bag_.scan([&](const Connection& connection, const Place& place) { look(connection, place); });
    for (auto& [name, topic] : images_) {
      sort_shots(topic);
      result_.images.push_back(std::move(topic));
    }
    for (auto& [key, track] : tracks_) {
      std::stable_sort(track.poses.begin(), track.poses.end(),
                       [](const auto& a, const auto& b) { return a.first < b.first; });
      result_.tracks.push_back(std::move(track));
    }
    return std::move(result_);
  }

 private:
  std::string name_of(const Connection& connection, const Place& place) const {
    return bag_.where(place, connection.topic);
  }

  void look(const Connection& connection, const Place& place) {
    const auto how = serialisation_of(connection.encoding);
    if (!how) {
      result_.not_read.insert(connection.encoding);
    } else if (connection.type == kImage || connection.type == kCompressedImage) {
      add_image(connection, place, *how);
    } else if (connection.type == kCameraInfo) {
      add_info(connection, place, *how);
    } else if (holds_poses(connection.type) && result_.pose_fault.empty()) {
      add_poses(connection, place, *how);
    }
  }

  void add_image(const Connection& connection, const Place& place, Serialisation how) {
    const bool compressed = connection.type == kCompressedImage;
    const auto bytes = bag_.read(place, kHead);
    const ImageMessage head = parse_image_head(bytes, compressed, name_of(connection, place), how);
    ImageTopic& topic = images_[connection.topic];
    if (topic.name.empty()) {
      topic.name = connection.topic;
      topic.type = connection.type;
      topic.encoding = head.encoding;
      topic.frame = head.header.frame;
      topic.serialisation = how;
      topic.compressed = compressed;
      topic.kind = kind_of(head.encoding, compressed);
    } else if (topic.type != connection.type || topic.serialisation != how) {
      throw InputError(name_of(connection, place), 0,
                       fmt::format("is of type {} ({}), others of the topic of {}", connection.type,
                                   connection.encoding, topic.type));
    }
    topic.shots.push_back({nanoseconds(head.header), place});
  }

  void add_info(const Connection& connection, const Place& place, Serialisation how) {
    const auto bytes = bag_.read(place);
    CameraInfoMessage info = parse_camera_info(bytes, name_of(connection, place), how);
    const auto [found, is_new] = result_.infos.try_emplace(connection.topic);
    if (is_new) {
      found->second.info = std::move(info);
    } else if (!same(found->second.info, info)) {
      found->second.changes = true;
    }
  }

  void add_poses(const Connection& connection, const Place& place, Serialisation how) {
    const bool transforms = holds_transforms(connection.type);
    std::vector<PoseMessage> poses;
    try {
      poses = parse_poses(bag_.read(place), connection.type, name_of(connection, place), how);
    } catch (const InputError& error) {  // a marker that was lost, say; the images do not need it
      if (result_.poses_left_out++ == 0) result_.first_left_out = error.what();
      return;
    }
    for (const PoseMessage& pose : poses) {
      PoseTrack& track = tracks_[{transforms ? "" : connection.topic, pose.header.frame, pose.child}];
      if (track.poses.empty()) {
        track.topic = connection.topic;
        track.parent = pose.header.frame;
        track.child = pose.child;
        track.transforms = transforms;
      }
      track.poses.emplace_back(nanoseconds(pose.header), pose.T_parent_child);
      constexpr std::size_t kMost = 2000000;  // 150 MB
      if (++poses_ <= kMost) continue;
      result_.pose_fault = fmt::format("{}: holds more than {} poses", bag_.name(), kMost);
      return;
    }
  }

  /// By the time in the header: messages of one topic may be recorded in another order.
  void sort_shots(ImageTopic& topic) const {
    std::stable_sort(topic.shots.begin(), topic.shots.end(),
                     [](const Shot& a, const Shot& b) { return a.stamp < b.stamp; });
  }

  const Recording& bag_;
  BagSurvey result_;
  std::map<std::string, ImageTopic> images_;
  std::map<std::tuple<std::string, std::string, std::string>, PoseTrack> tracks_;
  std::size_t poses_ = 0;
};

}  // namespace

std::uint64_t nanoseconds(const Header& header) {
  return std::uint64_t(header.seconds) * 1000000000U + header.nanoseconds;
}

std::string stamp_text(std::uint64_t nanoseconds, bool micro) {
  const std::uint64_t seconds = nanoseconds / 1000000000U, rest = nanoseconds % 1000000000U;
  return micro ? fmt::format("{}.{:06}", seconds, rest / 1000) : fmt::format("{}.{:09}", seconds, rest);
}

BagSurvey survey(const Recording& bag) {
  return Surveyor(bag).survey();
}

}  // namespace dynslam::runtime::bag
