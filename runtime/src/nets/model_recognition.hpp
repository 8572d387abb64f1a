// SPDX-License-Identifier: BSD-3-Clause
// What a network is, by what one run of it gives.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/nets/onnx_segmenter.hpp"

namespace dynslam::runtime {

/// What is known of a network beside its outputs.
struct ModelFacts {
  std::string file;
  ModelKind asked = ModelKind::automatic;
  std::string output_name;  ///< of the semantic output; empty: found by name and shape
  cv::Size input;           ///< [px]
  std::map<std::string, std::string> metadata;
};

/// Which outputs are decoded, by their places in the list.
struct ModelOutputs {
  ModelKind kind = ModelKind::automatic;
  /// semantic: the map. yolo: predictions, prototypes. mask_rcnn: boxes, labels, scores, masks.
  std::array<std::size_t, 4> at{};
};

/// Finds the outputs of a segmenter by names and shapes, in any order.
/// @param outputs  of one run
/// @throws InputError with what the file seems to be, where it is no segmenter, and what is needed
[[nodiscard]] ModelOutputs recognise_outputs(const std::vector<Tensor>& outputs, const ModelFacts& facts);

/// Refuses a file whose input is not one image of 3 x height x width, in one line that says what it is.
/// @return the shape with which it is run, what is left open from `open` @throws InputError
[[nodiscard]] std::vector<std::int64_t> input_shape(const std::vector<TensorInfo>& inputs, cv::Size open,
                                                    const std::string& file);

}  // namespace dynslam::runtime
