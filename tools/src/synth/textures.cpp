// SPDX-License-Identifier: BSD-3-Clause
#include "synth/textures.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

namespace dynslam::runtime::synth {
namespace {

cv::Scalar colour(Random& r, int low, int high) {
  return {static_cast<double>(r.integer(low, high)), static_cast<double>(r.integer(low, high)),
          static_cast<double>(r.integer(low, high))};
}

/// Smooth-to-fine noise around a base colour: paint, carpet, cloth.
cv::Mat speckle(Random& r, const cv::Scalar& base, int size, double fine, double coarse) {
  cv::Mat small(size / 16, size / 16, CV_32FC1), noise;
  for (auto it = small.begin<float>(); it != small.end<float>(); ++it)
    *it = static_cast<float>(r.normal() * coarse);
  cv::resize(small, noise, {size, size}, 0, 0, cv::INTER_CUBIC);
  cv::Mat image(size, size, CV_8UC3);
  for (int v = 0; v < size; ++v) {
    for (int u = 0; u < size; ++u) {
      const double n = static_cast<double>(noise.at<float>(v, u)) + fine * r.normal();
      for (int c = 0; c < 3; ++c) image.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<std::uint8_t>(base[c] + n);
    }
  }
  return image;
}

cv::Mat planks(Random& r, const cv::Scalar& base, int rows) {
  cv::Mat image = speckle(r, base, 512, 5, 8);
  const int h = 512 / rows;
  for (int i = 0; i < rows; ++i) {
    const cv::Scalar tint = cv::Scalar::all(r.uniform(-22, 22));
    cv::Mat strip = image(cv::Rect(0, i * h, 512, h));
    strip += tint;
    for (int k = 0; k < 14; ++k) {  // grain
      const int y = r.integer(0, h - 1), x = r.integer(0, 400);
      const cv::Point end{x + r.integer(40, 200), y + r.integer(-2, 2)};
      cv::line(strip, {x, y}, end, base * r.uniform(0.7, 0.95), 1);
    }
    cv::line(image, {0, i * h}, {511, i * h}, base * 0.5, 2);
    const int joint = r.integer(0, 511);
    cv::line(image, {joint, i * h}, {joint, i * h + h}, base * 0.5, 2);
  }
  return image;
}

void text_lines(Random& r, cv::Mat image, int x, int y, int width, int lines, const cv::Scalar& ink,
                double scale) {
  for (int i = 0; i < lines; ++i) {
    std::string words;
    const int length = r.integer(6, std::max(7, width / static_cast<int>(18 * scale)));
    for (int k = 0; k < length; ++k)
      words += r.uniform(0, 1) < 0.18 ? ' ' : static_cast<char>('a' + r.integer(0, 25));
    cv::putText(image, words, {x, y + i * static_cast<int>(26 * scale)}, cv::FONT_HERSHEY_SIMPLEX,
                scale * 0.8, ink, 1, cv::LINE_AA);
  }
}

cv::Mat poster(Random& r) {
  cv::Mat image(384, 272, CV_8UC3, colour(r, 120, 250));
  for (int k = 0; k < 9; ++k) {
    const cv::Point a{r.integer(0, 271), r.integer(40, 300)};
    if (r.uniform(0, 1) < 0.5) {
      const int radius = r.integer(10, 60);
      const cv::Scalar ink = colour(r, 10, 230);
      cv::circle(image, a, radius, ink, r.uniform(0, 1) < 0.6 ? cv::FILLED : 4, cv::LINE_AA);
    } else {
      const cv::Point size{r.integer(15, 110), r.integer(15, 80)};
      cv::rectangle(image, a, a + size, colour(r, 10, 230), cv::FILLED);
    }
  }
  text_lines(r, image, 12, 34, 240, 1, {20, 20, 20}, 1.3);
  text_lines(r, image, 12, 320, 240, 3, {30, 30, 30}, 0.7);
  cv::rectangle(image, {0, 0}, {271, 383}, {40, 40, 40}, 3);
  return image;
}

/// Checks in all greys: corners everywhere.
cv::Mat checks(Random& r) {
  constexpr int kSide = 24;
  cv::Mat image(480, 480, CV_8UC3);
  for (int y = 0; y < image.rows; y += kSide) {
    for (int x = 0; x < image.cols; x += kSide) image({x, y, kSide, kSide}).setTo(colour(r, 10, 245));
  }
  return image;
}

cv::Mat screen(Random& r) {
  cv::Mat image(288, 480, CV_8UC3, colour(r, 20, 120));
  for (int k = 0; k < 3; ++k) {
    const cv::Rect window{r.integer(8, 200), r.integer(8, 90), r.integer(160, 260), r.integer(110, 180)};
    const cv::Rect shown = window & cv::Rect(0, 0, 480, 270);
    const bool dark = r.uniform(0, 1) < 0.4;
    cv::rectangle(image, shown, dark ? cv::Scalar(40, 34, 30) : cv::Scalar(238, 240, 240), cv::FILLED);
    cv::rectangle(image, {shown.x, shown.y, shown.width, 14}, colour(r, 60, 200), cv::FILLED);
    text_lines(r, image(shown), 8, 32, shown.width - 16, 7,
               dark ? cv::Scalar(120, 220, 160) : cv::Scalar(50, 40, 40), 0.6);
  }
  cv::rectangle(image, {0, 272, 480, 16}, {60, 50, 45}, cv::FILLED);
  cv::rectangle(image, {0, 0}, {479, 287}, {15, 15, 15}, 8);
  return image;
}

cv::Mat cloth(Random& r, int kind) {
  const cv::Scalar base = colour(r, 40, 200);
  cv::Mat image = speckle(r, base, 256, 5, 10);
  const cv::Scalar second = colour(r, 20, 235);
  const int step = r.integer(18, 34);
  if (kind == 0) {  // checks
    for (int i = 0; i < 256; i += step) {
      cv::rectangle(image, {i, 0, step / 3, 256}, second, cv::FILLED);
      cv::rectangle(image, {0, i, 256, step / 4}, second * 0.8, cv::FILLED);
    }
  } else if (kind == 1) {  // stripes
    for (int i = 0; i < 256; i += step) cv::rectangle(image, {0, i, 256, step / 2}, second, cv::FILLED);
  } else {  // a print
    cv::circle(image, {128, 110}, 46, second, cv::FILLED, cv::LINE_AA);
    text_lines(r, image, 40, 190, 180, 2, second, 1.0);
  }
  for (int k = 0; k < 10; ++k) {  // folds
    const int x = r.integer(0, 255);
    const int end = x + r.integer(-50, 50);
    cv::line(image, {x, 0}, {end, 255}, base * 0.6, r.integer(1, 3), cv::LINE_AA);
  }
  return image;
}

cv::Mat book_spines(Random& r) {
  cv::Mat image(256, 512, CV_8UC3, cv::Scalar(50, 60, 70));
  for (int x = 0; x < 512;) {
    const int w = r.integer(14, 40), top = r.integer(0, 60);
    cv::rectangle(image, {x, top, w - 1, 256 - top}, colour(r, 20, 240), cv::FILLED);
    const cv::Rect title{x + 3, top + r.integer(15, 60), std::max(2, w - 7), r.integer(20, 60)};
    cv::rectangle(image, title, colour(r, 60, 250), cv::FILLED);
    x += w;
  }
  return image;
}

cv::Mat keyboard(Random& r) {
  cv::Mat image(128, 352, CV_8UC3, cv::Scalar(45, 45, 48));
  for (int v = 0; v < 5; ++v) {
    for (int u = 0; u < 16; ++u) {
      cv::rectangle(image, {8 + u * 21, 8 + v * 23, 17, 18}, cv::Scalar::all(r.integer(85, 215)), cv::FILLED);
    }
  }
  return image;
}

cv::Mat carton(Random& r) {
  cv::Mat image = speckle(r, {95, 145, 185}, 256, 4, 6);
  cv::rectangle(image, {112, 0, 32, 256}, {140, 190, 215}, cv::FILLED);
  cv::rectangle(image, {24, 150, 80, 60}, {240, 240, 240}, cv::FILLED);
  text_lines(r, image, 28, 168, 70, 3, {20, 20, 20}, 0.5);
  cv::circle(image, {190, 70}, 30, {40, 60, 200}, 5, cv::LINE_AA);
  text_lines(r, image, 150, 220, 100, 1, {30, 30, 120}, 1.2);
  for (int k = 0; k < 12; ++k) {
    const cv::Point stain{r.integer(0, 255), r.integer(0, 255)};
    cv::circle(image, stain, r.integer(2, 5), {50, 80, 110}, cv::FILLED);
  }
  cv::rectangle(image, {0, 0, 256, 256}, {60, 95, 125}, 4);
  return image;
}

int add(std::vector<Texture>& all, const cv::Mat& image, double width_m) {
  Texture texture;
  texture.texels_per_metre = image.cols / width_m;
  texture.levels.push_back(image);
  while (std::min(texture.levels.back().cols, texture.levels.back().rows) > 4) {
    cv::Mat half;
    cv::resize(texture.levels.back(), half, {}, 0.5, 0.5, cv::INTER_AREA);
    texture.levels.push_back(half);
  }
  all.push_back(std::move(texture));
  return static_cast<int>(all.size()) - 1;
}

}  // namespace

Textures paint(Random& r, bool board) {
  Textures t;
  const auto add_texture = [&](const cv::Mat& image, double width_m) { return add(t.all, image, width_m); };
  t.floor = r.uniform(0, 1) < 0.5 ? add_texture(planks(r, {70, 110, 150}, 8), 1.6)
                                  : add_texture(speckle(r, colour(r, 70, 120), 512, 22, 8), 1.2);
  t.wall = add_texture(speckle(r, {200, 212, 216}, 512, 3, 6), 2.0);
  t.partition = add_texture(speckle(r, {120, 160, 185}, 512, 9, 5), 0.8);
  t.wood = add_texture(planks(r, {110, 160, 195}, 3), 1.4);
  t.metal = add_texture(speckle(r, {150, 150, 150}, 128, 4, 4), 0.5);
  t.dark = add_texture(speckle(r, {32, 30, 30}, 128, 4, 3), 0.4);
  t.ceiling = add_texture(speckle(r, {225, 225, 225}, 256, 5, 2), 0.6);
  t.keyboard = add_texture(keyboard(r), 0.44);
  t.carton = add_texture(carton(r), 0.4);
  t.leaf = add_texture(speckle(r, {40, 120, 50}, 128, 25, 25), 0.2);
  t.cloth = add_texture(speckle(r, colour(r, 40, 130), 256, 10, 5), 0.4);
  for (int i = 0; i < 8; ++i) {
    const cv::Mat picture = poster(r);
    t.posters.push_back(add_texture(picture, r.uniform(0.4, 0.6)));
  }
  for (int i = 0; i < 4; ++i) t.screens.push_back(add_texture(screen(r), 0.52));
  for (int i = 0; i < 3; ++i) t.books.push_back(add_texture(book_spines(r), 0.8));
  for (int i = 0; i < 4; ++i) {
    t.shirts.push_back(add_texture(cloth(r, i % 3), 0.45));
    t.trousers.push_back(add_texture(speckle(r, colour(r, 25, 110), 128, 9, 10), 0.4));
    t.skins.push_back(
        add_texture(speckle(r, cv::Scalar(110, 145, 190) * r.uniform(0.6, 1.15), 128, 4, 10), 0.3));
    t.hairs.push_back(
        add_texture(speckle(r, cv::Scalar(40, 55, 75) * r.uniform(0.4, 1.6), 128, 14, 10), 0.3));
    t.mugs.push_back(add_texture(cloth(r, r.integer(0, 2)), 0.16));
  }
  if (board) t.board = add_texture(checks(r), 1.0);  // last: the office stays the same
  return t;
}

}  // namespace dynslam::runtime::synth
