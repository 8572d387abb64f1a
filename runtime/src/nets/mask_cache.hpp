// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "dynslam/runtime/nets/onnx_segmenter.hpp"

namespace dynslam::runtime {

/// A folder with the masks that a network made of images, by the check sums of both.
class MaskCache {
 public:
  /// @throws InputError: the folder cannot be made, or the model cannot be read
  MaskCache(std::filesystem::path folder, const OnnxSegmenter& segmenter, const SegmenterOptions& options);

  /// Masks of an image (CV_8UC3): those kept, or else the network's, which are kept then. A damaged file
  /// counts as none. @throws what the network throws; InputError: the folder cannot be written to
  [[nodiscard]] Masks masks_of(const cv::Mat& bgr, OnnxSegmenter& segmenter) const;

 private:
  std::filesystem::path folder_;
  std::string key_;  // of model and engine
};

}  // namespace dynslam::runtime
