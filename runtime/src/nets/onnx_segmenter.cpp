// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/onnx_segmenter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "io/argument_check.hpp"
#include "nets/class_names.hpp"

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

bool has_output(const InferenceEngine& engine, std::string_view name) {
  return std::any_of(engine.outputs().begin(), engine.outputs().end(),
                     [&](const TensorInfo& o) { return o.name == name; });
}

/// Logits on a coarse grid whose corners are the input's corners: (size - 1) is a multiple on both axes.
bool corners_aligned(const Tensor& output, const Letterbox& fit) {
  const std::int64_t h = output.dim(-2), w = output.dim(-1);
  return h > 1 && w > 1 && (h < fit.height || w < fit.width) && (fit.height - 1) % (h - 1) == 0 &&
         (fit.width - 1) % (w - 1) == 0;
}

Label map_label(std::string_view name) {
  if (name == "person") return Label::person;
  if (name == "chair") return Label::chair;
  for (const std::string_view display : {"tv", "tvmonitor", "display", "monitor", "laptop"}) {
    if (name == display) return Label::display;
  }
  return Label::background;
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
      engine_(load_engine(options.model, options.engine, options.threads)),
      kind_(options.kind) {
  const std::string file = options_.model.string();
  if (engine_->inputs().size() != 1) {
    throw InputError(file, 0,
                     fmt::format("has {} inputs; a segmenter takes one image", engine_->inputs().size()));
  }
  find_kind();
  // N x 3 x H x W, or 3 x H x W without a batch; sizes that the graph leaves open are the option's.
  shape_ = engine_->inputs().front().shape;
  if (shape_.empty()) shape_ = {1, 3, -1, -1};
  const std::size_t rank = shape_.size();
  if ((rank != 3 && rank != 4) || (shape_[rank - 3] != 3 && shape_[rank - 3] != -1) ||
      (rank == 4 && shape_[0] > 1)) {
    throw InputError(file, 0, "has an input that is not one image of 3 x height x width");
  }
  if (rank == 4) shape_[0] = 1;
  shape_[rank - 3] = 3;
  if (shape_[rank - 2] <= 0) shape_[rank - 2] = options_.input.height;
  if (shape_[rank - 1] <= 0) shape_[rank - 1] = options_.input.width;
  if (shape_[rank - 2] < 16 || shape_[rank - 1] < 16 || shape_[rank - 2] > 8192 || shape_[rank - 1] > 8192) {
    throw InputError(file, 0, fmt::format("takes images of {} x {}", shape_[rank - 1], shape_[rank - 2]));
  }
  fit_.width = static_cast<int>(shape_[rank - 1]);
  fit_.height = static_cast<int>(shape_[rank - 2]);
  // One run on a grey image shows whether the graph does what its kind promises.
  (void)segment(cv::Mat(480, 640, CV_8UC3, cv::Scalar::all(127)));
}

void OnnxSegmenter::find_kind() {
  if (kind_ != ModelKind::automatic) return;
  const auto& outputs = engine_->outputs();
  if (has_output(*engine_, "boxes") && has_output(*engine_, "masks")) {
    kind_ = ModelKind::mask_rcnn;
  } else if (outputs.size() == 2 && has_output(*engine_, "output0") && has_output(*engine_, "output1")) {
    kind_ = ModelKind::yolo;
  } else if (outputs.size() == 1 || has_output(*engine_, "out") || has_output(*engine_, "logits")) {
    kind_ = ModelKind::semantic;
  } else {
    std::string names;
    for (const auto& o : outputs) names += (names.empty() ? "" : ", ") + o.name;
    throw InputError(
        options_.model.string(), 0,
        fmt::format("is no segmenter that is known, by its outputs ({}); --model-kind says what it is",
                    names));
  }
}

const Tensor& OnnxSegmenter::output(std::string_view name) const {
  for (const Tensor& t : outputs_) {
    if (t.name == name) return t;
  }
  throw InputError(options_.model.string(), 0,
                   fmt::format("has no output '{}', which a {} has", name, to_string(kind_)));
}

void OnnxSegmenter::find_classes() {
  const auto metadata = engine_->metadata().find("names");
  if (metadata != engine_->metadata().end()) classes_ = parse_class_names(metadata->second);
  std::filesystem::path sidecar = options_.model;
  sidecar.replace_extension(".names");
  if (std::ifstream in(sidecar); in) {
    classes_.clear();
    for (std::string line; std::getline(in, line);) {
      while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
      classes_.push_back(line);
    }
  }
  std::int64_t count = 0;
  if (kind_ == ModelKind::yolo) {
    count = output("output0").dim(1) - 4 - output("output1").dim(1);
    if (classes_.empty() && count == 80) classes_ = list(kCoco80);
  } else if (kind_ == ModelKind::mask_rcnn) {
    if (classes_.empty()) classes_ = list(kCoco91);
    count = static_cast<std::int64_t>(classes_.size());
  } else {
    const Tensor& logits = outputs_.front();
    count = logits.shape.size() == 4 ? logits.dim(1) : 0;
    if (count <= 1) count = static_cast<std::int64_t>(classes_.size());  // labels: any number
    if (classes_.empty() && count == 21) classes_ = list(kVoc21);
    if (classes_.empty() && count == 4) classes_ = list(kDemo);
  }
  if (classes_.empty() || static_cast<std::int64_t>(classes_.size()) != count) {
    throw InputError(options_.model.string(), 0,
                     fmt::format("has {} classes and names for {}; put one name per line into {}", count,
                                 classes_.size(), sidecar.string()));
  }
}

void OnnxSegmenter::assign_meanings() {
  meanings_.assign(classes_.size(), {});
  const auto index_of = [&](const std::string& name) {
    const auto found = std::find(classes_.begin(), classes_.end(), name);
    if (found != classes_.end() && !name.empty()) return static_cast<std::size_t>(found - classes_.begin());
    std::string known;
    for (const auto& c : classes_) known += c.empty() ? "" : (known.empty() ? "" : ", ") + c;
    throw UsageError(fmt::format("the model has no class '{}'; it has: {}", name, known));
  };
  for (const auto& name : options_.dynamic_classes) {
    Meaning& m = meanings_[index_of(name)];
    m.dynamic = true;
    m.label = map_label(name) == Label::person ? Label::person : Label::background;
  }
  std::vector<std::string> map_classes = options_.map_classes;
  if (map_classes.empty()) {
    for (const char* name : {"chair", "tv", "tvmonitor", "display"}) {
      if (std::find(classes_.begin(), classes_.end(), name) != classes_.end()) map_classes.emplace_back(name);
    }
  }
  for (const auto& name : map_classes) {
    Meaning& m = meanings_[index_of(name)];
    const Label label = map_label(name);
    if (label == Label::background || label == Label::person) {
      throw UsageError(fmt::format(
          "--map-classes {}: the map knows chair, tv, tvmonitor, display, monitor and laptop", name));
    }
    if (!m.dynamic) m.label = label;
  }
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

Masks OnnxSegmenter::segment(const cv::Mat& bgr) {
  check_image(bgr, {}, CV_8UC3, "OnnxSegmenter::segment(): the image");
  fill_input(bgr);
  engine_->run(input_, shape_, outputs_);
  const std::string file = options_.model.string();
  if (classes_.empty()) {
    find_classes();
    assign_meanings();
  }
  Masks masks;
  masks.dynamic = cv::Mat::zeros(bgr.size(), CV_8UC1);
  masks.labels = cv::Mat::zeros(bgr.size(), CV_8UC1);
  if (kind_ == ModelKind::semantic) {
    const Tensor& logits = outputs_.front();
    const cv::Mat categories = decode_semantic(logits, fit_, bgr.size(), corners_aligned(logits, fit_), file);
    cv::Mat to_dynamic(1, 256, CV_8UC1, cv::Scalar(0)), to_label(1, 256, CV_8UC1, cv::Scalar(0));
    for (std::size_t c = 0; c < std::min<std::size_t>(256, meanings_.size()); ++c) {
      to_dynamic.at<std::uint8_t>(static_cast<int>(c)) = meanings_[c].dynamic ? 255 : 0;
      to_label.at<std::uint8_t>(static_cast<int>(c)) = static_cast<std::uint8_t>(meanings_[c].label);
    }
    cv::LUT(categories, to_dynamic, masks.dynamic);
    cv::LUT(categories, to_label, masks.labels);
    return masks;
  }
  const auto detections =
      kind_ == ModelKind::yolo
          ? decode_yolo(output("output0"), output("output1"), fit_, bgr.size(), options_.detection, file)
          : decode_mask_rcnn(output("boxes"), output("labels"), output("scores"), output("masks"), fit_,
                             bgr.size(), options_.detection, file);
  masks.instances = cv::Mat::zeros(bgr.size(), CV_16UC1);
  // The strongest is painted last; people over furniture, whatever the scores.
  for (const bool people : {false, true}) {
    for (auto d = detections.rbegin(); d != detections.rend(); ++d) {
      if (d->category < 0 || static_cast<std::size_t>(d->category) >= meanings_.size()) continue;
      const Meaning& m = meanings_[static_cast<std::size_t>(d->category)];
      if (m.dynamic != people || (!m.dynamic && m.label == Label::background)) continue;
      masks.labels(d->box).setTo(static_cast<int>(m.label), d->mask);
      if (!m.dynamic) continue;
      masks.dynamic(d->box).setTo(255, d->mask);
      masks.instances(d->box).setTo(static_cast<double>(detections.rend() - d), d->mask);
    }
  }
  return masks;
}

}  // namespace dynslam::runtime
