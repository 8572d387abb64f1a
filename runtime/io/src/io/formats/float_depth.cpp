// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "io/formats/format.hpp"
#include "io/frame_images.hpp"

namespace dynslam::runtime::formats {

void judge_float_depth(Sequence& sequence, const std::string& name) {
  constexpr double kFarthest = 50;  // metres
  if (sequence.frames.empty()) return;
  const FrameRecord& first = sequence.frames.front();
  if (!first.source && first.depth.string().ends_with(".png")) return;  // which holds no floats
  std::vector<float> values;
  for (const std::size_t k : {std::size_t(0), sequence.frames.size() / 2, sequence.frames.size() - 1}) {
    try {
      const cv::Mat image = read_image(sequence.frames[k], ImageSource::Kind::depth, {});
      if (image.type() != CV_32FC1) return;
      constexpr int kStep = 5;  // pixels
      for (int v = 0; v < image.rows; v += kStep) {
        for (int u = 0; u < image.cols; u += kStep)
          if (image.at<float>(v, u) > 0) values.push_back(image.at<float>(v, u));
      }
    } catch (const InputError&) {  // a broken frame is the run's to report
    }
  }
  sequence.float_depth = !values.empty();
  if (values.empty()) return;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (!(double(*middle) > kFarthest)) return;
  for (FrameRecord& frame : sequence.frames) frame.float_units = true;
  sequence.notes.push_back(
      fmt::format("half of the float depth of {} is beyond {:.0f}, too far for metres: it is read in "
                  "the camera's depth units per metre, as 16-bit depth is (1000: millimetres)",
                  name, *middle));
}

}  // namespace dynslam::runtime::formats
