// SPDX-License-Identifier: BSD-3-Clause
#include "view/view_canvas.hpp"

#include <opencv2/imgproc.hpp>

namespace dynslam::runtime::viewing {
namespace {

constexpr int kViewFont = cv::FONT_HERSHEY_SIMPLEX, kSwatch = 10, kSwatchGap = 6;

}  // namespace

int text_width(const std::string& text, double size) {
  int baseline = 0;
  return cv::getTextSize(text, kViewFont, size, 1, &baseline).width;
}

int write(cv::Mat& canvas, const std::string& text, const cv::Rect& box, int left, double size,
          const cv::Scalar& colour) {
  int baseline = 0;
  const cv::Size extent = cv::getTextSize(text, kViewFont, size, 1, &baseline);
  cv::putText(canvas, text, {left, box.y + (box.height + extent.height) / 2}, kViewFont, size, colour, 1,
              cv::LINE_AA);
  return left + extent.width;
}

int write_legend(cv::Mat& canvas, const std::string& text, const cv::Rect& box, int left,
                 const cv::Scalar& colour) {
  cv::rectangle(canvas, cv::Rect(left, box.y + (box.height - kSwatch) / 2, kSwatch, kSwatch), colour,
                cv::FILLED);
  return write(canvas, text, box, left + kSwatch + kSwatchGap, kSmall, kSoft);
}

int legend_width(const std::string& text) {
  return kSwatch + kSwatchGap + text_width(text, kSmall);
}

}  // namespace dynslam::runtime::viewing
