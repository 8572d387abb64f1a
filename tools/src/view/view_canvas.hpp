// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core.hpp>
#include <string>

/// What views are drawn with.
namespace dynslam::runtime::viewing {

/// Red, green, blue as a report's style sheet has them in the dark scheme (tools/report/src/style.css).
inline cv::Scalar rgb(unsigned code) {
  return cv::Scalar(code & 255U, code >> 8U & 255U, code >> 16U & 255U);
}
inline const cv::Scalar kPage = rgb(0x12161c), kPlan = rgb(0x10141a), kLine = rgb(0x303945),
                        kInk = rgb(0xe7ecf3), kSoft = rgb(0x9aa6b5), kTruth = rgb(0xf2f5f9),
                        kRun = rgb(0x53b4f0), kSemantic = rgb(0xef7bd8), kGeometric = rgb(0xffa94d),
                        kGood = rgb(0x51cf66), kBad = rgb(0xff7b72), kHeld = rgb(0xf0c14b);

inline constexpr double kSmall = 0.4, kLarge = 0.5;  // sizes of text

[[nodiscard]] int text_width(const std::string& text, double size);
/// Writes text from `left` on, in the middle of a line of `box`'s height. @return where it ends
int write(cv::Mat& canvas, const std::string& text, const cv::Rect& box, int left, double size,
          const cv::Scalar& colour);
/// A filled square that says what a colour means, and its text. @return where it ends
int write_legend(cv::Mat& canvas, const std::string& text, const cv::Rect& box, int left,
                 const cv::Scalar& colour);
/// Width of that.
[[nodiscard]] int legend_width(const std::string& text);

}  // namespace dynslam::runtime::viewing
