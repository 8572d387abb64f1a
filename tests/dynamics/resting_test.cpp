// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/resting.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

#include "dynslam/image/image.hpp"

using namespace dynslam;

namespace {

/// Three people in columns of 40 pixels each: 1 sits, 2 walks, 3 sits but fidgets.
template <class S>
struct Room {
  Image<std::uint16_t> instances{120, 40};
  Image<std::uint8_t> prior{120, 40, 1}, moving{120, 40};
  Image<S> depth{120, 40, S(2)};

  Room() {
    for (int v = 0; v < 40; ++v) {
      for (int u = 0; u < 120; ++u) {
        instances(u, v) = static_cast<std::uint16_t>(u / 40 + 1);
        if (u >= 80 && v < 4) moving(u, v) = 255;  // a tenth of the third
      }
    }
  }
  using Ids = std::vector<std::uint16_t>;
  [[nodiscard]] Ids resting(const RestingOptions<S>& options = {}) const {
    const auto verified = [](int u, int) { return u < 40 || u >= 80; };
    return resting_instances(instances, prior, depth, moving, verified, options);
  }
};

}  // namespace

TEST_CASE_TEMPLATE("who sits is at rest; who walks, fidgets, or is hardly seen is not", S, float, double) {
  Room<S> room;
  CHECK(room.resting() == std::vector<std::uint16_t>{1});
  RestingOptions<S> tolerant;
  tolerant.max_moving = S(0.2);
  CHECK(room.resting(tolerant) == std::vector<std::uint16_t>{1, 3});

  Room<S> far = room;  // no depth on the first but for a corner of 20 x 20 pixels: 25 samples
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 40; ++u) {
      if (u >= 20 || v >= 20) far.depth(u, v) = std::numeric_limits<S>::quiet_NaN();
    }
  }
  CHECK(far.resting().empty());
  room.prior.fill(0);  // nobody there could move
  CHECK(room.resting().empty());
}

TEST_CASE("the desk that a network takes for a part of somebody who walks is at rest by itself") {
  Room<float> room;
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 120; ++u) {
      room.instances(u, v) = u < 80 ? 7 : 0;  // the second walks before the first, a desk this time
      if (u >= 40 && u < 80) room.moving(u, v) = 255;
    }
  }
  CHECK(room.resting().empty());  // as a whole
  const auto surface = [](int u, int) { return u < 40 ? 3 : 1; };
  Image<std::uint16_t> parts(120, 40, 9);
  CHECK(split_instances(room.instances, surface, parts) == 2);
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 120; ++u) CHECK(parts(u, v) == (u < 40 ? 1 : u < 80 ? 2 : 0));
  }
  room.instances = parts;
  CHECK(room.resting() == std::vector<std::uint16_t>{1});
}

TEST_CASE("parts are told apart by instance and by surface, as many as a pixel can count") {
  Image<std::uint16_t> instances(300, 2, 0);
  for (int u = 0; u < 300; ++u) instances(u, 0) = instances(u, 1) = static_cast<std::uint16_t>(1 + u / 2);
  const auto row = [](int, int v) { return v; };
  Image<std::uint16_t> parts(300, 2);
  CHECK(split_instances(instances, row, parts) == 300);
  CHECK((parts(0, 0) == 1 && parts(1, 0) == 1 && parts(2, 0) == 2 && parts(0, 1) == 151));
  Image<std::uint8_t> few(300, 2);
  CHECK(split_instances(instances, row, few) == 255);
  CHECK((few(2, 0) == 2 && few(299, 0) == 150 && few(207, 1) == 254 && few(208, 1) == 255 &&
         few(299, 1) == 255));
  instances.fill(0);
  CHECK(split_instances(instances, row, few) == 0);
  CHECK(few(299, 1) == 0);
}

TEST_CASE("what rests leaves the mask of what moves, and nothing else does") {
  Room<float> room;
  Image<std::uint8_t> dynamic(120, 40, 255), at_rest(120, 40, 0);
  give_back_resting(room.instances, room.resting(), dynamic, at_rest);
  for (int v = 0; v < 40; v += 7) {
    for (int u = 0; u < 120; ++u) {
      CHECK((dynamic(u, v) == 0) == (u < 40));
      CHECK((at_rest(u, v) == 255) == (u < 40));
    }
  }
}

TEST_CASE("what stands is marked block by block, but for what moves") {
  // 23 x 10 pixels: the last blocks are cut off at the border.
  Image<std::uint8_t> moving(23, 10, 0), still(23, 10, 7);
  moving(5, 5) = 1;
  int asked = 0;
  const auto verified = [&](int u, int v) {
    ++asked;
    CHECK((u < 23 && v < 10));
    return u >= 4 && v >= 4;
  };
  mark_standing(moving, verified, 4, still);
  CHECK(asked == 6 * 3);
  for (int v = 0; v < 10; ++v) {
    for (int u = 0; u < 23; ++u) {
      CAPTURE(u);
      CAPTURE(v);
      CHECK(still(u, v) == (u >= 4 && v >= 4 && !(u == 5 && v == 5) ? 255 : 7));
    }
  }
}

TEST_CASE_TEMPLATE("instances may have any numbers that their type has, void among them", Id, std::int8_t,
                   std::uint8_t, std::int32_t, std::uint32_t, std::int64_t, std::uint64_t) {
  const Room<float> room;
  constexpr Id kVoid = std::numeric_limits<Id>::max();
  Image<Id> instances(120, 40, 0);
  for (int v = 0; v < 40; ++v) {
    for (int u = 0; u < 120; ++u)
      instances(u, v) = u < 40 ? kVoid : u < 80 ? Id(kVoid - 1) : std::is_signed_v<Id> ? Id(-1) : Id(0);
  }
  const auto verified = [](int u, int) { return u < 40; };
  const auto resting =
      resting_instances(instances, room.prior, room.depth, room.moving, verified, RestingOptions<float>{});
  CHECK(resting == std::vector<Id>{kVoid});
  Image<std::uint8_t> dynamic(120, 40, 255), at_rest(120, 40, 0), parts(120, 40);
  give_back_resting(instances, resting, dynamic, at_rest);
  CHECK((dynamic(0, 0) == 0 && dynamic(40, 0) == 255 && dynamic(100, 0) == 255));
  CHECK((at_rest(39, 39) == 255 && at_rest(40, 39) == 0));
  CHECK(split_instances(
            instances, [](int, int) { return 0; }, parts) == 2);
  CHECK((parts(0, 0) == 1 && parts(40, 0) == 2 && parts(119, 39) == 0));
}

TEST_CASE("a number of its own for each pixel costs no more than a sort") {
  constexpr int kWide = 640, kHigh = 480;
  Image<std::uint32_t> instances(kWide, kHigh);
  for (int i = 0; i < kWide * kHigh; ++i)
    instances.data()[i] = 4294967295U - 7919U * static_cast<unsigned>(i);
  const Image<std::uint8_t> all(kWide, kHigh, 1);
  const Image<float> depth(kWide, kHigh, 2.0F);
  const auto verified = [](int, int) { return true; };
  RestingOptions<float> each;
  each.min_samples = 1;
  each.max_moving = 1;
  CHECK(resting_instances(instances, all, depth, all, verified, each).size() == 160 * 120);
  Image<std::uint16_t> parts(kWide, kHigh);
  CHECK(split_instances(
            instances, [](int u, int) { return u; }, parts) == 65535);
  CHECK(parts(kWide - 1, kHigh - 1) == 65535);
}
