// SPDX-License-Identifier: BSD-3-Clause
#include "io/mask_rule.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "io/class_names.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kSurveyed = 16;                  // files that decide, spread over the folder
constexpr int kMaskHalf = 128, kMaskDeepHalf = 32768;  // from which on a grey value belongs to the mask
constexpr int kOwnLabels = 3;                          // highest of this library's label images
constexpr std::size_t kContinuous = 128;  // grey values that no list of classes has: a mask with wide rims
constexpr int kVocPerson = 15;
constexpr const char* kHint =
    "say what they are: --mask-labels 15=person, or voc, coco, cityscapes, instances or binary";

constexpr std::array<std::string_view, 34> kCityscapes{"unlabeled",  "ego vehicle",   "rectification border",
                                                       "out of roi", "static",        "dynamic",
                                                       "ground",     "road",          "sidewalk",
                                                       "parking",    "rail track",    "building",
                                                       "wall",       "fence",         "guard rail",
                                                       "bridge",     "tunnel",        "pole",
                                                       "polegroup",  "traffic light", "traffic sign",
                                                       "vegetation", "terrain",       "sky",
                                                       "person",     "rider",         "car",
                                                       "truck",      "bus",           "caravan",
                                                       "trailer",    "train",         "motorcycle",
                                                       "bicycle"};

template <std::size_t N>
std::vector<std::string> list(const std::array<std::string_view, N>& names) {
  return {names.begin(), names.end()};
}

bool is_word(const MaskOptions& options, std::string_view word) {
  return options.labels.size() == 1 && options.labels.front() == word;
}

std::vector<fs::path> png_files(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// Files in the order in which they are looked at: first some of the whole folder, then the rest.
std::vector<fs::path> spread(std::vector<fs::path> files) {
  if (files.size() <= kSurveyed) return files;
  std::vector<fs::path> first, rest;
  for (std::size_t i = 0, next = 0; i < files.size(); ++i) {
    const bool chosen = next < kSurveyed && i == next * files.size() / kSurveyed;
    next += chosen ? 1 : 0;
    (chosen ? first : rest).push_back(std::move(files[i]));
  }
  first.insert(first.end(), rest.begin(), rest.end());
  return first;
}

std::string joined(const std::vector<int>& values) {
  constexpr std::size_t kMost = 8;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, values.size()); ++i)
    text += fmt::format("{}{}", i > 0 ? ", " : "", values[i]);
  return values.size() > kMost ? text + ", ..." : text;
}

}  // namespace

std::vector<std::string> mask_class_names(const MaskOptions& options) {
  if (is_word(options, "voc")) return list(kVoc21);
  if (is_word(options, "coco")) return list(kCoco91);
  if (is_word(options, "cityscapes")) return list(kCityscapes);
  if (is_word(options, "instances") || is_word(options, "binary")) return {};
  std::vector<std::string> names;
  for (const std::string& entry : options.labels) {
    const std::size_t equals = entry.find('=');
    std::uint8_t number = 0;
    const auto end = entry.data() + std::min(equals, entry.size());
    const auto [at, error] = std::from_chars(entry.data(), end, number);
    if (equals == std::string::npos || equals + 1 == entry.size() || error != std::errc() || at != end)
      throw UsageError(
          fmt::format("--mask-labels '{}': neither NUMBER=CLASS with a number up to 255 nor voc, coco, "
                      "cityscapes, instances or binary",
                      entry));
    if (names.size() <= number) names.resize(number + std::size_t(1));
    names[number] = entry.substr(equals + 1);
  }
  return names;
}

MapClasses labels_of_masks(const MaskOptions& options) {
  MapClasses classes = with_classes(options.map_labels, options.map_classes);
  if (options.labels.empty() || options.labels.front().find('=') == std::string::npos) return classes;
  for (const std::string& name : mask_class_names(options)) {
    const bool dynamic = std::find(options.dynamic_classes.begin(), options.dynamic_classes.end(), name) !=
                         options.dynamic_classes.end();
    if (!name.empty() && name != "background" && !dynamic) (void)classes.add(name);
  }
  return classes;
}

/// What is in the files that were looked at.
struct MaskRule::Survey {
  std::size_t files = 0;                                             // that could be read
  std::vector<std::size_t> count = std::vector<std::size_t>(65536);  // pixels of each value
  std::set<MaskStorage> storages;                                    // of files that are not all zero
  std::set<int> colours;
  bool voc = true;
  [[nodiscard]] std::vector<int> values() const {  // but 0
    std::vector<int> found;
    for (std::size_t v = 1; v < count.size(); ++v)
      if (count[v] > 0) found.push_back(static_cast<int>(v));
    return found;
  }
  [[nodiscard]] std::size_t pixels() const {
    return std::accumulate(count.begin(), count.end(), std::size_t(0));
  }
  /// Whether most of what is not 0 has the highest value: it is drawn with that one, the others are its rim.
  [[nodiscard]] bool mostly(int top) const {
    return 2 * count[static_cast<std::size_t>(top)] >= pixels() - count[0];
  }
};

MaskRule::MaskRule(fs::path folder, const MaskOptions& options, cv::Size size)
    : folder_(std::move(folder)), options_(options) {
  name_classes();
  const Survey survey = look(size);
  if (survey.storages.size() > 1) {
    throw InputError(folder_.string(), 0,
                     fmt::format("holds masks of several kinds ({} and {}); one rule must fit all of them",
                                 to_string(*survey.storages.begin()), to_string(*survey.storages.rbegin())));
  }
  if (!survey.storages.empty()) {
    storage_ = *survey.storages.begin();
    decide(survey);
  }
  describe(survey);
}

void MaskRule::name_classes() {
  if (options_.labels.empty()) return;
  named_ = true;
  reason_ = "--mask-labels";
  how_ = is_word(options_, "instances") ? How::instances
         : is_word(options_, "binary")  ? How::one_value
                                        : How::labels;
  if (how_ != How::labels) return;
  const std::vector<std::string> names = mask_class_names(options_);
  // Whoever gives a class a number by hand wants it in the map.
  std::vector<std::string> mapped = options_.map_classes;
  if (options_.labels.front().find('=') != std::string::npos) {
    for (const std::string& name : names) {
      const auto among = [&](const std::vector<std::string>& v) {
        return std::find(v.begin(), v.end(), name) != v.end();
      };
      if (!name.empty() && name != "background" && !among(options_.dynamic_classes) && !among(mapped))
        mapped.push_back(name);
    }
  }
  const auto meanings =
      class_meanings(names, options_.dynamic_classes, mapped, options_.map_labels, "--mask-labels");
  std::copy(meanings.begin(), meanings.end(), meanings_.begin());
  reason_ += ": " + describe_meanings(names, meanings);
}

MaskRule::Survey MaskRule::look(cv::Size size) const {
  Survey survey;
  for (const fs::path& path : spread(png_files(folder_))) {
    if (survey.files >= kSurveyed && !survey.storages.empty()) break;
    try {
      const EncodedImage file(path);
      if (file.size() != size) continue;  // said when it is needed
      const MaskImage image = read_mask_image(file, by_index());
      ++survey.files;
      const bool deep = image.values.depth() == CV_16U;
      for (int v = 0; v < size.height; ++v) {
        for (int u = 0; u < size.width; ++u) {
          ++survey.count[deep ? image.values.at<std::uint16_t>(v, u) : image.values.at<std::uint8_t>(v, u)];
        }
      }
      if (cv::countNonZero(image.values) == 0) continue;
      survey.storages.insert(image.storage);
      survey.colours.insert(image.colours.begin(), image.colours.end());
      survey.voc = survey.voc && image.voc;
    } catch (const InputError&) {  // said when it is needed
    }
  }
  return survey;
}

void MaskRule::decide(const Survey& survey) {
  const bool numbers = storage_ != MaskStorage::colour && storage_ != MaskStorage::alpha;
  if (named_ && !numbers && how_ == How::labels)
    throw InputError(folder_.string(), 0,
                     fmt::format("holds {}, which have no numbers for --mask-labels", to_string(storage_)));
  if (named_ && !numbers) how_ = How::one_value;
  if (!named_) {
    switch (storage_) {
      case MaskStorage::grey:
        decide_grey(survey);
        break;
      case MaskStorage::indexed:
        decide_indexed(survey);
        break;
      case MaskStorage::deep:
        decide_deep(survey);
        break;
      case MaskStorage::colour:
        if (survey.colours.size() > 1)
          throw InputError(
              folder_.string(), 0,
              fmt::format("holds pictures in several colours, neither grey nor Pascal VOC's; {}", kHint));
        how_ = How::one_value;
        value_ = 255;
        reason_ = "masks in one colour, dynamic where not black";
        break;
      case MaskStorage::alpha:
        how_ = How::above;
        value_ = kMaskHalf;
        reason_ = fmt::format("pictures with an alpha channel, dynamic where it is {} or more", kMaskHalf);
        break;
    }
  }
  if (dynamic_share(survey) >= 1)
    throw InputError(folder_.string(), 0,
                     fmt::format("marks every pixel of {} files as dynamic ({}): is it the other way round?",
                                 survey.files, reason_));
}

void MaskRule::decide_grey(const Survey& survey) {
  const std::vector<int> values = survey.values();
  const int top = values.back();
  if (top <= kOwnLabels) {
    how_ = How::labels;
    for (std::uint8_t label = 0; label <= kOwnLabels; ++label)
      meanings_[label] = {label == static_cast<std::uint8_t>(Label::person), label};
    reason_ = "label images (1 person, 2 chair, 3 display), dynamic where 1";
  } else if (top >= kMaskHalf &&
             (survey.mostly(top) || values.front() >= kMaskHalf || values.size() >= kContinuous)) {
    how_ = How::above;
    value_ = kMaskHalf;
    reason_ = fmt::format("grey masks, dynamic where {} or more", kMaskHalf);
  } else if (values.size() == 1) {
    how_ = How::one_value;
    value_ = top;
    reason_ = fmt::format("masks of 0 and {}, dynamic where {}", top, top);
  } else {
    throw InputError(
        folder_.string(), 0,
        fmt::format("holds the labels {}, which mean nothing without names; {}", joined(values), kHint));
  }
}

void MaskRule::decide_indexed(const Survey& survey) {
  const std::vector<int> values = survey.values();
  const bool in_a_row = values.back() == static_cast<int>(values.size());
  const auto has = [&](int value) { return survey.count[static_cast<std::size_t>(value)] > 0; };
  if (survey.voc && (has(kVocPerson) || !in_a_row)) {
    const std::vector<std::string> names = list(kVoc21);
    const auto meanings = class_meanings(names, options_.dynamic_classes, options_.map_classes,
                                         options_.map_labels, "Pascal VOC");
    std::copy(meanings.begin(), meanings.end(), meanings_.begin());
    how_ = How::labels;
    reason_ = "label images with Pascal VOC's palette; " + describe_meanings(names, meanings);
  } else if (survey.voc) {
    how_ = How::instances;
    reason_ = fmt::format(
        "instances 1 to {} in Pascal VOC's colours (as DAVIS has them), all of them dynamic", values.back());
  } else if (values.size() == 1) {
    how_ = How::one_value;
    value_ = values.front();
    reason_ = fmt::format("masks of the palette's colours 0 and {}, dynamic where {}", value_, value_);
  } else {
    throw InputError(
        folder_.string(), 0,
        fmt::format("holds the labels {} of a palette that is not known; {}", joined(values), kHint));
  }
}

void MaskRule::decide_deep(const Survey& survey) {
  const int top = survey.values().back();
  const bool mask = top >= kMaskDeepHalf && survey.mostly(top);
  how_ = mask ? How::above : How::instances;
  value_ = kMaskDeepHalf;
  reason_ = mask ? fmt::format("16-bit masks, dynamic where {} or more", kMaskDeepHalf)
                 : "16-bit instances, dynamic where not 0";
}

bool MaskRule::is_dynamic(int value) const {
  switch (how_) {
    case How::above:
      return value >= value_;
    case How::labels:
      return value < static_cast<int>(meanings_.size()) && meanings_[static_cast<std::size_t>(value)].dynamic;
    case How::one_value:
    case How::instances:
      return value != 0;
    case How::unknown:
      break;
  }
  return false;
}

double MaskRule::dynamic_share(const Survey& survey) const {
  std::size_t dynamic = 0;
  for (std::size_t v = 0; v < survey.count.size(); ++v)
    if (is_dynamic(static_cast<int>(v))) dynamic += survey.count[v];
  return static_cast<double>(dynamic) / static_cast<double>(std::max<std::size_t>(1, survey.pixels()));
}

void MaskRule::describe(const Survey& survey) {
  if (survey.storages.empty()) {
    text_ = fmt::format("{}: nothing is marked in any of {} files", folder_.string(), survey.files);
    return;
  }
  text_ = fmt::format("{}: {}; by {} files, {:.3g} % of whose pixels are dynamic", folder_.string(), reason_,
                      survey.files, 100 * dynamic_share(survey));
}

Masks MaskRule::apply(const MaskImage& image, const fs::path& path) const {
  const cv::Mat& values = image.values;
  const auto refuse = [&](const std::string& what) {
    throw InputError(path.string(), 0,
                     fmt::format("{}, unlike the other masks of its folder ({})", what, reason_));
  };
  Masks masks;
  masks.dynamic = cv::Mat::zeros(values.size(), CV_8UC1);
  if (cv::countNonZero(values) == 0) {
    if (how_ == How::labels) masks.labels = masks.dynamic.clone();
    if (how_ != How::labels) masks.instances = cv::Mat::zeros(values.size(), CV_16UC1);
    return masks;
  }
  if (how_ == How::unknown || image.storage != storage_)
    refuse(fmt::format("is stored as {}", to_string(image.storage)));
  double top = 0;
  cv::minMaxLoc(values, nullptr, &top);
  switch (how_) {
    case How::above:
      masks.dynamic = values >= value_;
      break;
    case How::one_value:
      masks.dynamic = values != 0;
      if (!named_ && cv::countNonZero(masks.dynamic) != cv::countNonZero(values == value_))
        refuse(fmt::format("has other values than 0 and {}", value_));
      break;
    case How::labels: {
      if (values.depth() == CV_16U && top > 255) refuse(fmt::format("has the value {}", top));
      if (!named_ && storage_ == MaskStorage::grey && top > kOwnLabels)
        refuse(fmt::format("has the value {}", top));
      cv::Mat bytes, to_dynamic(1, 256, CV_8UC1), to_label(1, 256, CV_8UC1);
      values.convertTo(bytes, CV_8U);
      for (int v = 0; v < 256; ++v) {
        to_dynamic.at<std::uint8_t>(v) = is_dynamic(v) ? 255 : 0;
        to_label.at<std::uint8_t>(v) = meanings_[static_cast<std::size_t>(v)].label;
      }
      cv::LUT(bytes, to_dynamic, masks.dynamic);
      cv::LUT(bytes, to_label, masks.labels);
      return masks;
    }
    case How::instances:
      masks.dynamic = values != 0;
      values.convertTo(masks.instances, CV_16U);
      return masks;
    case How::unknown:
      break;
  }
  cv::connectedComponents(masks.dynamic, masks.instances, 8, CV_16U);
  return masks;
}

}  // namespace dynslam::runtime
