// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/view/view_painter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "io/argument_check.hpp"
#include "view/view_canvas.hpp"
#include "view/view_plans.hpp"

namespace dynslam::runtime {
namespace {

using namespace viewing;

constexpr int kGap = 10, kHeader = 36, kFooter = 32;

void tint(cv::Mat& picture, const cv::Mat& mask, const cv::Scalar& colour) {
  constexpr double kOpacity = 0.45;
  cv::Mat layer(picture.size(), CV_8UC3, colour), mixed, scaled;
  cv::addWeighted(picture, 1 - kOpacity, layer, kOpacity, 0, mixed);
  cv::resize(mask, scaled, picture.size(), 0, 0, cv::INTER_NEAREST);
  mixed.copyTo(picture, scaled);
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(scaled, contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  cv::drawContours(picture, contours, -1, colour, 1);
}

/// What moves is drawn last, over what stands still.
void draw_keypoints(cv::Mat& picture, const std::vector<ViewKeypoint>& keypoints, double scale) {
  constexpr int kBits = 4;
  const int radius = cvRound((1 << kBits) * std::max(2.2, picture.cols / 230.0));
  for (const bool moving : {false, true}) {
    for (const ViewKeypoint& k : keypoints) {
      if ((k.weight < 0.5) != moving) continue;
      // Pixels are squares around whole numbers, in the image as on the canvas.
      const cv::Point at(cvRound(((double(k.pixel.x) + 0.5) * scale - 0.5) * (1 << kBits)),
                         cvRound(((double(k.pixel.y) + 0.5) * scale - 0.5) * (1 << kBits)));
      cv::circle(picture, at, radius + (1 << kBits), kPage, cv::FILLED, cv::LINE_AA, kBits);
      cv::circle(picture, at, radius, weight_colour(k.weight), cv::FILLED, cv::LINE_AA, kBits);
    }
  }
}

const cv::Scalar& colour_of_state(const ViewScene& scene) {
  if (scene.paused) return kHeld;
  const TrackingState s = scene.frame.state;
  return s == TrackingState::tracked || s == TrackingState::relocalised ? kGood : kBad;
}

}  // namespace

cv::Scalar weight_colour(double weight) {
  constexpr std::array<std::array<double, 3>, 3> kStops{{{255, 59, 48}, {255, 176, 0}, {63, 208, 255}}};
  const double x = std::isfinite(weight) ? 2 * std::clamp(weight, 0.0, 1.0) : 2;
  const std::size_t i = x < 1 ? 0 : 1;
  const auto mix = [&](std::size_t k) {
    return std::round(kStops[i][k] + (kStops[i + 1][k] - kStops[i][k]) * (x - static_cast<double>(i)));
  };
  return {mix(2), mix(1), mix(0)};
}

std::string frame_text(const ViewFrame& frame) {
  if (frame.number == 0) return "no frame yet";
  const std::string of = frame.total > 0 ? fmt::format(" of {}", frame.total) : std::string();
  return fmt::format("frame {}{}, {:.2f} s", frame.number, of, frame.seconds);
}

std::string state_text(const ViewScene& scene) {
  std::string text(to_string(scene.frame.state));
  if (scene.frame.keyframe) text += ", keyframe";
  if (scene.paused) text += ", paused";
  return text;
}

ViewLayout view_layout(const PainterOptions& options) {
  constexpr int kSmallest = 480, kEnlarged = 640, kWidest = 960, kHighest = 600;  // pictures [px]
  constexpr int kLeastWidth = 440, kLeastHeight = 340;                            // of the place for it
  const cv::Size image = options.image;
  check_argument(image.width > 0 && image.height > 0, "view_layout(): the image must have pixels");
  ViewLayout layout;
  if (image.width < kSmallest) layout.scale = double(kEnlarged) / image.width;
  layout.scale = std::min({layout.scale, double(kWidest) / image.width, double(kHighest) / image.height});
  const cv::Size shown(std::max(1, cvRound(layout.scale * image.width)),
                       std::max(1, cvRound(layout.scale * image.height)));
  const cv::Size place(std::max(shown.width, kLeastWidth), std::max(shown.height, kLeastHeight));
  layout.picture = {kGap + (place.width - shown.width) / 2, kHeader + (place.height - shown.height) / 2,
                    shown.width, shown.height};
  const int side = std::clamp(cvRound(0.72 * place.height), 320, 370), left = 2 * kGap + place.width;
  layout.canvas = {left + side + kGap, kHeader + place.height + kFooter};
  layout.header = {0, 0, layout.canvas.width, kHeader};
  layout.footer = {0, kHeader + place.height, layout.canvas.width, kFooter};
  layout.trajectory = {left, kHeader, side, place.height};
  if (options.map) {
    const int half = (place.height - kGap) / 2;
    layout.map = {left, kHeader + place.height - half, side, half};
    layout.trajectory.height = place.height - half - kGap;
  }
  return layout;
}

struct ViewPainter::State {
  explicit State(const PainterOptions& o) : options(o), layout(view_layout(o)), plans(o, layout) {
    canvas.create(layout.canvas, CV_8UC3);
  }
  void draw_header(const ViewScene& scene);
  void draw_picture(const ViewScene& scene);
  void draw_footer();

  PainterOptions options;
  ViewLayout layout;
  ViewPlans plans;
  cv::Mat canvas;
};

void ViewPainter::State::draw_header(const ViewScene& scene) {
  const cv::Rect& box = layout.header;
  int at = write(canvas, frame_text(scene.frame), box, kGap, kLarge, kInk) + 30;
  if (scene.frame.number == 0) return;
  cv::circle(canvas, {at, box.y + box.height / 2}, 5, colour_of_state(scene), cv::FILLED, cv::LINE_AA);
  at = write(canvas, state_text(scene), box, at + 12, kLarge, colour_of_state(scene));
  const std::string numbers = fmt::format("{} matches, {} inliers", scene.frame.matches, scene.frame.inliers);
  const int left = box.width - kGap - text_width(numbers, kSmall);
  if (left > at + 20) write(canvas, numbers, box, left, kSmall, kSoft);
}

void ViewPainter::State::draw_picture(const ViewScene& scene) {
  const ViewFrame& frame = scene.frame;
  check_optional_image(frame.bgr, options.image, CV_8UC3, "ViewPainter::paint(): the image");
  check_optional_image(frame.semantic, options.image, CV_8UC1, "ViewPainter::paint(): the semantic mask");
  check_optional_image(frame.geometric, options.image, CV_8UC1, "ViewPainter::paint(): the geometric mask");
  cv::Mat picture = canvas(layout.picture);
  if (frame.bgr.empty()) {
    picture.setTo(kPlan);
    return;
  }
  cv::resize(frame.bgr, picture, picture.size(), 0, 0, layout.scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  if (!frame.semantic.empty()) tint(picture, frame.semantic, kSemantic);
  if (!frame.geometric.empty()) tint(picture, frame.geometric, kGeometric);
  draw_keypoints(picture, frame.keypoints, layout.scale);
}

void ViewPainter::State::draw_footer() {
  const cv::Rect& box = layout.footer;
  const std::string keys = "Space: pause   Esc: close, the run goes on";
  const int left = box.width - kGap - text_width(keys, kSmall);
  write(canvas, keys, box, left, kSmall, kSoft);
  int at = kGap;
  const auto room = [&](int width) { return at + width + 20 < left; };
  if (uses_geometry(options.dynamics)) {
    constexpr int kRamp = 70, kRampHeight = 8;
    const std::string before = "static weight 0";
    if (!room(text_width(before, kSmall) + kRamp + 30)) return;
    at = write(canvas, before, box, at, kSmall, kSoft) + 7;
    for (int i = 0; i < kRamp; ++i)
      cv::line(canvas, {at + i, box.y + (box.height - kRampHeight) / 2},
               {at + i, box.y + (box.height + kRampHeight) / 2}, weight_colour(double(i) / (kRamp - 1)));
    at = write(canvas, "1", box, at + kRamp + 7, kSmall, kSoft) + 20;
  }
  const auto name = [&](const std::string& text, const cv::Scalar& colour) {
    if (room(legend_width(text))) at = write_legend(canvas, text, box, at, colour) + 20;
  };
  if (uses_semantic(options.dynamics)) name("semantic mask", kSemantic);
  if (uses_geometry(options.dynamics)) name("geometric mask", kGeometric);
  if (options.dynamics == DynamicsMode::none) write(canvas, "no masks", box, at, kSmall, kSoft);
}

ViewPainter::ViewPainter(const PainterOptions& options) : state_(std::make_unique<State>(options)) {}

ViewPainter::~ViewPainter() = default;

const cv::Mat& ViewPainter::paint(const ViewScene& scene) {
  state_->canvas.setTo(kPage);
  state_->draw_header(scene);
  state_->draw_picture(scene);
  state_->plans.draw(state_->canvas, scene);
  state_->draw_footer();
  return state_->canvas;
}

const ViewLayout& ViewPainter::layout() const {
  return state_->layout;
}

}  // namespace dynslam::runtime
