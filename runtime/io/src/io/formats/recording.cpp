// SPDX-License-Identifier: BSD-3-Clause
// Recordings of ROS: topics of colour and depth images as a sequence.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_source.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/bag/bag_survey.hpp"
#include "io/bag/bag_topics.hpp"
#include "io/bag/bag_truth.hpp"
#include "io/bag/ros_images.hpp"
#include "io/formats/format.hpp"
#include "io/formats/recording.hpp"

namespace dynslam::runtime::formats {
namespace {

namespace fs = std::filesystem;

/// Images of two topics, decoded when they are asked for.
class RecordedImages : public ImageSource {
 public:
  RecordedImages(std::shared_ptr<const bag::Recording> file, const bag::ImageTopic& colour,
                 const bag::ImageTopic& depth)
      : file_(std::move(file)), topics_{colour, depth} {}

  [[nodiscard]] cv::Mat read(Kind kind, std::size_t number) const override {
    const Message m = message(kind, number);
    return kind == Kind::colour ? bag::decode_colour(m.image, m.compressed, m.name)
                                : bag::decode_depth(m.image, m.compressed, m.name);
  }
  [[nodiscard]] cv::Size size(Kind kind, std::size_t number) const override {
    const Message m = message(kind, number);
    return bag::size_of(m.image, m.compressed, m.name);
  }
  [[nodiscard]] std::vector<std::uint8_t> content(Kind kind, std::size_t number) const override {
    const Message m = message(kind, number);
    return {m.image.data.begin(), m.image.data.end()};
  }

 private:
  struct Message {
    std::string name;
    std::vector<std::uint8_t> bytes;
    bool compressed = false;
    bag::ImageMessage image;  // of `bytes`, which stay where they are when a vector is moved
  };
  [[nodiscard]] Message message(Kind kind, std::size_t number) const {
    const bag::ImageTopic& topic = topics_[kind == Kind::colour ? 0 : 1];
    const bag::Shot& shot = topic.shots.at(number);
    Message m;
    m.name = fmt::format("{}: {} at {} s", file_->name(), topic.name, bag::stamp_text(shot.stamp, false));
    m.bytes = file_->read(shot.place);
    m.compressed = topic.compressed;
    m.image = m.compressed ? bag::parse_compressed_image(m.bytes, m.name, topic.serialisation)
                           : bag::parse_image(m.bytes, m.name, topic.serialisation);
    return m;
  }

  std::shared_ptr<const bag::Recording> file_;
  std::array<bag::ImageTopic, 2> topics_;
};

bool whole_microseconds(const bag::ImageTopic& topic) {
  return std::all_of(topic.shots.begin(), topic.shots.end(),
                     [](const bag::Shot& shot) { return shot.stamp % 1000 == 0; });
}

/// The topic without images whose time is that of the one before: messages that were recorded twice.
bag::ImageTopic without_repeats(const bag::ImageTopic& topic, const std::string& file, Sequence& sequence) {
  const auto same = [](const bag::Shot& a, const bag::Shot& b) { return a.stamp == b.stamp; };
  const std::size_t count = topic.shots.size();
  if (count > 1 && topic.shots.front().stamp == 0 && topic.shots.back().stamp == 0)
    throw InputError(fmt::format("{}: {}", file, topic.name), 0, "no image has a time in its header");
  bag::ImageTopic result = topic;
  const auto first = std::adjacent_find(topic.shots.begin(), topic.shots.end(), same);
  if (first == topic.shots.end()) return result;
  result.shots.erase(std::unique(result.shots.begin(), result.shots.end(), same), result.shots.end());
  sequence.notes.push_back(
      fmt::format("{} of {} images of {} have the time of the one before and are left out, the "
                  "first at {} s",
                  count - result.shots.size(), count, topic.name, bag::stamp_text(first->stamp, false)));
  return result;
}

/// As a list of TUM's has them.
std::vector<double> times_of(const bag::ImageTopic& topic, double offset) {
  std::vector<double> times;
  for (const bag::Shot& shot : topic.shots)
    times.push_back(parse_number(bag::stamp_text(shot.stamp, false)).value_or(0) - offset);
  return times;
}

void pair_images(Sequence& sequence, std::shared_ptr<const bag::Recording> file,
                 const bag::ChosenTopics& topics, const SequenceOptions& options) {
  const bag::ImageTopic colour = without_repeats(*topics.colour, file->name(), sequence),
                        depth = without_repeats(*topics.depth, file->name(), sequence);
  sequence.colour_times = times_of(colour, 0);
  sequence.depth_times = times_of(depth, depth_time_offset(sequence, options));
  const bool micro = whole_microseconds(colour);
  const auto path = [&](const bag::ImageTopic& topic, std::size_t i) {
    return fs::path(fmt::format("{}: {} at {} s", file->name(), topic.name,
                                bag::stamp_text(topic.shots[i].stamp, false)));
  };
  const auto images = std::make_shared<const RecordedImages>(file, colour, depth);
  for (const auto& [i, j] :
       associate(sequence.colour_times, sequence.depth_times, options.max_association_difference)) {
    FrameRecord record;
    record.t_rgb = sequence.colour_times[i];
    record.t_depth = sequence.depth_times[j];
    record.stamp = bag::stamp_text(colour.shots[i].stamp, micro);
    record.rgb = path(colour, i);
    record.depth = path(depth, j);
    record.ns = static_cast<std::int64_t>(colour.shots[i].stamp);
    record.source = images;
    record.colour_number = i;
    record.depth_number = j;
    sequence.frames.push_back(std::move(record));
  }
  if (sequence.frames.empty())
    throw InputError(
        file->name(), 0,
        fmt::format(
            "no image of {} has one of {} within {} s; they are from {:.3f} to {:.3f} s and from {:.3f} "
            "to {:.3f} s",
            colour.name, depth.name, options.max_association_difference, sequence.colour_times.front(),
            sequence.colour_times.back(), sequence.depth_times.front(), sequence.depth_times.back()));
  judge_float_depth(sequence, depth.name);
}

}  // namespace

Sequence load_recording(std::shared_ptr<const bag::Recording> file, const fs::path& root,
                        const SequenceOptions& options) {
  const bag::BagSurvey survey = bag::survey(*file);
  const bag::ChosenTopics topics = bag::choose_topics(survey, options.topics);
  Sequence sequence;
  sequence.root = root;
  sequence.notes = survey.missing;
  sequence.topics = topics.colour->name + "," + topics.depth->name;
  constexpr double kMillimetres = 1000;  // REP 118
  sequence.depth_units = kMillimetres;
  const std::string stem = fs::is_directory(root) ? folder_name(root) : root.stem().string();
  sequence.folder_camera = stem.starts_with("rgbd_bonn") ? "bonn" : camera_by_name(stem);
  bag::InfoCamera info = bag::camera_beside(survey, *topics.colour);
  // Depth in the colour images' frame is seen by the same camera.
  if (!info.camera && topics.depth->frame == topics.colour->frame)
    info = bag::camera_beside(survey, *topics.depth);
  sequence.camera = std::move(info.camera);
  if (sequence.camera) {
    sequence.camera_source = "CameraInfo";  // the topic is its name
  } else {
    sequence.camera_hint = sequence.folder_camera;
  }
  pair_images(sequence, std::move(file), topics, options);
  bag::BagTruth truth = bag::truth_of(survey, topics.colour->frame);
  sequence.groundtruth = std::move(truth.poses);
  sequence.truth_missing = std::move(truth.missing);
  if (!sequence.groundtruth.empty()) sequence.truth_file = root.string() + ": " + truth.source;
  if (survey.poses_left_out > 0)
    sequence.notes.push_back(fmt::format("ground truth: {} messages are left out; the first: {}",
                                         survey.poses_left_out, survey.first_left_out));
  return sequence;
}

}  // namespace dynslam::runtime::formats
