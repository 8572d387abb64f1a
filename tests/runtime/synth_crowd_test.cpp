// SPDX-License-Identifier: BSD-3-Clause
// People who touch floor, counter and chair: what is in contact, and what of it the truth calls dynamic.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/synth/synth.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr double kCounterTop = 0.95;  // m

/// A crowd in small images without noise.
struct CrowdSequence : test::TemporaryFolder {
  Sequence sequence;
  CameraConfig camera;
  CrowdSequence(const std::string& camera_path, int frames, double fps) {
    SynthOptions o;
    o.scenario = "crowd";
    o.path = camera_path;
    o.frames = frames;
    o.fps = fps;
    o.width = 320;
    o.height = 240;
    o.noise = false;
    synthesize(o, path);
    sequence = load_sequence(path);
    camera = load_camera(sequence.camera_hint);
  }
};

/// One frame of it, with its truth.
class TrueFrame {
 public:
  TrueFrame(const CrowdSequence& crowd, std::size_t i)
      : depth(decode_frame(crowd.sequence.frames[i], i, crowd.camera).depth),
        label(image(crowd, i, "label")),
        instance(image(crowd, i, "instance")),
        moving(image(crowd, i, "dynamic_mask")),
        T_w_c(crowd.sequence.groundtruth[i].T_w_c),
        camera_(crowd.camera) {}

  [[nodiscard]] Eigen::Vector3d world(int u, int v) const {
    return T_w_c *
           *camera_.model.unproject(Eigen::Vector2d(u, v), static_cast<double>(depth.at<float>(v, u)));
  }
  [[nodiscard]] Label label_at(int u, int v) const {
    return static_cast<Label>(label.at<std::uint8_t>(v, u));
  }
  [[nodiscard]] bool moves(int u, int v) const { return moving.at<std::uint8_t>(v, u) != 0; }
  [[nodiscard]] std::uint16_t instance_at(int u, int v) const { return instance.at<std::uint16_t>(v, u); }

  /// Calls visit(u, v) for all pixels with depth.
  template <class F>
  void each(const F& visit) const {
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        if (depth.at<float>(v, u) > 0) visit(u, v);
      }
    }
  }

  cv::Mat depth, label, instance, moving;
  SE3d T_w_c;

 private:
  static cv::Mat image(const CrowdSequence& crowd, std::size_t i, const char* folder) {
    return read_image(crowd.path / folder / (crowd.sequence.frames[i].stamp + ".png"), cv::IMREAD_UNCHANGED);
  }
  const CameraConfig& camera_;
};

/// Of each person the pixel nearest to the floor that has floor below it: of the foot that stands. The other
/// one is lifted.
std::map<int, cv::Point> standing_feet(const TrueFrame& frame) {
  std::map<int, cv::Point> feet;
  frame.each([&](int u, int v) {
    if (frame.label_at(u, v) != Label::person || v + 1 >= frame.depth.rows) return;
    if (frame.label_at(u, v + 1) != Label::background || frame.world(u, v + 1).z() > 0.01) return;
    const auto [found, is_new] = feet.try_emplace(frame.instance_at(u, v), u, v);
    if (!is_new && frame.world(u, v).z() < frame.world(found->second.x, found->second.y).z())
      found->second = {u, v};
  });
  return feet;
}

/// How far to the right the seat of the chair that is pushed reaches [m].
double chair_position(const TrueFrame& frame, int chair) {
  double right = -10;
  frame.each([&](int u, int v) {
    if (frame.instance_at(u, v) != chair) return;
    const Eigen::Vector3d p = frame.world(u, v);
    if (p.z() > 0.44 && p.z() < 0.5) right = std::max(right, p.x());
  });
  return right;
}

}  // namespace

TEST_CASE("a crowd walks on the floor in view of every gentle path: soles and floor are at one depth") {
  for (const char* path : {"static", "xyz", "halfsphere"}) {
    CAPTURE(path);
    const CrowdSequence crowd(path, 16, 2);
    std::size_t feet = 0, on_floor = 0;
    for (std::size_t i = 0; i < 16; ++i) {
      CAPTURE(i);
      const TrueFrame frame(crowd, i);
      CHECK(frame.T_w_c.translation().z() > 1.2);
      CHECK(frame.T_w_c.translation().z() < 1.6);
      for (const auto& foot : standing_feet(frame)) {
        CAPTURE(foot.first);
        const auto& pixel = foot.second;
        const double z = static_cast<double>(frame.depth.at<float>(pixel.y, pixel.x));
        const double below = static_cast<double>(frame.depth.at<float>(pixel.y + 1, pixel.x));
        CHECK(z > 2.2);
        CHECK(z < 5);
        ++feet;
        on_floor += frame.world(pixel.x, pixel.y).z() < 0.03 && std::abs(z - below) < 0.06 ? 1 : 0;
      }
    }
    CHECK(feet >= 3 * 14);             // two walkers and one with a chair, of whom one may turn at the rim
    CHECK(on_floor >= feet * 9 / 10);  // a chair or another person may hide the foot that stands
  }
}

TEST_CASE("of a crowd the truth masks people always, the chair while it moves, and nothing that is touched") {
  constexpr std::size_t kFrames = 36;
  const CrowdSequence crowd("static", static_cast<int>(kFrames), 5);  // 7.2 s: pushed and half pulled back
  std::vector<double> position;
  std::vector<bool> masked;
  for (std::size_t i = 0; i < kFrames; ++i) {
    CAPTURE(i);
    const TrueFrame frame(crowd, i);
    int chair = 0, dynamic_chair = 0, chair_pixels = 0, wrong = 0, on_floor = 0;
    frame.each([&](int u, int v) { chair = std::max<int>(chair, frame.instance_at(u, v)); });
    frame.each([&](int u, int v) {
      const bool moves = frame.moves(u, v), is_chair = frame.instance_at(u, v) == chair;
      const bool person = frame.label_at(u, v) == Label::person;
      if (is_chair) {
        CHECK(frame.label_at(u, v) == Label::chair);
        ++chair_pixels;
        dynamic_chair += moves ? 1 : 0;
      } else {
        wrong += moves != person ? 1 : 0;
      }
      on_floor += moves && std::abs(frame.world(u, v).z()) < 1e-3 ? 1 : 0;
    });
    CHECK(wrong == 0);
    CHECK(on_floor < 10);  // the rims of soles and wheels alone
    CHECK(chair_pixels > 500);
    CHECK((dynamic_chair == 0 || dynamic_chair == chair_pixels));
    position.push_back(chair_position(frame, chair));
    masked.push_back(dynamic_chair > 0);
  }
  int moved = 0, stood = 0;
  for (std::size_t i = 1; i + 1 < kFrames; ++i) {
    CAPTURE(i);
    const double before = std::abs(position[i] - position[i - 1]),
                 after = std::abs(position[i + 1] - position[i]);
    if (before > 0.03 && after > 0.03) {
      CHECK(masked[i]);
      ++moved;
    }
    if (before < 0.01 && after < 0.01) {
      CHECK_FALSE(masked[i]);
      ++stood;
    }
  }
  CHECK(moved >= 10);
  CHECK(stood >= 8);
}

TEST_CASE("hands of a crowd touch the counter, which stays static") {
  constexpr std::size_t kFrames = 40;
  const CrowdSequence crowd("xyz", static_cast<int>(kFrames), 8);
  int touching = 0;
  for (std::size_t i = 0; i < kFrames; ++i) {
    const TrueFrame frame(crowd, i);
    bool touches = false;
    frame.each([&](int u, int v) {
      if (v + 1 >= frame.depth.rows || frame.label_at(u, v) != Label::person) return;
      if (frame.label_at(u, v + 1) != Label::background) return;
      const Eigen::Vector3d hand = frame.world(u, v), counter = frame.world(u, v + 1);
      constexpr double kPixel = 0.08;  // m, along the counter's top
      if (std::abs(counter.z() - kCounterTop) > 0.01 || (hand - counter).norm() > kPixel) return;
      touches = true;
      CHECK_FALSE(frame.moves(u, v + 1));
    });
    touching += touches ? 1 : 0;
  }
  CHECK(touching >= 5);
}
