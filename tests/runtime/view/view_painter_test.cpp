// SPDX-License-Identifier: BSD-3-Clause
// What a view draws, and where.
#include "dynslam/runtime/view/view_painter.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "dynslam/runtime/error.hpp"
#include "view/view_canvas.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

using Bgr = cv::Vec3b;

Bgr bytes_of(const cv::Scalar& colour) {
  return {cv::saturate_cast<std::uint8_t>(colour[0]), cv::saturate_cast<std::uint8_t>(colour[1]),
          cv::saturate_cast<std::uint8_t>(colour[2])};
}

/// Pixels of one colour, but for what smoothing makes of it, within a part of a canvas.
cv::Mat pixels_of(const cv::Mat& canvas, const cv::Rect& part, const cv::Scalar& colour) {
  cv::Mat found;
  cv::inRange(canvas(part), colour - cv::Scalar::all(6), colour + cv::Scalar::all(6), found);
  return found;
}
int count(const cv::Mat& canvas, const cv::Rect& part, const cv::Scalar& colour) {
  return cv::countNonZero(pixels_of(canvas, part, colour));
}

/// A grey ramp, so that no pixel has a colour of the view.
cv::Mat ramp(cv::Size size) {
  cv::Mat image(size, CV_8UC3);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u)
      image.at<Bgr>(v, u) = Bgr::all(static_cast<std::uint8_t>((u + v) % 200));
  }
  return image;
}

ViewScene scene_of(cv::Size size) {
  ViewScene scene;
  scene.frame.number = 12;
  scene.frame.total = 300;
  scene.frame.seconds = 0.367;
  scene.frame.state = TrackingState::tracked;
  scene.frame.bgr = ramp(size);
  return scene;
}

StampedPose<double> at(double t, double x, double z) {
  return {t, SE3<double>(SO3<double>(), Eigen::Vector3d(x, 0, z)), 0};
}

}  // namespace

TEST_CASE("the frame is shown as it is, larger or smaller where the camera's is small or large") {
  PainterOptions options;
  for (const auto& [size, scale] :
       {std::pair(cv::Size(640, 480), 1.0), std::pair(cv::Size(848, 480), 1.0),
        std::pair(cv::Size(320, 240), 2.0), std::pair(cv::Size(1280, 720), 0.75),
        std::pair(cv::Size(480, 640), 0.9375), std::pair(cv::Size(1920, 30), 0.5)}) {
    options.image = size;
    ViewPainter painter(options);
    const ViewLayout& layout = painter.layout();
    CAPTURE(options.image);
    CHECK(layout.scale == doctest::Approx(scale));
    CHECK(layout.picture.width == cvRound(scale * size.width));
    CHECK(layout.picture.height == cvRound(scale * size.height));
    CHECK(layout.canvas.width <= 1366);
    CHECK(layout.canvas.height <= 700);
    const cv::Rect all({0, 0}, layout.canvas);
    const std::array parts{layout.header, layout.picture, layout.trajectory, layout.map, layout.footer};
    for (std::size_t i = 0; i < parts.size(); ++i) {
      CHECK((parts[i] & all) == parts[i]);
      for (std::size_t k = i + 1; k < parts.size(); ++k) CHECK((parts[i] & parts[k]).empty());
    }
    const ViewScene scene = scene_of(size);
    const cv::Mat& canvas = painter.paint(scene);
    REQUIRE(canvas.size() == layout.canvas);
    cv::Mat expected = scene.frame.bgr;
    if (scale != 1)
      cv::resize(scene.frame.bgr, expected, layout.picture.size(), 0, 0,
                 scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    CHECK(cv::norm(canvas(layout.picture), expected, cv::NORM_INF) == 0);
  }
}

TEST_CASE("keypoints stand at their pixels in the colour of their static weight") {
  for (const cv::Size size : {cv::Size(640, 480), cv::Size(320, 240)}) {
    PainterOptions options;
    options.image = size;
    ViewPainter painter(options);
    ViewScene scene = scene_of(size);
    scene.frame.keypoints = {{{100, 50}, 0.0}, {{200, 120}, 1.0}, {{60, 200}, 0.25}};
    const cv::Mat& canvas = painter.paint(scene);
    const ViewLayout& layout = painter.layout();
    for (const ViewKeypoint& k : scene.frame.keypoints) {
      const cv::Point there(layout.picture.x + cvRound((double(k.pixel.x) + 0.5) * layout.scale - 0.5),
                            layout.picture.y + cvRound((double(k.pixel.y) + 0.5) * layout.scale - 0.5));
      CAPTURE(there);
      CHECK(canvas.at<Bgr>(there) == bytes_of(weight_colour(k.weight)));
    }
    ViewScene plain = scene;
    plain.frame.keypoints.clear();
    const cv::Mat with = canvas.clone();
    cv::Mat other = with != painter.paint(plain);
    cv::cvtColor(other, other, cv::COLOR_BGR2GRAY);
    // A spot of some pixels for each, and no other pixel.
    CHECK(cv::countNonZero(other) > 3 * 20);
    CHECK(cv::countNonZero(other) < 3 * 100);
  }
  // As the page of reports has it.
  CHECK(weight_colour(0) == cv::Scalar(48, 59, 255));
  CHECK(weight_colour(0.5) == cv::Scalar(0, 176, 255));
  CHECK(weight_colour(1) == cv::Scalar(255, 208, 63));
  CHECK(weight_colour(7) == weight_colour(1));
  CHECK(weight_colour(std::nan("")) == weight_colour(1));
}

TEST_CASE("masks tint what they cover, each in its colour, and nothing else") {
  ViewPainter painter({});
  ViewScene scene = scene_of({640, 480});
  scene.frame.semantic = cv::Mat::zeros(480, 640, CV_8UC1);
  scene.frame.geometric = cv::Mat::zeros(480, 640, CV_8UC1);
  scene.frame.semantic(cv::Rect(100, 100, 100, 100)) = 255;
  scene.frame.geometric(cv::Rect(300, 100, 100, 100)) = 1;  // whatever is not 0
  const cv::Mat& canvas = painter.paint(scene);
  const cv::Point origin = painter.layout().picture.tl();
  const auto mixed = [&](cv::Point p, const cv::Scalar& colour) {
    const Bgr seen = scene.frame.bgr.at<Bgr>(p), drawn = canvas.at<Bgr>(origin + p);
    for (int k = 0; k < 3; ++k) CHECK(std::abs(drawn[k] - (0.55 * seen[k] + 0.45 * colour[k])) <= 1.0);
  };
  mixed({150, 150}, viewing::kSemantic);
  mixed({350, 150}, viewing::kGeometric);
  for (const cv::Point p :
       {cv::Point(98, 150), cv::Point(201, 150), cv::Point(250, 150), cv::Point(350, 300)})
    CHECK(canvas.at<Bgr>(origin + p) == scene.frame.bgr.at<Bgr>(p));
  scene.frame.semantic = cv::Mat::zeros(10, 10, CV_8UC1);
  CHECK_THROWS_AS((void)painter.paint(scene), UsageError);
}

TEST_CASE("the trajectory is drawn from above, to scale, ahead being up, beside the ground truth") {
  ViewPainter painter({});
  ViewScene scene = scene_of({640, 480});
  // A metre to the right, then half a metre ahead; the truth 30 cm behind the beginning.
  for (int i = 0; i <= 20; ++i) scene.trajectory.push_back(at(0.1 * i, 0.05 * i, 0));
  for (int i = 1; i <= 20; ++i) scene.trajectory.push_back(at(2 + 0.1 * i, 1, 0.025 * i));
  for (int i = 0; i <= 20; ++i) scene.truth.push_back(at(0.1 * i, 0.05 * i, -0.3));
  const cv::Mat& canvas = painter.paint(scene);
  cv::Rect plan = painter.layout().trajectory;
  plan.y += 26;  // below its caption, which has the colours, too
  plan.height -= 26 + 24;
  const auto box_of = [&](const cv::Scalar& colour) {
    std::vector<cv::Point> places;
    cv::findNonZero(pixels_of(canvas, plan, colour), places);
    REQUIRE_FALSE(places.empty());
    return cv::boundingRect(places);
  };
  const cv::Rect truth = box_of(viewing::kTruth);
  const double metre = truth.width;
  REQUIRE(metre > 100);
  // The corner of the path and its two ends; the wedge of the camera lies beyond the second end.
  const cv::Mat run = pixels_of(canvas, plan, viewing::kRun);
  const auto drawn = [&](double x, double z) {
    const cv::Point p(cvRound(truth.x + metre * x),
                      cvRound(truth.y + truth.height / 2.0 - metre * (z + 0.3)));
    const cv::Rect near = cv::Rect(p.x - 3, p.y - 3, 7, 7) & cv::Rect({0, 0}, run.size());
    return cv::countNonZero(run(near)) > 0;
  };
  CHECK(drawn(0, 0));
  CHECK(drawn(0.5, 0));
  CHECK(drawn(1, 0));
  CHECK(drawn(1, 0.5));
  CHECK_FALSE(drawn(0, 0.4));
  CHECK_FALSE(drawn(0.5, 0.25));
  CHECK_FALSE(drawn(0.5, -0.15));
}

TEST_CASE("time without a pose is a gap in the trajectory") {
  const auto pixels = [](double pause) {
    ViewPainter painter({});
    ViewScene scene = scene_of({640, 480});
    scene.trajectory = {at(0, 0, 0), at(0.1, 0.1, 0), at(0.1 + pause, 0.9, 0), at(0.2 + pause, 1, 0)};
    return count(painter.paint(scene), painter.layout().trajectory, viewing::kRun);
  };
  CHECK(pixels(0.1) > pixels(3) + 100);
}

TEST_CASE("voxels are drawn from above in the colours of their classes, the higher ones on top") {
  ViewPainter painter({});
  ViewScene scene = scene_of({640, 480});
  scene.trajectory = {at(0, 0, 0)};
  const Rgb chair = class_colour(static_cast<std::uint8_t>(Label::chair)), low{10, 250, 10},
            high{250, 250, 10};
  for (int i = -20; i < 20; ++i) {
    for (int k = 1; k < 20; ++k) {  // up is -y
      scene.voxels.push_back({{0.05F * float(i), 1, 0.05F * float(k)}, 0.05F, 0, low});
      if (i >= 0) scene.voxels.push_back({{0.05F * float(i), 0, 0.05F * float(k)}, 0.05F, 0, high});
      if (i >= 10) scene.voxels.push_back({{0.05F * float(i), 0.5F, 0.05F * float(k)}, 0.05F, 2, chair});
    }
  }
  scene.map_version = 1;
  const ViewLayout layout = painter.layout();
  const cv::Mat first = painter.paint(scene).clone();
  const auto bgr = [](const Rgb& c, double shade) { return cv::Scalar(c[2], c[1], c[0]) * shade; };
  const cv::Rect plan(layout.map.x + 1, layout.map.y + 25, layout.map.width - 2, layout.map.height - 26);
  const int halves = count(first, plan, bgr(low, 0.5)), quarters = count(first, plan, bgr(chair, 1));
  CHECK(halves > 1000);
  CHECK(quarters > 500);
  // Half is low, a quarter high and a quarter a chair, which is shown though something hangs above it.
  CHECK(quarters == doctest::Approx(halves / 2.0).epsilon(0.15));
  CHECK(count(first, plan, bgr(high, 1)) == doctest::Approx(halves / 2.0).epsilon(0.25));
  scene.voxels.clear();
  ++scene.map_version;
  CHECK(count(painter.paint(scene), plan, bgr(chair, 1)) == 0);

  PainterOptions without;
  without.map = false;
  CHECK(view_layout(without).map.empty());
  CHECK(view_layout(without).trajectory.height == view_layout(without).picture.height);
  ViewPainter plain(without);
  CHECK(count(plain.paint(scene), view_layout(without).trajectory, viewing::kRun) > 0);
}

TEST_CASE("the head says which frame it is and whether the camera is known") {
  ViewScene scene = scene_of({640, 480});
  CHECK(frame_text(scene.frame) == "frame 12 of 300, 0.37 s");
  CHECK(state_text(scene) == "tracked");
  scene.frame.keyframe = true;
  CHECK(state_text(scene) == "tracked, keyframe");
  scene.frame.keyframe = false;
  ViewPainter painter({});
  const cv::Rect head = painter.layout().header;
  const cv::Mat tracked = painter.paint(scene)(head).clone();
  CHECK(count(tracked, {{0, 0}, head.size()}, viewing::kGood) > 20);
  CHECK(count(tracked, {{0, 0}, head.size()}, viewing::kBad) == 0);
  ++scene.frame.number;
  CHECK(cv::norm(painter.paint(scene)(head), tracked, cv::NORM_INF) > 0);
  scene.frame.state = TrackingState::lost;
  CHECK(state_text(scene) == "lost");
  const cv::Mat& lost = painter.paint(scene);
  CHECK(count(lost, head, viewing::kBad) > 20);
  CHECK(count(lost, head, viewing::kGood) == 0);
  scene.paused = true;
  CHECK(state_text(scene) == "lost, paused");
  CHECK(frame_text(ViewFrame()) == "no frame yet");
  PainterOptions nothing;
  nothing.image = {0, 480};
  CHECK_THROWS_AS(ViewPainter{nothing}, UsageError);
}
