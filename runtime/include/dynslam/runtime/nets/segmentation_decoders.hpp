// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynslam/runtime/nets/inference_engine.hpp"

namespace dynslam::runtime {

/// How an image was fitted into a network's input.
struct Letterbox {
  int width = 0, height = 0;        ///< of the input
  double scale_x = 1, scale_y = 1;  ///< input pixels per image pixel
  double pad_x = 0, pad_y = 0;      ///< left and top border in the input
};

/// Fits an image into the input with one scale for both directions and a centred border.
[[nodiscard]] Letterbox fit_letterbox(int image_width, int image_height, int width, int height);
/// Fits it by stretching.
[[nodiscard]] Letterbox fit_stretched(int image_width, int image_height, int width, int height);

/// One found object.
struct Detection {
  int category = 0;  ///< index of the class in the model's list
  float score = 0;   ///< 0..1
  cv::Rect box;      ///< pixels of the image, inside it, not empty
  cv::Mat mask;      ///< CV_8UC1 of the box's size, 255 = object
};

/// Which of a network's detections are kept.
struct DetectionOptions {
  float min_score = 0.35F;
  float max_overlap = 0.6F;  ///< intersection over union above which the weaker of two of a class is dropped
  float mask_threshold = 0.5F;
  int max_detections = 100;
};

/// Whether a YOLO list holds what a suppression inside the network has left: 1 x N x (6 + P).
/// @param prototypes  their number P
[[nodiscard]] bool is_yolo_selection(const Tensor& predictions, std::int64_t prototypes);

/// Instances of a YOLOv8 or YOLO11 segmentation head.
/// @param predictions  1 x (4 + classes + P) x N: centre x, y, width, height in input pixels, scores,
/// coefficients; or, with the suppression inside, 1 x N x (6 + P): x1, y1, x2, y2, score, class, coefficients
/// @param prototypes   1 x P x H x W
/// @throws InputError (naming `model`) where shapes contradict each other or values are not finite
[[nodiscard]] std::vector<Detection> decode_yolo(const Tensor& predictions, const Tensor& prototypes,
                                                 const Letterbox& fit, cv::Size image,
                                                 const DetectionOptions& options, const std::string& model);

/// Instances of torchvision's Mask R-CNN.
/// @param boxes   N x 4: x1, y1, x2, y2 in input pixels
/// @param masks   N x 1 x 28 x 28 (within the box) or N x 1 x H x W (of the input's size)
[[nodiscard]] std::vector<Detection> decode_mask_rcnn(const Tensor& boxes, const Tensor& labels,
                                                      const Tensor& scores, const Tensor& masks,
                                                      const Letterbox& fit, cv::Size image,
                                                      const DetectionOptions& options,
                                                      const std::string& model);

/// Class of each pixel of the image, CV_8UC1, from logits 1 x C x h x w (interpolated before the
/// strongest is taken) or from one channel 1 x h x w or 1 x 1 x h x w: a label map (nearest) or, with a
/// threshold, one class, 1 where the interpolated value is above it.
/// @param align_corners  corner pixels of logits and input coincide (DeepLab); otherwise their borders do
[[nodiscard]] cv::Mat decode_semantic(const Tensor& output, const Letterbox& fit, cv::Size image,
                                      bool align_corners, const std::string& model,
                                      std::optional<float> threshold = std::nullopt);

/// Drops the weaker of two boxes of one class that overlap too much; strongest first.
void suppress_overlaps(std::vector<Detection>& detections, float max_overlap);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
