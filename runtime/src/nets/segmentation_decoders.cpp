// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/segmentation_decoders.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {
namespace {

constexpr float kMaxLabel =
    65536.0F;  // no network knows as many classes; float holds every label below exactly

constexpr std::int64_t kSelectedRow = 6;  // x1, y1, x2, y2, score, class: of a suppression in the network

[[noreturn]] void refuse(const std::string& model, const Tensor& tensor, const std::string& wanted) {
  throw InputError(model, 0,
                   fmt::format("output '{}' has the shape [{}], not {}", tensor.name,
                               fmt::join(tensor.shape, ", "), wanted));
}

void require_data(const std::string& model, const Tensor& tensor) {
  std::int64_t count = 1;
  for (const std::int64_t n : tensor.shape) {
    if (n < 0 || (n > 0 && count > std::numeric_limits<std::int32_t>::max() / n))
      refuse(model, tensor, "a usable one");
    count *= n;
  }
  if (static_cast<std::size_t>(count) != tensor.data.size())
    refuse(model, tensor, fmt::format("that of its {} values", tensor.data.size()));
  for (const float x : tensor.data) {
    if (!std::isfinite(x))
      throw InputError(model, 0, fmt::format("output '{}' has values that are not finite", tensor.name));
  }
}

/// Box in image pixels from corners in input pixels; empty where nothing is left inside the image.
cv::Rect to_image(double x1, double y1, double x2, double y2, const Letterbox& fit, cv::Size image) {
  const auto at = [](double x, double pad, double scale, int limit) {
    return std::clamp((x - pad) / scale, 0.0, static_cast<double>(limit));
  };
  const double left = at(x1, fit.pad_x, fit.scale_x, image.width),
               right = at(x2, fit.pad_x, fit.scale_x, image.width);
  const double top = at(y1, fit.pad_y, fit.scale_y, image.height),
               bottom = at(y2, fit.pad_y, fit.scale_y, image.height);
  const int l = static_cast<int>(std::floor(left)), t = static_cast<int>(std::floor(top));
  return {l, t, std::max(0, static_cast<int>(std::ceil(right)) - l),
          std::max(0, static_cast<int>(std::ceil(bottom)) - t)};
}

/// Values of `source` at the pixels of `box`, where source pixel = a * image pixel + b; the border is
/// continued.
cv::Mat sample_box(const cv::Mat& source, const cv::Rect& box, double ax, double bx, double ay, double by) {
  const cv::Matx23d from_box(ax, 0, ax * box.x + bx, 0, ay, ay * box.y + by);
  cv::Mat out;
  cv::warpAffine(source, out, from_box, box.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  return out;
}

/// A candidate remembers its place in the list until it is kept and its mask is made.
void add_candidate(std::vector<Detection>& detections, std::int64_t n, int category, float score,
                   const cv::Rect& box) {
  if (box.area() == 0) return;
  detections.push_back({category, score, box, cv::Mat(1, 1, CV_32S, cv::Scalar(static_cast<double>(n)))});
}

/// Of a list 1 x (4 + classes + P) x N.
std::vector<Detection> yolo_candidates(const Tensor& predictions, std::int64_t classes, const Letterbox& fit,
                                       cv::Size image, const DetectionOptions& options) {
  const std::int64_t columns = predictions.dim(2);
  const auto value = [&](std::int64_t row, std::int64_t column) {
    return predictions.data[static_cast<std::size_t>(row * columns + column)];
  };
  std::vector<Detection> detections;
  for (std::int64_t n = 0; n < columns; ++n) {
    std::int64_t best = 0;
    for (std::int64_t c = 1; c < classes; ++c) {
      if (value(4 + c, n) > value(4 + best, n)) best = c;
    }
    const float score = value(4 + best, n);
    if (score < options.min_score) continue;
    const double x = static_cast<double>(value(0, n)), y = static_cast<double>(value(1, n));
    const double w = static_cast<double>(value(2, n)), h = static_cast<double>(value(3, n));
    add_candidate(detections, n, static_cast<int>(best), score,
                  to_image(x - w / 2, y - h / 2, x + w / 2, y + h / 2, fit, image));
  }
  return detections;
}

int class_of(float label, const Tensor& tensor, const std::string& model) {
  if (!(label >= 0 && label < kMaxLabel)) {
    throw InputError(model, 0,
                     fmt::format("output '{}' has the label {}, which is no class", tensor.name, label));
  }
  return static_cast<int>(label);
}

/// Of a list 1 x N x (6 + P).
std::vector<Detection> yolo_selection(const Tensor& predictions, const Letterbox& fit, cv::Size image,
                                      const DetectionOptions& options, const std::string& model) {
  const std::int64_t columns = predictions.dim(2);
  std::vector<Detection> detections;
  for (std::int64_t n = 0; n < predictions.dim(1); ++n) {
    const float* row = predictions.data.data() + n * columns;
    if (row[4] < options.min_score) continue;
    add_candidate(detections, n, class_of(row[5], predictions, model), row[4],
                  to_image(static_cast<double>(row[0]), static_cast<double>(row[1]),
                           static_cast<double>(row[2]), static_cast<double>(row[3]), fit, image));
  }
  return detections;
}

void strongest_first(std::vector<Detection>& detections) {
  std::stable_sort(detections.begin(), detections.end(),
                   [](const Detection& a, const Detection& b) { return a.score > b.score; });
}

}  // namespace

Letterbox fit_letterbox(int image_width, int image_height, int width, int height) {
  Letterbox fit;
  fit.width = width;
  fit.height = height;
  fit.scale_x = fit.scale_y =
      std::min(static_cast<double>(width) / image_width, static_cast<double>(height) / image_height);
  fit.pad_x = std::floor((width - image_width * fit.scale_x) / 2);
  fit.pad_y = std::floor((height - image_height * fit.scale_y) / 2);
  return fit;
}

Letterbox fit_stretched(int image_width, int image_height, int width, int height) {
  Letterbox fit;
  fit.width = width;
  fit.height = height;
  fit.scale_x = static_cast<double>(width) / image_width;
  fit.scale_y = static_cast<double>(height) / image_height;
  return fit;
}

void suppress_overlaps(std::vector<Detection>& detections, float max_overlap) {
  strongest_first(detections);
  std::vector<Detection> kept;
  for (Detection& d : detections) {
    const bool covered = std::any_of(kept.begin(), kept.end(), [&](const Detection& k) {
      if (k.category != d.category) return false;
      const auto common = static_cast<float>((k.box & d.box).area());
      return common > max_overlap * (static_cast<float>(k.box.area() + d.box.area()) - common);
    });
    if (!covered) kept.push_back(std::move(d));
  }
  detections = std::move(kept);
}

bool is_yolo_selection(const Tensor& predictions, std::int64_t prototypes) {
  return predictions.shape.size() == 3 && predictions.dim(2) == kSelectedRow + prototypes;
}

std::vector<Detection> decode_yolo(const Tensor& predictions, const Tensor& prototypes, const Letterbox& fit,
                                   cv::Size image, const DetectionOptions& options,
                                   const std::string& model) {
  if (predictions.shape.size() != 3 || predictions.dim(0) != 1)
    refuse(model, predictions, "1 x (4 + classes + P) x N");
  if (prototypes.shape.size() != 4 || prototypes.dim(0) != 1) refuse(model, prototypes, "1 x P x H x W");
  require_data(model, predictions);
  require_data(model, prototypes);
  const std::int64_t P = prototypes.dim(1);
  const bool selection = is_yolo_selection(predictions, P);
  const std::int64_t classes = predictions.dim(1) - 4 - P;
  if ((!selection && classes < 1) || P < 1 || prototypes.dim(2) < 1 || prototypes.dim(3) < 1) {
    refuse(model, predictions, fmt::format("1 x (4 + classes + {}) x N", P));
  }
  std::vector<Detection> detections = selection ? yolo_selection(predictions, fit, image, options, model)
                                                : yolo_candidates(predictions, classes, fit, image, options);
  suppress_overlaps(detections, options.max_overlap);
  if (static_cast<int>(detections.size()) > options.max_detections)
    detections.resize(static_cast<std::size_t>(options.max_detections));

  const int ph = static_cast<int>(prototypes.dim(2)), pw = static_cast<int>(prototypes.dim(3));
  const cv::Mat planes(static_cast<int>(P), ph * pw, CV_32F, const_cast<float*>(prototypes.data.data()));
  cv::Mat coefficients(1, static_cast<int>(P), CV_32F), logits;
  // Prototype pixels per image pixel, centres mapped to centres.
  const double sx = static_cast<double>(pw) / fit.width, sy = static_cast<double>(ph) / fit.height;
  const double ax = fit.scale_x * sx, bx = (fit.pad_x + 0.5 * fit.scale_x) * sx - 0.5;
  const double ay = fit.scale_y * sy, by = (fit.pad_y + 0.5 * fit.scale_y) * sy - 0.5;
  const double level = std::log(static_cast<double>(options.mask_threshold) /
                                (1 - static_cast<double>(options.mask_threshold)));
  for (Detection& d : detections) {
    const std::int64_t n = d.mask.at<int>(0);
    for (std::int64_t p = 0; p < P; ++p) {
      const std::int64_t at =
          selection ? n * predictions.dim(2) + kSelectedRow + p : (4 + classes + p) * predictions.dim(2) + n;
      coefficients.at<float>(static_cast<int>(p)) = predictions.data[static_cast<std::size_t>(at)];
    }
    logits = coefficients * planes;
    d.mask = sample_box(logits.reshape(1, ph), d.box, ax, bx, ay, by) > level;
  }
  return detections;
}

std::vector<Detection> decode_mask_rcnn(const Tensor& boxes, const Tensor& labels, const Tensor& scores,
                                        const Tensor& masks, const Letterbox& fit, cv::Size image,
                                        const DetectionOptions& options, const std::string& model) {
  for (const Tensor* t : {&boxes, &labels, &scores, &masks}) require_data(model, *t);
  const std::int64_t n = boxes.dim(0);
  if (boxes.shape.size() != 2 || boxes.dim(1) != 4) refuse(model, boxes, "N x 4");
  if (labels.dim(0) != n || static_cast<std::int64_t>(labels.data.size()) != n)
    refuse(model, labels, fmt::format("{}", n));
  if (scores.dim(0) != n || static_cast<std::int64_t>(scores.data.size()) != n)
    refuse(model, scores, fmt::format("{}", n));
  if (masks.shape.size() != 4 || masks.dim(0) != n || masks.dim(1) != 1)
    refuse(model, masks, fmt::format("{} x 1 x H x W", n));
  const int mh = static_cast<int>(masks.dim(2)), mw = static_cast<int>(masks.dim(3));
  if (n > 0 && (mh < 1 || mw < 1)) refuse(model, masks, "one with pixels");
  // Whole-image masks have the input's size, the others are that of the box, stretched.
  const bool whole = mh == fit.height && mw == fit.width;
  std::vector<Detection> detections;
  for (std::int64_t i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (scores.data[k] < options.min_score) continue;
    const float* b = boxes.data.data() + 4 * k;
    const double x1 = static_cast<double>(b[0]), y1 = static_cast<double>(b[1]),
                 x2 = static_cast<double>(b[2]), y2 = static_cast<double>(b[3]);
    Detection d;
    d.category = class_of(labels.data[k], labels, model);
    d.score = scores.data[k];
    d.box = to_image(x1, y1, x2, y2, fit, image);
    if (d.box.area() == 0 || !(x2 > x1) || !(y2 > y1)) continue;
    const cv::Mat values(mh, mw, CV_32F,
                         const_cast<float*>(masks.data.data()) +
                             k * static_cast<std::size_t>(mh) * static_cast<std::size_t>(mw));
    double ax = fit.scale_x, bx = fit.pad_x + 0.5 * fit.scale_x - 0.5, ay = fit.scale_y,
           by = fit.pad_y + 0.5 * fit.scale_y - 0.5;
    if (!whole) {
      const double sx = mw / (x2 - x1), sy = mh / (y2 - y1);
      ax = fit.scale_x * sx;
      bx = (fit.pad_x + 0.5 * fit.scale_x - x1) * sx - 0.5;
      ay = fit.scale_y * sy;
      by = (fit.pad_y + 0.5 * fit.scale_y - y1) * sy - 0.5;
    }
    d.mask = sample_box(values, d.box, ax, bx, ay, by) > static_cast<double>(options.mask_threshold);
    detections.push_back(std::move(d));
  }
  strongest_first(detections);
  if (static_cast<int>(detections.size()) > options.max_detections)
    detections.resize(static_cast<std::size_t>(options.max_detections));
  return detections;
}

cv::Mat decode_semantic(const Tensor& output, const Letterbox& fit, cv::Size image, bool align_corners,
                        const std::string& model, std::optional<float> threshold) {
  const int rank = static_cast<int>(output.shape.size());
  if ((rank != 3 && rank != 4) || output.dim(0) != 1) refuse(model, output, "1 x C x H x W or 1 x H x W");
  require_data(model, output);
  const std::int64_t classes = rank == 4 ? output.dim(1) : 1;
  const int h = static_cast<int>(output.dim(-2)), w = static_cast<int>(output.dim(-1));
  if (classes < 1 || classes > 255 || h < 2 || w < 2)
    refuse(model, output, "1 x C x H x W with up to 255 classes");
  const cv::Rect all({0, 0}, image);
  // Output pixels per image pixel.
  double ax, bx, ay, by;
  const double ux = fit.pad_x + 0.5 * fit.scale_x - 0.5,
               uy = fit.pad_y + 0.5 * fit.scale_y - 0.5;  // input pixel of image pixel 0
  if (align_corners) {
    const double sx = (w - 1.0) / (fit.width - 1.0), sy = (h - 1.0) / (fit.height - 1.0);
    ax = fit.scale_x * sx;
    bx = ux * sx;
    ay = fit.scale_y * sy;
    by = uy * sy;
  } else {
    const double sx = static_cast<double>(w) / fit.width, sy = static_cast<double>(h) / fit.height;
    ax = fit.scale_x * sx;
    bx = (ux + 0.5) * sx - 0.5;
    ay = fit.scale_y * sy;
    by = (uy + 0.5) * sy - 0.5;
  }
  cv::Mat labels(image, CV_8UC1, cv::Scalar(0));
  if (classes == 1 && threshold) {
    const cv::Mat map(h, w, CV_32F, const_cast<float*>(output.data.data()));
    labels.setTo(1, sample_box(map, all, ax, bx, ay, by) > static_cast<double>(*threshold));
    return labels;
  }
  if (classes == 1) {  // labels already
    const cv::Mat map(h, w, CV_32F, const_cast<float*>(output.data.data()));
    for (int v = 0; v < image.height; ++v) {
      for (int u = 0; u < image.width; ++u) {
        const int x = std::clamp(cvRound(ax * u + bx), 0, w - 1),
                  y = std::clamp(cvRound(ay * v + by), 0, h - 1);
        labels.at<std::uint8_t>(v, u) =
            static_cast<std::uint8_t>(std::clamp(map.at<float>(y, x) + 0.5F, 0.0F, 255.0F));
      }
    }
    return labels;
  }
  cv::Mat strongest;
  for (int c = 0; c < static_cast<int>(classes); ++c) {
    const cv::Mat plane(h, w, CV_32F,
                        const_cast<float*>(output.data.data()) + static_cast<std::ptrdiff_t>(c) * h * w);
    const cv::Mat logits = sample_box(plane, all, ax, bx, ay, by);
    if (c == 0) {
      strongest = logits;
    } else {
      const cv::Mat above = logits > strongest;
      labels.setTo(c, above);
      logits.copyTo(strongest, above);
    }
  }
  return labels;
}

}  // namespace dynslam::runtime
