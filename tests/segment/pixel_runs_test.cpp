// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/segment/pixel_runs.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "dynslam/segment/mask.hpp"
#include "image_kinds.hpp"
#include "random.hpp"

using namespace dynslam;

TEST_CASE_TEMPLATE("a row becomes bits, runs and a row again, whatever its width", T, std::uint8_t, int,
                   bool) {
  test::Rng rng("rows as bits");
  for (const int w : {0, 1, 7, 8, 63, 64, 65, 127, 128, 200}) {
    for (const double density : {0.0, 0.1, 0.5, 0.97, 1.0}) {
      std::vector<char> row(static_cast<std::size_t>(w)), back(row.size() + 1, 7);
      const auto pixels = [&](int u) { return static_cast<T>(row[static_cast<std::size_t>(u)] * 64); };
      struct Row {
        decltype(pixels)& at;
        auto operator[](int u) const { return at(u); }
      };
      for (char& pixel : row) pixel = rng.chance(density) ? 1 : 0;
      std::vector<std::uint64_t> bits(detail::words_of_row(w) + 1, 77);
      detail::row_to_bits(Row{pixels}, w, bits.data());
      CHECK(bits.back() == 77);
      bits.pop_back();
      for (std::size_t i = 0; i < 64 * bits.size(); ++i)
        REQUIRE((bits[i / 64] >> (i % 64) & 1) == (i < row.size() && row[i] != 0 ? 1 : 0));
      std::vector<char> from_runs(row.size());
      int end_before = -1;
      detail::for_runs(bits.data(), w, [&](int begin, int end) {
        CHECK(begin > end_before);  // runs that touched would be one
        CHECK(end > begin);
        for (int u = begin; u < end; ++u) from_runs[static_cast<std::size_t>(u)] = 1;
        end_before = end;
      });
      CHECK(from_runs == row);
      detail::bits_to_row(bits.data(), w, char(1), back.data());
      CHECK(back.back() == 7);
      back.pop_back();
      CHECK(back == row);
    }
  }
}

TEST_CASE(
    "components, specks and holes of rows of several words are those of a flood, in any kind of image") {
  test::Rng rng("components by runs");
  MaskWorkspace ws;
  const auto flood = [](const Image<std::uint8_t>& mask, bool set, Connectivity connectivity, auto&& visit) {
    Image<std::uint8_t> seen(mask.width(), mask.height());
    for (int v = 0; v < mask.height(); ++v) {
      for (int u = 0; u < mask.width(); ++u) {
        if ((mask(u, v) != 0) != set || seen(u, v) != 0) continue;
        std::vector<std::pair<int, int>> part{{u, v}};
        seen(u, v) = 1;
        for (std::size_t k = 0; k < part.size(); ++k) {
          for (int dv = -1; dv <= 1; ++dv) {
            for (int du = -1; du <= 1; ++du) {
              const int x = part[k].first + du, y = part[k].second + dv;
              if (connectivity == Connectivity::four && du * dv != 0) continue;
              if (!mask.contains(x, y) || (mask(x, y) != 0) != set || seen(x, y) != 0) continue;
              seen(x, y) = 1;
              part.emplace_back(x, y);
            }
          }
        }
        visit(part);
      }
    }
  };
  for (const auto& size :
       {std::pair{1, 90}, std::pair{90, 1}, std::pair{64, 9}, std::pair{65, 11}, std::pair{150, 40}}) {
    const int w = size.first, h = size.second;
    for (const double density : {0.05, 0.4, 0.6, 0.95}) {
      CAPTURE(w);
      CAPTURE(h);
      CAPTURE(density);
      Image<std::uint8_t> mask(w, h);
      for (int i = 0; i < w * h; ++i) mask.data()[i] = rng.chance(density) ? 5 : 0;
      for (const Connectivity connectivity : {Connectivity::four, Connectivity::eight}) {
        Image<int> expected(w, h);
        std::vector<int> sizes{0};
        flood(mask, true, connectivity, [&](const auto& part) {
          for (const auto& [u, v] : part) expected(u, v) = static_cast<int>(sizes.size());
          sizes.push_back(static_cast<int>(part.size()));
        });
        auto labels = test::PlainKind::make(Image<int>(w, h, -1));
        std::vector<int> counts;
        CHECK(connected_components(mask, connectivity, labels, counts) == static_cast<int>(sizes.size()) - 1);
        CHECK(test::pixels_of(labels) == test::pixels_of(expected));
        CHECK(counts == sizes);
        ComponentsWorkspace runs;
        CHECK(component_runs(mask, connectivity, counts, runs) == static_cast<int>(sizes.size()) - 1);
        CHECK(counts == sizes);
        Image<int> painted(w, h, 0);
        for (std::size_t i = 0; i < runs.runs.size(); ++i) {
          for (int u = runs.runs[i].begin; u < runs.runs[i].end; ++u)
            painted(u, runs.runs[i].v) = runs.number[i];
        }
        CHECK(test::pixels_of(painted) == test::pixels_of(expected));
        auto filled = mask;
        flood(mask, false, connectivity, [&](const auto& hole) {
          bool inside = hole.size() <= 9;
          for (const auto& [u, v] : hole) inside = inside && u > 0 && v > 0 && u + 1 < w && v + 1 < h;
          for (const auto& [u, v] : hole) filled(u, v) = inside ? 255 : 0;
        });
        auto result = test::ViewKind::make(mask);
        fill_holes(test::ViewKind::out(result), 9, connectivity, ws);
        CHECK(test::pixels_of(test::ViewKind::in(result)) == test::pixels_of(filled));
      }
      auto cleaned = mask;
      flood(mask, true, Connectivity::eight, [&](const auto& part) {
        for (const auto& [u, v] : part) cleaned(u, v) = part.size() < 4 ? 0 : 5;
      });
      auto result = mask;
      remove_small(result, 4, ws);
      CHECK(test::pixels_of(result) == test::pixels_of(cleaned));
    }
  }
}

TEST_CASE("dilation and erosion across words equal brute force") {
  test::Rng rng("morphology of words");
  MaskWorkspace ws;
  for (const auto& size : {std::pair{63, 4}, std::pair{64, 5}, std::pair{65, 6}, std::pair{200, 7}}) {
    const int w = size.first, h = size.second;
    for (const int radius : {1, 2, 31, 32, 64, 70}) {
      Image<std::uint8_t> in(w, h), grown(w, h), shrunk(w, h);
      for (int i = 0; i < w * h; ++i) in.data()[i] = rng.chance(radius < 9 ? 0.2 : 0.002) ? 1 : 0;
      const auto at = [&](int u, int v, bool grow) {
        for (int y = std::max(0, v - radius); y <= std::min(h - 1, v + radius); ++y) {
          for (int x = std::max(0, u - radius); x <= std::min(w - 1, u + radius); ++x) {
            if ((in(x, y) != 0) == grow) return grow;
          }
        }
        return !grow;
      };
      dilate(in, grown, radius, ws);
      auto inverse = in;
      for (int i = 0; i < w * h; ++i) inverse.data()[i] = in.data()[i] != 0 ? 0 : 1;
      erode(inverse, shrunk, radius, ws);
      bool equal = true;
      for (int v = 0; v < h; ++v) {
        for (int u = 0; u < w; ++u)
          equal = equal && grown(u, v) == (at(u, v, true) ? 255 : 0) &&
                  shrunk(u, v) == (at(u, v, true) ? 0 : 255);
      }
      CAPTURE(w);
      CAPTURE(radius);
      CHECK(equal);
    }
  }
}
