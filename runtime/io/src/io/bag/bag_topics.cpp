// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/bag_topics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "io/calibration_text.hpp"
#include "io/camera_facts.hpp"

namespace dynslam::runtime::bag {
namespace {

using Topics = std::vector<const ImageTopic*>;

bool is_colour(ImageKind kind) {
  return kind == ImageKind::colour || kind == ImageKind::grey;
}
bool is_depth(ImageKind kind) {
  return kind == ImageKind::depth || kind == ImageKind::sixteen_bit;
}

/// image_transport puts compressed images below the topic of those that they are made of.
std::string base_of(const ImageTopic& topic) {
  for (const std::string_view ending : {"/compressed", "/compressedDepth"}) {
    if (topic.compressed && topic.name.ends_with(ending))
      return topic.name.substr(0, topic.name.size() - ending.size());
  }
  return topic.name;
}

std::string list(const Topics& topics) {
  std::string text;
  for (const ImageTopic* topic : topics)
    text += fmt::format("{}{} ({}, {} images)", text.empty() ? "" : ", ", topic->name,
                        topic->encoding.empty() ? "no encoding" : topic->encoding, topic->shots.size());
  return text.empty() ? "none" : text;
}

/// Keeps those that `prefer`, where there are any.
template <class Prefer>
void narrow(Topics& topics, Prefer&& prefer) {
  Topics kept;
  std::copy_if(topics.begin(), topics.end(), std::back_inserter(kept), prefer);
  if (!kept.empty()) topics = std::move(kept);
}

Topics candidates(const BagSurvey& survey, bool depth) {
  Topics topics;
  for (const ImageTopic& topic : survey.images) {
    if (depth ? is_depth(topic.kind) : is_colour(topic.kind)) topics.push_back(&topic);
  }
  const ImageKind best = depth ? ImageKind::depth : ImageKind::colour;
  narrow(topics, [&](const ImageTopic* topic) { return topic->kind == best; });
  Topics kept;
  for (const ImageTopic* topic : topics) {
    const bool again = topic->compressed && std::any_of(topics.begin(), topics.end(), [&](const auto* other) {
                         return !other->compressed && other->name == base_of(*topic);
                       });
    if (!again) kept.push_back(topic);
  }
  return kept;
}

ChosenTopics choose_by_looking(const BagSurvey& survey) {
  Topics colour = candidates(survey, false), depth = candidates(survey, true);
  if (colour.empty() || depth.empty()) {
    Topics all;
    for (const ImageTopic& topic : survey.images) all.push_back(&topic);
    std::string why;
    if (!survey.not_read.empty())
      why = fmt::format("; it has messages encoded as {}, which are not read",
                        fmt::join(survey.not_read, ", "));
    if (!survey.missing.empty()) why += "; " + survey.missing.front();
    throw InputError(survey.file, 0,
                     fmt::format("has no topic of {} images that are read; its topics of images: {}{}",
                                 colour.empty() ? "colour" : "depth", list(all), why));
  }
  if (colour.size() == 1)
    narrow(depth, [&](const auto* topic) { return topic->frame == colour[0]->frame; });
  else if (depth.size() == 1)
    narrow(colour, [&](const auto* topic) { return topic->frame == depth[0]->frame; });
  if (colour.size() > 1 || depth.size() > 1)
    throw InputError(
        survey.file, 0,
        fmt::format("has several topics of images: colour {}; depth {}: say which are meant with "
                    "--topics COLOUR,DEPTH",
                    list(colour), list(depth)));
  return {colour[0], depth[0]};
}

const ImageTopic* named(const BagSurvey& survey, const std::string& name, bool depth) {
  const char* what = depth ? "depth" : "colour";
  Topics fitting;
  for (const ImageTopic& topic : survey.images) {
    const bool fits = depth ? is_depth(topic.kind) : is_colour(topic.kind);
    if (fits) fitting.push_back(&topic);
    if (topic.name != name) continue;
    if (fits) return &topic;
    throw UsageError(
        fmt::format("--topics: the images of {} are {}, which is no {}", name, topic.encoding, what));
  }
  throw UsageError(fmt::format("--topics: {} has no topic '{}' of images; its topics of {} images: {}",
                               survey.file, name, what, list(fitting)));
}

std::vector<std::string> words(std::initializer_list<double> numbers) {
  std::vector<std::string> result;
  for (const double x : numbers) result.push_back(fmt::format("{}", x));
  return result;
}

}  // namespace

ChosenTopics choose_topics(const BagSurvey& survey, const std::string& topics) {
  if (topics.empty()) return choose_by_looking(survey);
  const auto comma = topics.find(',');
  if (comma == std::string::npos || topics.find(',', comma + 1) != std::string::npos)
    throw UsageError(fmt::format("--topics '{}' is not COLOUR,DEPTH", topics));
  return {named(survey, topics.substr(0, comma), false), named(survey, topics.substr(comma + 1), true)};
}

InfoCamera camera_beside(const BagSurvey& survey, const ImageTopic& images) {
  const std::string base = base_of(images);
  const auto slash = base.rfind('/');
  InfoCamera result;
  result.topic = (slash == std::string::npos ? "" : base.substr(0, slash + 1)) + "camera_info";
  const auto found = survey.infos.find(result.topic);
  if (found == survey.infos.end()) return result;
  const CameraInfoMessage& info = found->second.info;
  const auto& k = info.k;
  const auto& p = info.p;
  if (k[0] == 0) return result;  // as sensor_msgs/CameraInfo says that nobody calibrated
  const std::string name = survey.file + ": " + result.topic;
  if (found->second.changes)
    throw InputError(name, 0, "the camera changes within the bag: give the right one with --camera FILE");
  std::vector<NamedWords> facts{{"camera_name", {result.topic}, 0},
                                {"image_width", words({double(info.width)}), 0},
                                {"image_height", words({double(info.height)}), 0},
                                {"binning_x", words({double(info.binning_x)}), 0},
                                {"binning_y", words({double(info.binning_y)}), 0},
                                {"roi.x_offset", words({double(info.roi_x)}), 0},
                                {"roi.y_offset", words({double(info.roi_y)}), 0}};
  const bool rectified = base.find("rect", slash == std::string::npos ? 0 : slash) != std::string::npos;
  if (rectified) {  // these images are what P projects, without a lens
    facts.push_back({"K", words({p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]}), 0});
  } else {
    facts.push_back({"K", words({k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], k[8]}), 0});
    NamedWords d{"D", {}, 0};
    for (const double x : info.d) d.words.push_back(fmt::format("{}", x));
    facts.push_back(std::move(d));
    if (!info.distortion_model.empty()) facts.push_back({"distortion_model", {info.distortion_model}, 0});
  }
  result.camera = camera_of_facts(facts_of_calibration(facts, name), name);
  return result;
}

}  // namespace dynslam::runtime::bag
