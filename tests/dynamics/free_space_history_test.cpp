// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/free_space_history.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "equidistant_camera.hpp"
#include "moving_scene.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

template <class S>
struct Fixture {
  DepthGrid grid{Pinhole<S>(S(200), S(200), S(79.5), S(59.5)), 160, 120, {.columns = 40}};
  FreeSpaceHistory<S> history;
  Image<float> depth;
  Image<std::uint8_t> smooth;
  Image<float> still;  ///< belief in a static cell
  MotionEvidence evidence;
  double t = 0;  ///< of the frame at hand [s]
  static constexpr double kFrame = 1 / 30.0;

  Fixture() {
    still.resize(grid.width(), grid.height());
    still.fill(-4);
  }
  /// A wall at 3 m with a box of 1.5 m around column `left` of the image, if it is inside.
  void look(int left) {
    Image<float> image(160, 120, 3.0F);
    for (int v = 40; v < 80; ++v) {
      for (int u = std::max(0, left); u < std::min(160, left + 40); ++u) image(u, v) = 1.5F;
    }
    grid.reduce(image, depth, smooth);
  }
  /// The same box before the wall, seen by a camera that turns by `turn` to the right while it reads the rows
  /// [rad].
  RollingShutter<S> look_turning(S turn) {
    Image<float> image(160, 120, 3.0F);
    for (int v = 0; v < 120; ++v) {
      const S angle = turn * (S(v) / S(119) - S(0.5));
      for (int u = 0; u < 160; ++u) {
        const S beside = std::tan(std::atan((S(u) - S(79.5)) / S(200)) - angle);  // in the middle row's frame
        const bool box = v >= 4 && v < 116 && std::abs(S(200) * beside) < S(20);
        const S along = (box ? S(1.5) : S(3)) * std::sqrt(S(1) + beside * beside);
        image(u, v) = static_cast<float>(along * std::cos(std::atan((S(u) - S(79.5)) / S(200))));
      }
    }
    grid.reduce(image, depth, smooth);
    Eigen::Matrix<S, 6, 1> motion = Eigen::Matrix<S, 6, 1>::Zero();
    motion(4) = turn;
    return RollingShutter<S>(motion, 120);
  }
  [[nodiscard]] int fresh() const {
    int n = 0;
    for (std::size_t c = 0; c < grid.cells(); ++c) n += evidence.fresh.data()[c];
    return n;
  }
};

}  // namespace

TEST_CASE_TEMPLATE(
    "rows that are sheared by a quick turn do not contradict those of another, where it is known", S, float,
    double) {
  const S turn = S(0.07);  // 3 rad/s for 24 ms
  for (const bool known : {true, false}) {
    CAPTURE(known);
    Fixture<S> f;
    for (int k = 0; k < 12; ++k) {
      const auto shutter = f.look_turning(-turn);
      f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence,
                      known ? shutter : RollingShutter<S>());
      f.history.remember(f.depth, f.t, SE3<S>(), f.still);
      f.t += f.kFrame;
    }
    const auto shutter = f.look_turning(turn);
    f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence,
                    known ? shutter : RollingShutter<S>());
    if (known)
      CHECK(f.fresh() == 0);
    else
      CHECK(f.fresh() > 8);  // above and below, beside the box
  }
}

TEST_CASE_TEMPLATE("what has come contradicts the free space, what was there is verified", S, float, double) {
  Fixture<S> f;
  for (int k = 0; k < 12; ++k) {
    f.look(-100);
    f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
    f.history.remember(f.depth, f.t, SE3<S>(), f.still);
    f.t += f.kFrame;
  }
  f.look(60);
  f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
  const auto prior = static_cast<double>(f.history.options().prior);
  CHECK(f.evidence.fresh(19, 15) == 1);
  CHECK(f.evidence.rested(19, 15) == 0);
  CHECK(f.evidence.belief(19, 15) > 1);
  CHECK(f.evidence.fresh(4, 4) == 0);
  CHECK(f.evidence.rested(4, 4) == 1);
  CHECK(static_cast<double>(f.evidence.belief(4, 4)) < prior);

  // A belief goes along with its surface.
  Image<float> moved = f.still;
  moved(19, 15) = 4;
  f.history.clear();
  f.history.remember(f.depth, f.t, SE3<S>(), moved);
  f.history.check(f.grid, f.depth, f.smooth, f.t + 0.05, SE3<S>(), f.evidence);
  const double kept = std::exp(-0.05 / f.history.options().memory);
  CHECK(f.evidence.belief(19, 15) == doctest::Approx(prior + (4 - prior) * kept));
  CHECK(f.evidence.belief(4, 4) == doctest::Approx(prior + (-4 - prior) * kept));
}

TEST_CASE_TEMPLATE("a belief in motion fades with time, however frames come, and ends where the surface stays", S,
                   float, double) {
  for (const double memory : {0.1, 0.7, 10.0}) {
    CAPTURE(memory);
    Fixture<S> f;
    FreeSpaceOptions options;
    options.memory = memory;
    f.history = FreeSpaceHistory<S>(options);
    Image<float> moved = f.still;
    moved(19, 15) = 5;
    f.look(60);
    f.history.remember(f.depth, f.t, SE3<S>(), moved);
    float last = 5;
    for (const double gap : {0.02, 0.06, 0.29, 0.5, 2.0, 20.0}) {
      CAPTURE(gap);
      f.history.check(f.grid, f.depth, f.smooth, f.t + gap, SE3<S>(), f.evidence);
      CHECK(f.evidence.belief(19, 15) <= last);
      last = f.evidence.belief(19, 15);
      CHECK(f.evidence.belief(4, 4) < options.prior);
      CHECK(f.fresh() == 0);
    }
    CHECK(last < (memory < 5 ? options.prior : 0.0F));
  }
}

TEST_CASE_TEMPLATE(
    "a depth image taken half a frame beside its pose makes no moving objects of a static scene", S, float,
    double) {
  const auto seeds = [](double unknown) {
    Fixture<S> f;
    FreeSpaceOptions options;
    options.depth_time_uncertainty = unknown * Fixture<S>::kFrame;
    f.history = FreeSpaceHistory<S>(options);
    for (int k = 0; k < 12; ++k) {
      f.look(60);
      f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
      f.history.remember(f.depth, f.t, SE3<S>(), f.still);
      f.t += f.kFrame;
    }
    // The camera goes aside by 0.15 m, by which the box should be 20 pixels farther left: it is only half
    // way.
    f.look(50);
    f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(SO3<S>(), {S(-0.15), S(0), S(0)}), f.evidence);
    int count = 0;
    for (std::size_t c = 0; c < f.grid.cells(); ++c) count += f.evidence.fresh.data()[c];
    return count;
  };
  CHECK(seeds(0) >= 8);
  CHECK(seeds(0.5) == 0);
}

TEST_CASE_TEMPLATE("lags are times, whenever the frames come", S, float, double) {
  const std::vector<std::vector<double>> rates{
      {0.2}, {0.1}, {1 / 30.0}, {1 / 60.0}, {1 / 400.0}, {0.02, 0.05}, {1 / 15.0, 1 / 30.0, 1 / 30.0}};
  for (const std::vector<double>& intervals : rates) {
    CAPTURE(intervals.front());
    Fixture<S> f;
    f.look(-100);
    std::size_t k = 0;
    while (f.t < 3) {
      f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
      CHECK(f.fresh() == 0);
      f.history.remember(f.depth, f.t, SE3<S>(), f.still);
      f.t += intervals[k++ % intervals.size()];
    }
    CHECK(f.history.size() <= 242);  // two seconds of what is needed
    // A box comes: it is seen at once, and takes as long at any rate to be taken for what stands.
    f.look(60);
    const double came = f.t;
    double rests = 0;
    while (rests == 0 && f.t < came + 4) {
      f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
      CHECK((f.t > came || f.evidence.fresh(19, 15) == 1));
      if (f.evidence.rested(19, 15) == 1) rests = f.t - came;
      f.history.remember(f.depth, f.t, SE3<S>(), f.evidence.belief);
      f.t += intervals[k++ % intervals.size()];
    }
    CHECK(rests == doctest::Approx(4 / 3.0).epsilon(0.06));  // most of the views show it then
  }
}

TEST_CASE_TEMPLATE("what moved is at rest where it has stayed, not where it was gone meanwhile", S, float,
                   double) {
  const auto rested = [](bool gone) {
    Fixture<S> f;
    Image<float> moves = f.still;
    moves.fill(4);
    for (int k = 0; k < 66; ++k) {
      f.look(gone && k >= 48 && k < 54 ? -100 : 60);  // from 0.6 to 0.4 s ago
      f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
      f.history.remember(f.depth, f.t, SE3<S>(), moves);
      f.t += f.kFrame;
    }
    return f.evidence.rested(19, 15) == 1;
  };
  CHECK(rested(false));
  CHECK_FALSE(rested(true));
}

TEST_CASE_TEMPLATE("after a gap longer than all lags, the last view before it tells", S, float, double) {
  Fixture<S> f;
  for (int k = 0; k < 12; ++k) {
    f.look(-100);
    f.history.remember(f.depth, f.t, SE3<S>(), f.still);
    f.t += f.kFrame;
  }
  f.t += 20;
  f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
  CHECK(f.fresh() == 0);
  CHECK(f.evidence.rested(19, 15) == 1);
  f.look(60);
  f.history.check(f.grid, f.depth, f.smooth, f.t, SE3<S>(), f.evidence);
  CHECK(f.evidence.fresh(19, 15) == 1);
  CHECK(f.evidence.fresh(4, 4) == 0);
}

TEST_CASE(
    "a cell has the depth at its centre, or the nearest about it, and is smooth where four of five agree") {
  test::Rng rng("reduce");
  const DepthGridOptions options{.columns = 40};
  for (const auto& size : {std::array{160, 120}, {157, 118}, {40, 30}}) {  // the last: a pixel per cell
    const int width = size[0], height = size[1];
    CAPTURE(width);
    const DepthGrid grid(Pinhole<double>(200, 200, width / 2.0, height / 2.0), width, height, options);
    Image<float> image(width, height), depth;
    Image<std::uint8_t> smooth;
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const double kind = rng.uniform(0, 1);
        image(u, v) = kind < 0.2    ? std::nanf("")
                      : kind < 0.3  ? 0.0F
                      : kind < 0.35 ? -1.0F
                                    : static_cast<float>(2 + rng.uniform(0, kind < 0.9 ? 0.02 : 1.0));
      }
    }
    grid.reduce(image, depth, smooth);
    int unknown = 0, nearest = 0, flat = 0;
    for (std::size_t c = 0; c < grid.cells(); ++c) {
      CAPTURE(c);
      const RecordedPixel centre = grid.pixel_of(c);
      std::vector<float> about;
      for (const auto& [du, dv] : {std::array{0, 0}, {-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        const int u = centre.u + du * (grid.stride() / 2), v = centre.v + dv * (grid.stride() / 2);
        if (centre.u < 0 || u < 0 || v < 0 || u >= width || v >= height) continue;
        if (image(u, v) > 0) about.push_back(image(u, v));
      }
      const bool known = centre.u >= 0 && image(centre.u, centre.v) > 0;
      if (about.empty()) {
        ++unknown;
        CHECK(std::isnan(depth.data()[c]));
        CHECK(smooth.data()[c] == 0);
        continue;
      }
      const auto [lo, hi] = std::minmax_element(about.begin(), about.end());
      nearest += known ? 0 : 1;
      CHECK(depth.data()[c] == (known ? image(centre.u, centre.v) : *lo));
      const bool agrees = about.size() >= 4 && *hi - *lo < options.edge_base + options.edge_quad * *lo * *lo;
      flat += agrees ? 1 : 0;
      CHECK(smooth.data()[c] == (agrees ? 1 : 0));
    }
    CHECK(unknown > 0);
    CHECK((nearest > 50 || grid.stride() == 1));
    CHECK(flat > 50);
  }
}

TEST_CASE_TEMPLATE("a grid knows its pixels and back, through any lens", S, float, double) {
  const auto check = [](const auto& camera, double round_trips) {
    const DepthGrid grid(camera, 160, 120, {.columns = 40});
    int inside = 0, same = 0;
    for (std::size_t c = 0; c < grid.cells(); ++c) {
      const RecordedPixel pixel = grid.pixel_of(c);
      if (pixel.u < 0) continue;
      ++inside;
      same += grid.cell(pixel.u, pixel.v) == static_cast<int>(c) ? 1 : 0;
    }
    CHECK(inside > 800);
    CHECK(same > round_trips * inside);
    CHECK(grid.cell_at(-3.0F, 5.0F) == -1);
    CHECK(grid.cell_at(std::nanf(""), 5.0F) == -1);
  };
  check(Pinhole<S>(S(200), S(200), S(79.5), S(59.5)), 0.98);
  check(test::EquidistantCamera<S>{S(70), S(79.5), S(59.5)},
        0.7);  // at 65 degrees several cells share a pixel
}
