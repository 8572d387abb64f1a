// SPDX-License-Identifier: BSD-3-Clause
#include "nets/model_recognition.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <initializer_list>
#include <optional>
#include <string_view>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {

using Outputs = std::vector<Tensor>;

constexpr std::int64_t kBox = 4;             // numbers of a box
constexpr std::int64_t kKeypoints = 17 * 3;  // of COCO's people: x, y, visible
constexpr std::int64_t kMostQueries = 1000;  // of a detector that needs no suppression

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

bool any_name(const Outputs& outputs, std::initializer_list<std::string_view> parts) {
  return std::any_of(outputs.begin(), outputs.end(), [&](const Tensor& t) {
    const std::string name = lower(t.name);
    return std::any_of(parts.begin(), parts.end(),
                       [&](std::string_view part) { return name.find(part) != std::string::npos; });
  });
}

std::optional<std::size_t> named(const Outputs& outputs, std::string_view name) {
  for (std::size_t i = 0; i < outputs.size(); ++i)
    if (lower(outputs[i].name) == name) return i;
  return std::nullopt;
}

std::optional<std::size_t> only_of_rank(const Outputs& outputs, std::size_t rank) {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (outputs[i].shape.size() != rank) continue;
    if (found) return std::nullopt;
    found = i;
  }
  return found;
}

/// Whether an output is a grid over the image: the input's size divided by one number, rounded.
bool is_grid(const Tensor& t, cv::Size input) {
  const std::size_t rank = t.shape.size();
  if ((rank != 3 && rank != 4) || t.dim(0) != 1) return false;
  const auto h = static_cast<double>(t.dim(-2)), w = static_cast<double>(t.dim(-1));
  if (h < 2 || w < 2) return false;
  const double narrow = std::max(input.width / (w + 1), input.height / (h + 1));
  return narrow <= std::min(input.width / (w - 1), input.height / (h - 1));
}

/// Cells of YOLO's three grids.
std::int64_t yolo_cells(cv::Size input) {
  std::int64_t cells = 0;
  for (const int stride : {8, 16, 32})
    cells += static_cast<std::int64_t>(input.width / stride) * (input.height / stride);
  return cells;
}

// --- what it seems to be, where it is no segmenter
// -------------------------------------------------------------

std::string shapes_of(const Outputs& outputs) {
  constexpr std::size_t kMost = 6;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMost, outputs.size()); ++i)
    text += fmt::format("{}{} [{}]", i > 0 ? ", " : "", outputs[i].name, fmt::join(outputs[i].shape, ", "));
  return outputs.size() > kMost ? text + ", ..." : text;
}

/// By the shape of a list of boxes; empty: it is none.
std::string seems_by_list(const Tensor& t, cv::Size input) {
  const std::int64_t rows = t.dim(-2), columns = t.dim(-1), cells = yolo_cells(input);
  if (t.shape.size() == 2 && t.dim(0) == 1 && columns > kBox) return "a classifier, which finds no pixels";
  if (t.shape.size() != 3 && t.shape.size() != 2) return {};
  if (columns == cells && rows == kBox + 1 + kKeypoints) return "a YOLO pose network: boxes and key points";
  if (columns == cells && rows > kBox) return "a YOLO detector: boxes without masks";
  if (rows == 3 * cells && columns > kBox + 1) return "a YOLOv5 or YOLOv7 detector: boxes without masks";
  if (columns == 6 || columns == 7) return "a detector whose suppression is inside: boxes without masks";
  if (columns == 6 + kKeypoints) return "a pose network: boxes and key points";
  if (rows <= kMostQueries && columns > kBox) return "a detector of the DETR kind: boxes without masks";
  return {};
}

std::string seems(const Outputs& outputs, const ModelFacts& facts) {
  const auto task = facts.metadata.find("task");
  if (task != facts.metadata.end()) {
    const std::string& t = task->second;
    if (t == "detect") return "a detector (task 'detect' in its metadata): boxes without masks";
    if (t == "pose") return "a pose network (task 'pose' in its metadata): key points without masks";
    if (t == "obb") return "a detector of turned boxes (task 'obb' in its metadata), without masks";
    if (t == "classify") return "a classifier (task 'classify' in its metadata), which finds no pixels";
    if (lower(t).find("seg") == std::string::npos) return fmt::format("a network for '{}' (its metadata)", t);
  }
  if (any_name(outputs, {"depth", "dispar", "disp_"})) return "a depth network";
  if (any_name(outputs, {"heatmap", "keypoint", "kpt", "simcc"}))
    return "a pose network: key points without masks";
  if (any_name(outputs, {"quer", "pred_logits", "pred_masks"}))
    return any_name(outputs, {"mask"})
               ? "a network of the DETR or MaskFormer kind, whose queries are not decoded"
               : "a detector of the DETR kind: boxes without masks";
  if (any_name(outputs, {"box", "num_det", "detection"})) return "a detector: boxes without masks";
  if (any_name(outputs, {"iou_predictions", "low_res_masks"})) return "a network that needs a prompt (SAM)";
  for (const Tensor& t : outputs)
    if (const std::string text = seems_by_list(t, facts.input); !text.empty()) return text;
  return "of no kind that is known";
}

[[noreturn]] void refuse(const Outputs& outputs, const ModelFacts& facts, const std::string& what) {
  throw InputError(
      facts.file, 0,
      fmt::format("seems to be {} (outputs: {}); needed is a segmentation network: YOLOv8/11-seg, Mask "
                  "R-CNN, or an output of 1 x classes x H x W",
                  what, shapes_of(outputs)));
}

// --- the kinds that are decoded
// --------------------------------------------------------------------------------

std::optional<ModelOutputs> as_mask_rcnn(const Outputs& outputs) {
  ModelOutputs found{ModelKind::mask_rcnn, {}};
  constexpr std::array<std::string_view, 4> kNames{"boxes", "labels", "scores", "masks"};
  bool all = true;
  for (std::size_t k = 0; k < kNames.size() && all; ++k) {
    const auto at = named(outputs, kNames[k]);
    all = at.has_value();
    if (all) found.at[k] = *at;
  }
  if (all) return found;
  // Exported without names: N x 4, N whole numbers, N others, N x 1 x h x w.
  const auto boxes = only_of_rank(outputs, 2), masks = only_of_rank(outputs, 4);
  if (outputs.size() != 4 || !boxes || !masks || outputs[*boxes].dim(1) != kBox ||
      outputs[*masks].dim(1) != 1 || outputs[*masks].dim(0) != outputs[*boxes].dim(0))
    return std::nullopt;
  std::vector<std::size_t> labels, scores;
  for (std::size_t i = 0; i < outputs.size(); ++i)
    if (outputs[i].shape.size() == 1) (outputs[i].whole ? labels : scores).push_back(i);
  if (labels.size() != 1 || scores.size() != 1) return std::nullopt;
  found.at = {*boxes, labels.front(), scores.front(), *masks};
  return found;
}

/// The list of detections beside the prototypes of masks, as that of YOLOv8 and YOLO11 or with the
/// suppression inside.
std::optional<ModelOutputs> as_yolo(const Outputs& outputs, const ModelFacts& facts) {
  const auto predictions = only_of_rank(outputs, 3), prototypes = only_of_rank(outputs, 4);
  if (!predictions || !prototypes || is_grid(outputs[*predictions], facts.input)) return std::nullopt;
  const Tensor &list = outputs[*predictions], &planes = outputs[*prototypes];
  const std::int64_t P = planes.dim(1);
  if (!is_grid(planes, facts.input) || P < 2 || list.dim(0) != 1 || list.dim(1) == P) return std::nullopt;
  if (list.dim(1) == 3 * yolo_cells(facts.input))
    refuse(outputs, facts, "a YOLOv5 or YOLOv7 segmenter, whose anchors are not decoded");
  const bool selected = is_yolo_selection(list, P);
  if (!selected && list.dim(1) - kBox - P < 1) return std::nullopt;
  return ModelOutputs{ModelKind::yolo, {*predictions, *prototypes, 0, 0}};
}

ModelOutputs named_output(const Outputs& outputs, const ModelFacts& facts) {
  for (std::size_t i = 0; i < outputs.size(); ++i)
    if (outputs[i].name == facts.output_name) return {ModelKind::semantic, {i, 0, 0, 0}};
  throw InputError(facts.file, 0,
                   fmt::format("has no output '{}' (--model-output-name); it has: {}", facts.output_name,
                               shapes_of(outputs)));
}

std::optional<ModelOutputs> as_semantic(const Outputs& outputs, const ModelFacts& facts) {
  std::vector<std::size_t> grids;
  for (std::size_t i = 0; i < outputs.size(); ++i)
    if (is_grid(outputs[i], facts.input)) grids.push_back(i);
  if (grids.empty()) return std::nullopt;
  for (const std::size_t grid : grids) {  // beside scores of queries, whose masks are no classes
    const auto scores = [&](const Tensor& t) {
      return t.shape.size() == 3 && t.dim(1) == outputs[grid].dim(1);
    };
    if (outputs[grid].shape.size() == 4 && std::any_of(outputs.begin(), outputs.end(), scores))
      return std::nullopt;
  }
  if (grids.size() == 1) return ModelOutputs{ModelKind::semantic, {grids.front(), 0, 0, 0}};
  for (const std::string_view name : {"out", "logits", "output", "mask", "masks", "seg", "segmentation"}) {
    const auto at = named(outputs, name);
    if (at && std::find(grids.begin(), grids.end(), *at) != grids.end())
      return ModelOutputs{ModelKind::semantic, {*at, 0, 0, 0}};
  }
  throw InputError(
      facts.file, 0,
      fmt::format("has several outputs that may be the segmentation ({}); --model-output-name says "
                  "which is",
                  shapes_of(outputs)));
}

}  // namespace

ModelOutputs recognise_outputs(const Outputs& outputs, const ModelFacts& facts) {
  const auto task = facts.metadata.find("task");
  const bool other_task =
      task != facts.metadata.end() && lower(task->second).find("seg") == std::string::npos;
  if (!facts.output_name.empty()) return named_output(outputs, facts);
  if (other_task) refuse(outputs, facts, seems(outputs, facts));
  const auto try_kind = [&](ModelKind kind) -> std::optional<ModelOutputs> {
    if (facts.asked != ModelKind::automatic && facts.asked != kind) return std::nullopt;
    if (kind == ModelKind::mask_rcnn) return as_mask_rcnn(outputs);
    if (kind == ModelKind::yolo) return as_yolo(outputs, facts);
    if (any_name(outputs, {"depth", "dispar", "disp_", "heatmap", "keypoint", "quer", "pred_boxes"}))
      return std::nullopt;
    return as_semantic(outputs, facts);
  };
  for (const auto kind : {ModelKind::mask_rcnn, ModelKind::yolo, ModelKind::semantic})
    if (const auto found = try_kind(kind)) return *found;
  const std::string what = seems(outputs, facts);
  const std::string asked = facts.asked == ModelKind::automatic
                                ? std::string()
                                : fmt::format(", not --model-kind {}", to_string(facts.asked));
  refuse(outputs, facts, what + asked);
}

std::vector<std::int64_t> input_shape(const std::vector<TensorInfo>& inputs, cv::Size open,
                                      const std::string& file) {
  const auto fail = [&](const std::string& reason) { throw InputError(file, 0, reason); };
  if (inputs.size() != 1) {
    std::string names;
    for (const TensorInfo& i : inputs) names += (names.empty() ? "" : ", ") + i.name;
    fail(fmt::format("has {} inputs ({}); a segmenter takes one image", inputs.size(), names));
  }
  constexpr int kUnsaid = 0, kFloat = 1, kHalf = 10;
  const int type = inputs.front().type;
  if (type != kUnsaid && type != kFloat && type != kHalf)
    fail(fmt::format("has an input of type {}; float or float16 is needed", element_type_name(type)));
  std::vector<std::int64_t> shape = inputs.front().shape;
  if (shape.empty()) shape = {1, 3, -1, -1};
  const std::size_t rank = shape.size();
  const std::string text = fmt::format("{}", fmt::join(shape, " x "));
  if (rank == 4 && shape[3] == 3 && shape[1] != 3)
    fail(fmt::format(
        "takes images as {} (channels last, as TensorFlow has them); export it with 1 x 3 x height x "
        "width",
        text));
  if (rank == 4 && shape[0] > 1)
    fail(fmt::format("takes {} images at once ({}); export it with a batch of one", shape[0], text));
  if ((rank != 3 && rank != 4) || (shape[rank - 3] != 3 && shape[rank - 3] != -1))
    fail(fmt::format("has an input that is not one image of 3 x height x width, but {}", text));
  if (rank == 4) shape[0] = 1;
  shape[rank - 3] = 3;
  if (shape[rank - 2] <= 0) shape[rank - 2] = open.height;
  if (shape[rank - 1] <= 0) shape[rank - 1] = open.width;
  constexpr std::int64_t kNarrowest = 16, kWidest = 8192;  // [px]
  const auto [low, high] = std::minmax(shape[rank - 2], shape[rank - 1]);
  if (low < kNarrowest || high > kWidest)
    fail(fmt::format("takes images of {} x {}", shape[rank - 1], shape[rank - 2]));
  return shape;
}

}  // namespace dynslam::runtime
