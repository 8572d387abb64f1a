// SPDX-License-Identifier: BSD-3-Clause
// Wrong arguments to what is public: an exception that says what was expected, never undefined behaviour.
#include <doctest/doctest.h>

#include <cmath>
#include <exception>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/evaluation/map_render.hpp"
#include "dynslam/runtime/evaluation/plot.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/map_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "dynslam/runtime/nets/mask_keeper.hpp"
#include "dynslam/runtime/nets/onnx_segmenter.hpp"
#include "dynslam/runtime/nets/segmentation_stage.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "dynslam/runtime/slam/frame_preparation.hpp"
#include "dynslam/runtime/slam/saved_map.hpp"
#include "dynslam/runtime/slam/semantic_mapper.hpp"
#include "dynslam/runtime/slam/tracker.hpp"
#include "run_fixture.hpp"
#include "tiny_onnx.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

struct Misuse {
  std::string what;
  std::function<void()> call;
  std::string expected;  ///< a part of the message
};

void check_all(const std::vector<Misuse>& cases) {
  for (const Misuse& misuse : cases) {
    std::string message = "(no exception)";
    try {
      misuse.call();
    } catch (const UsageError& error) {
      message = error.what();
    } catch (const InputError& error) {
      message = error.what();
    }
    CAPTURE(misuse.what);
    CAPTURE(message);
    CHECK(message.find(misuse.expected) != std::string::npos);
    CHECK(message.find('\n') == std::string::npos);
  }
}

const CameraConfig& camera() {
  static const CameraConfig made = load_camera("fr3");
  return made;
}

cv::Mat image(int type, int width = 640, int height = 480) {
  return cv::Mat::zeros(height, width, type);
}

SE3d broken_pose(double number) {
  return SE3d(SO3d(), Eigen::Vector3d(0, number, 0));
}

MapKeyframe keyframe() {
  MapKeyframe k;
  k.depth = image(CV_32FC1);
  k.bgr = image(CV_8UC3);
  k.id = 0;
  return k;
}

RgbdFrame frame(double t) {
  RgbdFrame f;
  f.t = t;
  f.gray = image(CV_8UC1);
  f.bgr = image(CV_8UC3);
  f.depth = image(CV_32FC1);
  return f;
}

template <class Change>
std::function<void()> mapped(Change change) {
  return [change] {
    SemanticMapper mapper(camera().model, 640, 480, {});
    MapKeyframe k = keyframe();
    change(k);
    mapper.insert(std::move(k));
    mapper.finish();
  };
}

template <class Change>
std::function<void()> tracked(Change change) {
  return [change] {
    Tracker tracker(camera(), {});
    (void)tracker.track(frame(1), std::nullopt);
    RgbdFrame f = frame(2);
    std::optional<Masks> prior;
    change(f, prior);
    (void)tracker.track(f, prior);
  };
}

template <class Change>
std::function<void()> camera_with(Change change) {
  return [change] {
    CameraConfig c = camera();
    change(c);
    const Tracker tracker(c, {});
  };
}

}  // namespace

TEST_CASE("the mapper refuses images that are not the camera's, and poses that are none") {
  const std::string depth = "SemanticMapper::insert(): the depth image is ";
  check_all({
      {"empty depth", mapped([](MapKeyframe& k) { k.depth.release(); }),
       depth + "empty; expected 640x480 CV_32FC1"},
      {"small depth", mapped([](MapKeyframe& k) { k.depth = image(CV_32FC1, 320, 240); }),
       depth + "320x240 CV_32FC1; expected 640x480 CV_32FC1"},
      {"raw depth", mapped([](MapKeyframe& k) { k.depth = image(CV_16UC1); }), depth + "640x480 CV_16UC1"},
      {"grey for colour", mapped([](MapKeyframe& k) { k.bgr = image(CV_8UC1); }),
       "the colour image is 640x480 CV_8UC1"},
      {"small mask", mapped([](MapKeyframe& k) { k.dynamic_mask = image(CV_8UC1, 64, 48); }),
       "the mask is 64x48"},
      {"16-bit labels", mapped([](MapKeyframe& k) { k.labels = image(CV_16UC1); }),
       "the label image is 640x480 CV_16UC1"},
      {"NaN pose", mapped([](MapKeyframe& k) { k.T_w_c = broken_pose(kNan); }),
       "the pose has a number that is not finite"},
      {"infinite pose", mapped([](MapKeyframe& k) { k.T_w_c = broken_pose(kInf); }), "not finite"},
      {"NaN correction",
       [] {
         SemanticMapper(camera().model, 640, 480, {}).repose({{0, broken_pose(kNan)}});
       },
       "repose(): a pose"},
      {"no resolution",
       [] {
         SemanticMapperOptions o;
         o.resolution = 0;
         const SemanticMapper mapper(camera().model, 640, 480, o);
       },
       "resolution must be from"},
      {"NaN resolution",
       [] {
         SemanticMapperOptions o;
         o.resolution = kNan;
         const SemanticMapper mapper(camera().model, 640, 480, o);
       },
       "resolution must be from"},
      {"no size", [] { const SemanticMapper mapper(camera().model, 0, 480, {}); }, "width and height"},
  });
}

TEST_CASE("the tracker refuses images, masks and times that do not follow") {
  using Prior = std::optional<Masks>;
  check_all({
      {"empty grey", tracked([](RgbdFrame& f, Prior&) { f.gray.release(); }), "the grey image is empty"},
      {"small depth", tracked([](RgbdFrame& f, Prior&) { f.depth = image(CV_32FC1, 64, 64); }),
       "the depth image is 64x64"},
      {"time goes back", tracked([](RgbdFrame& f, Prior&) { f.t = 0.5; }), "does not come after"},
      {"time stands still", tracked([](RgbdFrame& f, Prior&) { f.t = 1; }), "does not come after"},
      {"NaN time", tracked([](RgbdFrame& f, Prior&) { f.t = kNan; }), "is not a number"},
      {"float mask", tracked([](RgbdFrame&, Prior& p) { p.emplace().dynamic = image(CV_32FC1); }),
       "a-priori mask"},
      {"small labels", tracked([](RgbdFrame&, Prior& p) { p.emplace().labels = image(CV_8UC1, 64, 64); }),
       "label image"},
      {"8-bit instances", tracked([](RgbdFrame&, Prior& p) { p.emplace().instances = image(CV_8UC1); }),
       "instance image"},
      {"late load",
       [] {
         Tracker tracker(camera(), {});
         (void)tracker.track(frame(1), std::nullopt);
         LocalMap map;
         map.add_keyframe({});
         tracker.load(map);
       },
       "comes before the first frame"},
      {"empty map", [] { Tracker(camera(), {}).load({}); }, "has no keyframe"},
      {"no width", camera_with([](CameraConfig& c) { c.width = 0; }), "0x480 pixels"},
      {"negative height", camera_with([](CameraConfig& c) { c.height = -480; }), "640x-480 pixels"},
      {"huge width", camera_with([](CameraConfig& c) { c.width = 1 << 30; }),
       "expected sides from 1 to 8192"},
      {"no focal length", camera_with([](CameraConfig& c) {
         c.model = PinholeBrownConrady<double>(Pinhole<double>(0, 500, 320, 240), BrownConrady<double>{});
       }),
       "fx 0"},
      {"NaN centre", camera_with([](CameraConfig& c) {
         c.model = PinholeBrownConrady<double>(Pinhole<double>(500, 500, kNan, 240), BrownConrady<double>{});
       }),
       "cx nan"},
      {"no depth units", camera_with([](CameraConfig& c) { c.depth_units_per_metre = 0; }), "0 depth units"},
  });
}

TEST_CASE("features, masks and networks refuse images of another kind") {
  const test::TemporaryFolder folder;
  const std::string model = (folder.path / "m.onnx").string();
  test::write_onnx(model, test::colour_network());
  const auto keep = [](cv::Mat gray, cv::Mat depth, std::optional<Masks> masks) {
    return [=] {
      MaskKeeper keeper;
      (void)keeper.update(std::nullopt, image(CV_8UC1), image(CV_32FC1));
      (void)keeper.update(masks, gray, depth);
    };
  };
  const auto masks = [](cv::Mat dynamic, cv::Mat labels = {}, cv::Mat instances = {}) {
    return std::optional<Masks>(Masks{std::move(dynamic), std::move(labels), std::move(instances)});
  };
  const auto extract = [](cv::Mat gray) {
    return [=] {
      ImageFeatures out;
      FeatureExtractor({}).extract(gray, out);
    };
  };
  const auto extractor = [](auto change) {
    return [=] {
      FeatureOptions o;
      change(o);
      const FeatureExtractor made(o);
    };
  };
  const auto segment = [&](cv::Mat bgr) {
    return [=] {
      SegmenterOptions o;
      o.model = model;
      o.engine = EngineKind::opencv;
      (void)OnnxSegmenter(o).segment(bgr);
    };
  };
  const cv::Mat gray = image(CV_8UC1), depth = image(CV_32FC1);
  check_all({
      {"no image", extract({}), "extract(): the image is empty"},
      {"colour", extract(image(CV_8UC3)), "expected any size of CV_8UC1"},
      {"no levels", extractor([](FeatureOptions& o) { o.levels = 0; }), "FeatureExtractor: expected"},
      {"no features", extractor([](FeatureOptions& o) { o.features = 0; }), "FeatureExtractor: expected"},
      {"scale 1", extractor([](FeatureOptions& o) { o.scale_factor = 1; }), "FeatureExtractor: expected"},
      {"other size than before", keep(image(CV_8UC1, 64, 64), image(CV_32FC1, 64, 64), std::nullopt),
       "the grey image is 64x64"},
      {"raw depth", keep(gray, image(CV_16UC1), std::nullopt), "the depth image is 640x480 CV_16UC1"},
      {"no mask", keep(gray, depth, masks({})), "the mask is empty"},
      {"small mask", keep(gray, depth, masks(image(CV_8UC1, 10, 10))), "the mask is 10x10"},
      {"8-bit instances", keep(gray, depth, masks(gray, {}, gray)), "instance image is 640x480 CV_8UC1"},
      {"nothing to segment", segment({}), "segment(): the image is empty"},
      {"grey to segment", segment(gray), "expected any size of CV_8UC3"},
      {"every -1 frames",
       [&] {
         const test::TumFixture tum(1);
         FrameStream frames(load_sequence(tum.path), load_camera((tum.path / "camera.txt").string()));
         SegmentationStageOptions o;
         o.segmenter.model = model;
         o.segmenter.engine = EngineKind::opencv;
         o.every = -1;
         const SegmentationStage stage(frames, o);
       },
       "`every` must be 0 or more"},
  });
}

TEST_CASE("pictures and files refuse what they cannot show") {
  const test::TemporaryFolder folder;
  const interop::SemanticOcTree tree(0.05);
  const auto rendered = [&](auto change) {
    return [&tree, change] {
      MapView view;
      change(view);
      (void)render_map(tree, view);
    };
  };
  check_all({
      {"mask of another size", [] { (void)overlay_mask(image(CV_8UC3), image(CV_8UC1, 64, 64)); },
       "the mask is 64x64"},
      {"grey picture", [] { (void)overlay_mask(image(CV_8UC1), image(CV_8UC1)); },
       "the image is 640x480 CV_8UC1"},
      {"no width", [] { (void)contact_sheet({}, {}, 0); }, "the width must be from 1"},
      {"grey picture in a sheet",
       [] {
         const std::vector<SheetRow> rows{{"a", {image(CV_8UC1)}}};
         (void)contact_sheet(rows, {});
       },
       "a picture is 640x480 CV_8UC1"},
      {"view without size", rendered([](MapView& v) { v.size = {}; }), "expected a size from 1x1"},
      {"view without focal length", rendered([](MapView& v) { v.focal = 0; }), "focal length above 0"},
      {"view from nowhere", rendered([](MapView& v) { v.T_w_c = broken_pose(kNan); }), "not finite"},
      {"NaN in a trajectory",
       [&] {
         const std::vector<StampedPose<double>> poses{{1, broken_pose(kNan)}};
         write_trajectory(folder.path / "t.txt", poses);
       },
       "write_trajectory(): a pose has a number that is not finite"},
      {"NaN time in a trajectory",
       [&] {
         const std::vector<StampedPose<double>> poses{{kNan, SE3d()}};
         write_trajectory(folder.path / "t.txt", poses);
       },
       "a time is not a number"},
      {"empty image", [&] { write_image(folder.path / "e.png", cv::Mat()); }, "e.png: cannot be written"},
      {"image without a kind", [&] { write_image(folder.path / "e.nothing", image(CV_8UC1)); },
       "cannot be written"},
      {"evaluation of nothing", [] { (void)evaluate_trajectory({}, {}, "a", "b"); }, "no ATE: 0 of 0 poses"},
  });
  CHECK_FALSE(std::filesystem::exists(folder.path / "t.txt"));
}
