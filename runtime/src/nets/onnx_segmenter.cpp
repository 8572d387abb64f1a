// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/onnx_segmenter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <sstream>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "io/argument_check.hpp"
#include "io/class_names.hpp"
#include "nets/model_recognition.hpp"

namespace dynslam::runtime {
namespace {

/// Grey values are mapped to (value / 255 - mean) / deviation, channels in the order R, G, B.
struct Normalisation {
  std::array<float, 3> mean, deviation;
};
constexpr Normalisation kUnit{{0, 0, 0}, {1, 1, 1}};
constexpr Normalisation kSymmetric{{0.5F, 0.5F, 0.5F}, {0.5F, 0.5F, 0.5F}};  // -1..1: TensorFlow's DeepLab
constexpr Normalisation kImageNet{{0.485F, 0.456F, 0.406F}, {0.229F, 0.224F, 0.225F}};

constexpr std::uint8_t kLetterboxGrey = 114;  // of YOLO

template <std::size_t N>
std::vector<std::string> list(const std::array<std::string_view, N>& names) {
  return {names.begin(), names.end()};
}

/// Logits on a coarse grid whose corners are the input's corners: (size - 1) is a multiple on both axes.
bool corners_aligned(const Tensor& output, const Letterbox& fit) {
  const std::int64_t h = output.dim(-2), w = output.dim(-1);
  return h > 1 && w > 1 && (h < fit.height || w < fit.width) && (fit.height - 1) % (h - 1) == 0 &&
         (fit.width - 1) % (w - 1) == 0;
}

/// One name per line; nothing where there is no such file.
std::vector<std::string> read_names(const std::filesystem::path& file) {
  std::vector<std::string> names;
  if (!std::filesystem::exists(file)) return names;
  std::istringstream in(read_text(file));
  for (std::string line; std::getline(in, line);) {
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    names.push_back(line);
  }
  while (!names.empty() && names.back().empty()) names.pop_back();
  return names;
}

}  // namespace

std::optional<ModelKind> parse_model_kind(std::string_view name) {
  for (const auto kind : {ModelKind::automatic, ModelKind::yolo, ModelKind::mask_rcnn, ModelKind::semantic}) {
    if (name == to_string(kind)) return kind;
  }
  return std::nullopt;
}

std::string_view to_string(ModelKind kind) {
  switch (kind) {
    case ModelKind::automatic:
      return "auto";
    case ModelKind::yolo:
      return "yolo";
    case ModelKind::mask_rcnn:
      return "mask-rcnn";
    case ModelKind::semantic:
      return "semantic";
  }
  return "unknown";
}

std::vector<std::string> parse_class_names(const std::string& text) {
  std::vector<std::string> names;
  std::size_t at = 0;
  while ((at = text.find(':', at)) != std::string::npos) {
    const std::size_t key = text.find_last_of("{,", at);
    const std::size_t open = text.find_first_of("'\"", at);
    if (key == std::string::npos || open == std::string::npos) break;
    const std::size_t close = text.find(text[open], open + 1);
    if (close == std::string::npos) break;
    const std::string number = text.substr(key + 1, at - key - 1);
    const std::size_t digit = number.find_first_of("0123456789");
    if (digit == std::string::npos || number.size() > 8) return {};
    const auto index = static_cast<std::size_t>(std::atoi(number.c_str() + digit));
    if (index > 10000) return {};
    if (names.size() <= index) names.resize(index + 1);
    names[index] = text.substr(open + 1, close - open - 1);
    at = close + 1;
  }
  return names;
}

OnnxSegmenter::OnnxSegmenter(const SegmenterOptions& options)
    : options_(options),
      engine_(load_engine(options.model, {options.engine, options.threads, options.memory, options.stop})),
      kind_(options.kind),
      shape_(input_shape(engine_->inputs(), options.input, options.model.string())) {
  // A first guess, by which the image is fitted in: one run on a grey image shows what the graph gives.
  const std::size_t outputs = engine_->outputs().size();
  if (kind_ == ModelKind::automatic)
    kind_ = outputs == 2 ? ModelKind::yolo : outputs == 4 ? ModelKind::mask_rcnn : ModelKind::semantic;
  const ModelKind guess = kind_;
  const cv::Mat grey(480, 640, CV_8UC3, cv::Scalar::all(127));
  run(grey);
  recognise();
  if (kind_ != guess) run(grey);
  find_classes();
  meanings_ =
      class_meanings(classes_, options_.dynamic_classes, options_.map_classes, options_.labels, "the model");
  (void)decode(grey.size());
  if (channels_ == 1) reader_.emplace(options_.output, named_, options_.model.string());
}

void OnnxSegmenter::recognise() {
  const ModelFacts facts{
      options_.model.string(),
      options_.kind,
      options_.output_name,
      {static_cast<int>(shape_[shape_.size() - 1]), static_cast<int>(shape_[shape_.size() - 2])},
      engine_->metadata()};
  const ModelOutputs found = recognise_outputs(outputs_, facts);
  kind_ = found.kind;
  roles_ = found.at;
}

void OnnxSegmenter::find_classes() {
  const auto metadata = engine_->metadata().find("names");
  if (metadata != engine_->metadata().end()) classes_ = parse_class_names(metadata->second);
  names_from_ = "its metadata";
  // Beside FILE.onnx: FILE.names or FILE.onnx.names.
  std::filesystem::path beside = options_.model, behind = options_.model;
  beside.replace_extension(".names");
  behind += ".names";
  for (const auto& file : {beside, behind}) {
    if (!classes_.empty()) break;
    classes_ = read_names(file);
    names_from_ = file.string();
  }
  named_ = classes_.size();
  if (classes_.empty()) names_from_ = "the built-in list";
  std::int64_t count = 0;
  if (kind_ == ModelKind::yolo) {
    const std::int64_t prototypes = output(1).dim(1);
    const bool selection = is_yolo_selection(output(0), prototypes);  // says nothing of the number of classes
    if (!selection) count = output(0).dim(1) - 4 - prototypes;
    if (classes_.empty() && (selection || count == 80)) classes_ = list(kCoco80);
    if (selection) count = static_cast<std::int64_t>(classes_.size());
  } else if (kind_ == ModelKind::mask_rcnn) {
    if (classes_.empty()) classes_ = list(kCoco91);
    count = static_cast<std::int64_t>(classes_.size());
  } else {
    count = channels_ = output(0).shape.size() == 4 ? output(0).dim(1) : 1;
    if (count == 1) {
      // A class alone, which is there or not, or the number of one of many.
      if (classes_.empty()) classes_ = {"background", "person"};
      if (classes_.size() == 1) classes_.insert(classes_.begin(), "background");
      count = static_cast<std::int64_t>(classes_.size());
    }
    if (classes_.empty() && count == 21) classes_ = list(kVoc21);
    if (classes_.empty() && count == 4) classes_ = list(kDemo);
  }
  if (classes_.empty() || static_cast<std::int64_t>(classes_.size()) != count) {
    throw InputError(options_.model.string(), 0,
                     fmt::format("has {} classes and names for {}; put one name per line into {} or {}",
                                 count, classes_.size(), beside.string(), behind.string()));
  }
}

std::string OnnxSegmenter::describe() const {
  std::string names;
  const std::size_t roles = kind_ == ModelKind::semantic ? 1 : kind_ == ModelKind::yolo ? 2 : 4;
  for (std::size_t k = 0; k < roles; ++k) names += (k > 0 ? ", " : "") + output(k).name;
  return fmt::format("{}: {} by {}, from {}{}; {} classes named by {}; {}", options_.model.string(),
                     to_string(kind_), engine_->name(), names,
                     reader_ ? ", " + reader_->describe() : std::string(), classes_.size(), names_from_,
                     describe_meanings(classes_, meanings_));
}

void OnnxSegmenter::fill_input(const cv::Mat& bgr) {
  const std::size_t rank = shape_.size();
  const int width = static_cast<int>(shape_[rank - 1]), height = static_cast<int>(shape_[rank - 2]);
  cv::Mat fitted;
  if (kind_ == ModelKind::semantic) {
    fit_ = fit_stretched(bgr.cols, bgr.rows, width, height);
    cv::resize(bgr, fitted, {width, height}, 0, 0, cv::INTER_LINEAR);
  } else {
    fit_ = fit_letterbox(bgr.cols, bgr.rows, width, height);
    const cv::Size size(std::min(width, cvRound(bgr.cols * fit_.scale_x)),
                        std::min(height, cvRound(bgr.rows * fit_.scale_y)));
    cv::Mat resized;
    cv::resize(bgr, resized, size, 0, 0, cv::INTER_LINEAR);
    const int left = static_cast<int>(fit_.pad_x), top = static_cast<int>(fit_.pad_y);
    cv::copyMakeBorder(resized, fitted, top, height - size.height - top, left, width - size.width - left,
                       cv::BORDER_CONSTANT, cv::Scalar::all(kLetterboxGrey));
  }
  Normalisation n = kUnit;
  if (kind_ == ModelKind::semantic) {
    // DeepLab's input sizes are 16 k + 1, corners aligned; the others follow torchvision.
    n = (width % 16 == 1 && height % 16 == 1) ? kSymmetric : kImageNet;
  }
  const std::size_t plane = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  input_.resize(3 * plane);
  for (int c = 0; c < 3; ++c) {
    float* out = input_.data() + static_cast<std::size_t>(c) * plane;
    const auto k = static_cast<std::size_t>(c);
    const float scale = 1.0F / (255.0F * n.deviation[k]), offset = -n.mean[k] / n.deviation[k];
    for (int v = 0; v < height; ++v) {
      const std::uint8_t* row = fitted.ptr<std::uint8_t>(v) + (2 - c);
      for (int u = 0; u < width; ++u) *out++ = static_cast<float>(row[3 * u]) * scale + offset;
    }
  }
}

void OnnxSegmenter::run(const cv::Mat& bgr) {
  fill_input(bgr);
  engine_->run(input_, shape_, outputs_);
}

Masks OnnxSegmenter::segment(const cv::Mat& bgr) {
  check_image(bgr, {}, CV_8UC3, "OnnxSegmenter::segment(): the image");
  run(bgr);
  return decode(bgr.size());
}

Masks OnnxSegmenter::decode_classes(cv::Size image) {
  const std::string file = options_.model.string();
  const Tensor& map = output(0);
  std::optional<float> threshold;
  if (reader_) {
    reader_->look(map);
    threshold = reader_->threshold();
  } else if (channels_ > 1 && named_ == 0 && are_heatmaps(map)) {
    throw InputError(
        file, 0,
        fmt::format("output '{}' has {} channels whose values from 0 to 1 are no shares of classes (heat "
                    "maps of key points?); name the classes in a file beside it if they are some",
                    map.name, channels_));
  }
  const cv::Mat categories = decode_semantic(map, fit_, image, corners_aligned(map, fit_), file, threshold);
  cv::Mat to_dynamic(1, 256, CV_8UC1, cv::Scalar(0)), to_label(1, 256, CV_8UC1, cv::Scalar(0));
  for (std::size_t c = 0; c < std::min<std::size_t>(256, meanings_.size()); ++c) {
    to_dynamic.at<std::uint8_t>(static_cast<int>(c)) = meanings_[c].dynamic ? 255 : 0;
    to_label.at<std::uint8_t>(static_cast<int>(c)) = meanings_[c].label;
  }
  Masks masks;
  cv::LUT(categories, to_dynamic, masks.dynamic);
  cv::LUT(categories, to_label, masks.labels);
  return masks;
}

Masks OnnxSegmenter::decode(cv::Size image) {
  if (kind_ == ModelKind::semantic) return decode_classes(image);
  const std::string file = options_.model.string();
  const auto detections = kind_ == ModelKind::yolo
                              ? decode_yolo(output(0), output(1), fit_, image, options_.detection, file)
                              : decode_mask_rcnn(output(0), output(1), output(2), output(3), fit_, image,
                                                 options_.detection, file);
  Masks masks;
  masks.dynamic = cv::Mat::zeros(image, CV_8UC1);
  masks.labels = cv::Mat::zeros(image, CV_8UC1);
  masks.instances = cv::Mat::zeros(image, CV_16UC1);
  // The strongest is painted last; people over furniture, whatever the scores.
  for (const bool people : {false, true}) {
    for (auto d = detections.rbegin(); d != detections.rend(); ++d) {
      if (d->category < 0 || static_cast<std::size_t>(d->category) >= meanings_.size()) continue;
      const ClassMeaning& m = meanings_[static_cast<std::size_t>(d->category)];
      if (m.dynamic != people || (!m.dynamic && m.label == 0)) continue;
      masks.labels(d->box).setTo(m.label, d->mask);
      if (!m.dynamic) continue;
      masks.dynamic(d->box).setTo(255, d->mask);
      masks.instances(d->box).setTo(static_cast<double>(detections.rend() - d), d->mask);
    }
  }
  return masks;
}

}  // namespace dynslam::runtime
