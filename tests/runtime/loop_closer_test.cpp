// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/loop_closer.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "random.hpp"

using namespace dynslam;
using namespace dynslam::runtime;

namespace {

constexpr double kRadius = 3.0;  // of the round room
const DepthNoise<double> kNoise{0.005, 0.0};
constexpr double kStep = 10.0;      // degrees between keyframes
constexpr std::size_t kMemory = 5;  // keyframes after which a point is no longer recognised by tracking

CameraConfig camera() {
  CameraConfig c;
  c.name = "test";
  c.width = 640;
  c.height = 480;
  c.model = PinholeBrownConrady<double>(Pinhole<double>(525, 525, 319.5, 239.5), BrownConrady<double>{});
  return c;
}

Descriptor random_descriptor(test::Rng& rng) {
  Descriptor d;
  for (auto& word : d) word = rng.engine()();
  return d;
}

/// A camera in a round room that looks outwards and turns around once, with drift; what comes into view
/// a second time is mapped a second time.
struct Room {
  CameraConfig config = camera();
  LocalMap map;
  PlaceIndex index;
  std::vector<SE3d> truth;  // T_c_w
  std::vector<Eigen::Vector3d> points;
  std::vector<Descriptor> descriptors;
  SE3d::Vector6 drift = SE3d::Vector6::Zero();
  test::Rng rng{"round room"};

  Room() {
    drift << 0.006, 0.002, -0.004, 0.0005, 0.002, -0.0005;
    for (int j = 0; j < 4000; ++j) {
      const double a = rng.uniform(0, 2 * std::numbers::pi), z = rng.uniform(-0.6, 0.6);
      points.emplace_back(kRadius *
                          Eigen::Vector3d(std::cos(a) * std::cos(z), std::sin(z), std::sin(a) * std::cos(z)));
      descriptors.push_back(random_descriptor(rng));
    }
  }

  [[nodiscard]] cv::Mat depth(const SE3d& T_c_w) const {
    cv::Mat image(480, 640, CV_32F);
    const SE3d T_w_c = T_c_w.inverse();
    for (int v = 0; v < 480; ++v) {
      for (int u = 0; u < 640; ++u) {
        const Eigen::Vector3d ray = config.model.pinhole().ray(Eigen::Vector2d(u, v));
        const Eigen::Vector3d d = T_w_c.so3() * ray, o = T_w_c.translation();
        const double a = d.squaredNorm(), b = d.dot(o), c = o.squaredNorm() - kRadius * kRadius;
        image.at<float>(v, u) = static_cast<float>((-b + std::sqrt(b * b - a * c)) / a);
      }
    }
    return image;
  }

  /// The next keyframe, put into the map as tracking would have it: beside its predecessor, with drift.
  int add() {
    const auto k = truth.size();
    const double a = kStep * static_cast<double>(k) * std::numbers::pi / 180;
    const SE3d T_w_c(SO3d::exp(Eigen::Vector3d(0, a, 0)),
                     Eigen::Vector3d(0.5 * std::sin(a), 0, 0.5 * std::cos(a)));
    truth.push_back(T_w_c.inverse());
    Frame f;
    f.index = k;
    f.T_c_w = k == 0 ? truth[0]
                     : SE3d::exp(drift) * truth[k] * truth[k - 1].inverse() *
                           map.keyframe(static_cast<int>(k) - 1).frame.T_c_w;
    active.resize(points.size(), -1);
    seen.resize(points.size(), 0);
    for (std::size_t j = 0; j < points.size(); ++j) {
      const Eigen::Vector3d p_c = truth[k] * points[j];
      const auto x = config.model.pinhole().project(p_c);
      if (!x || x->x() < 0 || x->y() < 0 || x->x() > 639 || x->y() > 479) continue;
      Feature feature;
      feature.u = feature.x = static_cast<float>(x->x() + 0.3 * rng.normal());
      feature.v = feature.y = static_cast<float>(x->y() + 0.3 * rng.normal());
      feature.sigma = 0.5F;
      feature.depth = static_cast<float>(p_c.z() + 0.005 * rng.normal());
      f.features.push_back(feature);
      f.descriptors.push_back(descriptors[j]);
      for (int bit = 0; bit < 12; ++bit)
        f.descriptors.back()[static_cast<std::size_t>(rng.integer(0, 3))] ^= 1ULL << rng.integer(0, 63);
      active[j] = map.present(active[j]);
      if (active[j] < 0 || k - seen[j] > kMemory) {
        MapPoint p;
        p.p_w = f.T_c_w.inverse() *
                Eigen::Vector3d(config.model.pinhole().ray(Eigen::Vector2d(feature.x, feature.y)) *
                                static_cast<double>(feature.depth));
        p.descriptor = f.descriptors.back();
        active[j] = map.add_point(p);
      }
      seen[j] = k;
      f.point.push_back(active[j]);
      f.dynamic.push_back(0);
    }
    f.grid.build(f.features, 640, 480);
    return map.add_keyframe(f);
  }

  /// Of the motion between two keyframes [m].
  [[nodiscard]] double error(int from, int to) const {
    const SE3d true_motion =
        truth[static_cast<std::size_t>(to)] * truth[static_cast<std::size_t>(from)].inverse();
    return (map.pose(to) * map.pose(from).inverse() * true_motion.inverse()).translation().norm();
  }

  /// Share of the sights whose point lies more than 8 px beside them.
  [[nodiscard]] double doubted_sights() {
    int wrong = 0, sights = 0;
    for (const Keyframe& k : map.keyframes()) {
      for (std::size_t i = 0; i < k.frame.point.size(); ++i) {
        if (k.frame.point[i] < 0) continue;
        const auto x = config.model.pinhole().project(k.frame.T_c_w * map.point(k.frame.point[i]).p_w);
        ++sights;
        wrong +=
            !x || (*x - Eigen::Vector2d(k.frame.features[i].x, k.frame.features[i].y)).norm() > 8 ? 1 : 0;
      }
    }
    return static_cast<double>(wrong) / sights;
  }

  std::vector<int> active;
  std::vector<std::size_t> seen;
};

}  // namespace

TEST_CASE("coming around once more takes the drift out of the poses and the doubles out of the map") {
  Room room;
  LoopCloser closer(room.config, kNoise, LoopOptions{});
  for (int k = 0; k < 36; ++k) {
    const int id = room.add();
    room.index.add(id, room.map.keyframe(id).frame);
  }
  const int last = room.add();  // the first one's view again
  const double drifted = room.error(0, last), doubted = room.doubted_sights();
  const SE3d before = room.map.pose(last);
  const auto closing = closer.close(room.map, room.index, last, room.depth(room.truth.back()));
  REQUIRE(closing);
  CHECK(drifted > 0.06);
  CHECK(room.error(closing->seen_again, last) < 0.2 * drifted);
  CHECK((before * closing->D * room.map.pose(last).inverse()).log().norm() < 1e-9);
  CHECK(closing->seen_again <= 2);
  CHECK(closing->merged > 100);
  // Points went with the keyframes that see them.
  CHECK(room.doubted_sights() < doubted + 0.02);
  // The ends are neighbours now: the same loop is not found again.
  room.index.add(last, room.map.keyframe(last).frame);
  CHECK_FALSE(closer.close(room.map, room.index, last, room.depth(room.truth.back())));
}

TEST_CASE("a copy of a place elsewhere in the room is no loop") {
  Room room;
  // What is on one side hangs on the other side, too: same pictures, same distances.
  const auto half = room.points.size() / 2;
  const SO3d turn = SO3d::exp(Eigen::Vector3d(0, std::numbers::pi, 0));
  for (std::size_t j = 0; j < half; ++j) {
    room.points[half + j] = turn * room.points[j];
    room.descriptors[half + j] = room.descriptors[j];
  }
  LoopCloser closer(room.config, kNoise, LoopOptions{});
  for (int k = 0; k < 30; ++k) {
    const int id = room.add();
    CHECK_FALSE(closer.close(room.map, room.index, id, room.depth(room.truth.back())));
    room.index.add(id, room.map.keyframe(id).frame);
  }
}

TEST_CASE("a place is confirmed by its points, and refused where the depth image looks through them") {
  Room room;
  room.drift.setZero();
  for (int k = 0; k < 4; ++k) (void)room.add();
  PlaceVerifier verifier(room.config, kNoise, PlaceOptions{});
  const Frame frame = room.map.keyframe(3).frame;
  const cv::Mat depth = room.depth(room.truth[3]);
  const auto found = verifier.verify(room.map, frame, depth, 1);
  REQUIRE(found);
  CHECK(found->matches.size() > 100);
  CHECK((found->T_c_w * room.truth[3].inverse()).translation().norm() < 0.01);
  const cv::Mat farther = depth * 1.5;
  CHECK_FALSE(verifier.verify(room.map, frame, farther, 1));
  const cv::Mat nearer =
      depth * 0.7;  // people stand in front: no reason to doubt the place, but none to confirm
  CHECK_FALSE(verifier.verify(room.map, frame, nearer, 1));
  const cv::Mat none(480, 640, CV_32F, cv::Scalar(std::nan("")));
  CHECK_FALSE(verifier.verify(room.map, frame, none, 1));
}

TEST_CASE("the index names the keyframes that show the same things, best first, and forgets culled ones") {
  Room room;
  for (int k = 0; k < 20; ++k) {
    const int id = room.add();
    room.index.add(id, room.map.keyframe(id).frame);
  }
  const Frame frame = room.map.keyframe(10).frame;
  std::vector<std::pair<int, int>> found;
  room.index.query(frame, found);
  REQUIRE(found.size() > 3);
  CHECK(found[0].second == 10);
  CHECK(std::abs(found[1].second - 10) == 1);
  CHECK(std::abs(found[2].second - 10) == 1);
  for (const auto& [votes, k] : found) CHECK((votes < 20 || std::abs(k - 10) <= 6));
  room.index.remove(10);
  room.index.query(frame, found);
  CHECK(std::none_of(found.begin(), found.end(), [](const auto& f) { return f.second == 10; }));
}
