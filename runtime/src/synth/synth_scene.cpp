// SPDX-License-Identifier: BSD-3-Clause
#include "synth/synth_scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <string>

namespace dynslam::runtime::synth {
namespace {

using Eigen::Affine3d;
using Eigen::AngleAxisd;
using Eigen::Translation3d;
using Eigen::Vector3d;

Affine3d at(double x, double y, double z, double yaw = 0) {
  return Translation3d(x, y, z) * AngleAxisd(yaw, Vector3d::UnitZ());
}

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

}  // namespace

double Random::uniform(double low, double high) {
  return low + (high - low) * generator_.unit<double>();
}
int Random::integer(int low, int high) {
  return low + static_cast<int>(generator_.index(static_cast<std::size_t>(high - low + 1)));
}
double Random::normal() {  // sum of uniforms: no transcendental functions, close enough for pictures
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += uniform(0, 1);
  return sum;
}

int Scene::add_texture(const cv::Mat& image, double width_m) {
  Texture texture;
  texture.texels_per_metre = image.cols / width_m;
  texture.levels.push_back(image);
  while (std::min(texture.levels.back().cols, texture.levels.back().rows) > 4) {
    cv::Mat half;
    cv::resize(texture.levels.back(), half, {}, 0.5, 0.5, cv::INTER_AREA);
    texture.levels.push_back(half);
  }
  textures_.push_back(std::move(texture));
  return static_cast<int>(textures_.size()) - 1;
}

void Scene::make_textures(Random& r) {
  floor_ = r.uniform(0, 1) < 0.5 ? add_texture(planks(r, {70, 110, 150}, 8), 1.6)
                                 : add_texture(speckle(r, colour(r, 70, 120), 512, 22, 8), 1.2);
  wall_ = add_texture(speckle(r, {200, 212, 216}, 512, 3, 6), 2.0);
  partition_ = add_texture(speckle(r, {120, 160, 185}, 512, 9, 5), 0.8);
  wood_ = add_texture(planks(r, {110, 160, 195}, 3), 1.4);
  metal_ = add_texture(speckle(r, {150, 150, 150}, 128, 4, 4), 0.5);
  dark_ = add_texture(speckle(r, {32, 30, 30}, 128, 4, 3), 0.4);
  ceiling_ = add_texture(speckle(r, {225, 225, 225}, 256, 5, 2), 0.6);
  keyboard_ = add_texture(keyboard(r), 0.44);
  carton_ = add_texture(carton(r), 0.4);
  leaf_ = add_texture(speckle(r, {40, 120, 50}, 128, 25, 25), 0.2);
  cloth_ = add_texture(speckle(r, colour(r, 40, 130), 256, 10, 5), 0.4);
  for (int i = 0; i < 8; ++i) {
    const cv::Mat picture = poster(r);
    posters_.push_back(add_texture(picture, r.uniform(0.4, 0.6)));
  }
  for (int i = 0; i < 4; ++i) screens_.push_back(add_texture(screen(r), 0.52));
  for (int i = 0; i < 3; ++i) books_.push_back(add_texture(book_spines(r), 0.8));
  for (int i = 0; i < 4; ++i) {
    shirts_.push_back(add_texture(cloth(r, i % 3), 0.45));
    trousers_.push_back(add_texture(speckle(r, colour(r, 25, 110), 128, 9, 10), 0.4));
    skins_.push_back(
        add_texture(speckle(r, cv::Scalar(110, 145, 190) * r.uniform(0.6, 1.15), 128, 4, 10), 0.3));
    hairs_.push_back(add_texture(speckle(r, cv::Scalar(40, 55, 75) * r.uniform(0.4, 1.6), 128, 14, 10), 0.3));
    mugs_.push_back(add_texture(cloth(r, r.integer(0, 2)), 0.16));
  }
  if (options_.scenario == "board") board_ = add_texture(checks(r), 1.0);  // last: the office stays the same
}

void Scene::quad(std::vector<Triangle>& out, const std::array<Vector3d, 4>& p, int texture, const Tag& tag) {
  const double w = (p[1] - p[0]).norm(), h = (p[3] - p[0]).norm();
  const std::array<Eigen::Vector2d, 4> uv{Eigen::Vector2d(0, h), Eigen::Vector2d(w, h), Eigen::Vector2d(w, 0),
                                          Eigen::Vector2d(0, 0)};
  const Vector3d n = (p[1] - p[0]).cross(p[3] - p[0]).normalized();
  for (const auto& [a, b, c] : {std::array{0, 1, 2}, std::array{0, 2, 3}}) {
    const auto i = static_cast<std::size_t>(a), j = static_cast<std::size_t>(b),
               k = static_cast<std::size_t>(c);
    out.push_back({{p[i], p[j], p[k]},
                   {uv[i], uv[j], uv[k]},
                   n,
                   texture,
                   tag.label,
                   tag.instance,
                   tag.dynamic,
                   tag.box});
  }
}

void Scene::box(std::vector<Triangle>& out, const Affine3d& T, const Vector3d& size, int texture,
                const Tag& tag, int front) {
  const Vector3d h = size / 2;
  const auto p = [&](int x, int y, int z) { return Vector3d(T * Vector3d(x * h.x(), y * h.y(), z * h.z())); };
  quad(out, {p(-1, -1, -1), p(1, -1, -1), p(1, -1, 1), p(-1, -1, 1)}, front >= 0 ? front : texture, tag);
  quad(out, {p(1, 1, -1), p(-1, 1, -1), p(-1, 1, 1), p(1, 1, 1)}, texture, tag);
  quad(out, {p(-1, 1, -1), p(-1, -1, -1), p(-1, -1, 1), p(-1, 1, 1)}, texture, tag);
  quad(out, {p(1, -1, -1), p(1, 1, -1), p(1, 1, 1), p(1, -1, 1)}, texture, tag);
  quad(out, {p(-1, -1, 1), p(1, -1, 1), p(1, 1, 1), p(-1, 1, 1)}, texture, tag);
  quad(out, {p(-1, 1, -1), p(1, 1, -1), p(1, -1, -1), p(-1, -1, -1)}, texture, tag);
}

void Scene::limb(std::vector<Triangle>& out, const Vector3d& a, const Vector3d& b, double ra, double rb,
                 int texture, const Tag& tag) {
  // A capsule with two radii: rings along the axis, half a sphere at each end.
  constexpr int kSides = 12, kCap = 3;
  const Vector3d axis = (b - a).normalized();
  const Vector3d side =
      (std::abs(axis.y()) < 0.9 ? axis.cross(Vector3d::UnitY()) : axis.cross(Vector3d::UnitX())).normalized();
  const Vector3d other = axis.cross(side);
  struct Ring {
    Vector3d centre;
    double radius, along;
  };
  std::vector<Ring> rings;
  const double length = (b - a).norm();
  for (int i = 0; i <= kCap; ++i) {
    const double t = std::numbers::pi / 2 * i / kCap;
    rings.push_back({a - axis * ra * std::cos(t), ra * std::sin(t), -ra * std::cos(t)});
  }
  for (int i = kCap; i >= 0; --i) {
    const double t = std::numbers::pi / 2 * i / kCap;
    rings.push_back({b + axis * rb * std::cos(t), rb * std::sin(t), length + rb * std::cos(t)});
  }
  for (std::size_t r = 0; r + 1 < rings.size(); ++r) {
    for (int s = 0; s < kSides; ++s) {
      const auto point = [&](const Ring& ring, int k) {
        const double t = 2 * std::numbers::pi * k / kSides;
        return Vector3d(ring.centre + ring.radius * (std::cos(t) * side + std::sin(t) * other));
      };
      const auto uv = [&](const Ring& ring, int k) {
        return Eigen::Vector2d(2 * std::numbers::pi * k / kSides * std::max(ra, rb), ring.along);
      };
      const std::array<Vector3d, 4> p{point(rings[r], s), point(rings[r], s + 1), point(rings[r + 1], s + 1),
                                      point(rings[r + 1], s)};
      const std::array<Eigen::Vector2d, 4> t{uv(rings[r], s), uv(rings[r], s + 1), uv(rings[r + 1], s + 1),
                                             uv(rings[r + 1], s)};
      const Vector3d middle = (p[0] + p[1] + p[2] + p[3]) / 4;
      const Vector3d n = (middle - (rings[r].centre + rings[r + 1].centre) / 2).normalized();
      out.push_back({{p[0], p[1], p[2]},
                     {t[0], t[1], t[2]},
                     n,
                     texture,
                     tag.label,
                     tag.instance,
                     tag.dynamic,
                     tag.box});
      out.push_back({{p[0], p[2], p[3]},
                     {t[0], t[2], t[3]},
                     n,
                     texture,
                     tag.label,
                     tag.instance,
                     tag.dynamic,
                     tag.box});
    }
  }
}

void Scene::make_chair(double x, double y, double angle) {
  const Tag tag{Label::chair, ++instances_};
  const Affine3d T = at(x, y, 0, angle);
  box(furniture_, T * Translation3d(0, 0, 0.46), {0.46, 0.44, 0.07}, cloth_, tag);
  box(furniture_, T * Translation3d(0, -0.22, 0.78) * AngleAxisd(0.12, Vector3d::UnitX()), {0.42, 0.05, 0.46},
      cloth_, tag);
  limb(furniture_, T * Vector3d(0, 0, 0.12), T * Vector3d(0, 0, 0.42), 0.025, 0.025, dark_, tag);
  limb(furniture_, T * Vector3d(0, -0.2, 0.46), T * Vector3d(0, -0.22, 0.6), 0.02, 0.02, dark_, tag);
  for (int k = 0; k < 5; ++k) {
    const double a = 2 * std::numbers::pi * k / 5;
    limb(furniture_, T * Vector3d(0, 0, 0.1), T * Vector3d(0.28 * std::cos(a), 0.28 * std::sin(a), 0.05),
         0.025, 0.02, dark_, tag);
  }
}

void Scene::make_desk(Random& r, double x, double y) {
  const Tag none;
  box(furniture_, at(x, y, 0.72), {1.5, 0.75, 0.04}, wood_, none);
  for (const double side : {-0.7, 0.7}) {
    for (const double depth : {-0.32, 0.32})
      box(furniture_, at(x + side, y + depth, 0.35), {0.05, 0.05, 0.7}, metal_, none);
  }
  const double top = 0.74;
  const int displays = r.integer(1, 2);
  for (int k = 0; k < displays; ++k) {
    const Tag tag{Label::display, ++instances_};
    const double dx = x + (displays == 1 ? r.uniform(-0.2, 0.2) : (k == 0 ? -0.32 : 0.32));
    const double dy = y + r.uniform(0.05, 0.2);
    const Affine3d T = at(dx, dy, top, r.uniform(-0.25, 0.25));
    box(furniture_, T * Translation3d(0, 0, 0.29), {0.54, 0.04, 0.34}, dark_, tag,
        screens_[static_cast<std::size_t>(r.integer(0, 3))]);
    box(furniture_, T * Translation3d(0, 0.03, 0.1), {0.06, 0.03, 0.2}, dark_, tag);
    box(furniture_, T * Translation3d(0, 0.02, 0.01), {0.24, 0.18, 0.02}, dark_, tag);
  }
  const double kx = x + r.uniform(-0.1, 0.1);
  box(furniture_, at(kx, y - 0.2, top + 0.012, r.uniform(-0.1, 0.1)), {0.44, 0.16, 0.024}, keyboard_, none);
  for (int k = 0; k < 3; ++k) {  // mugs, books, papers
    const double cx = x + r.uniform(-0.68, 0.68), cy = y + r.uniform(-0.3, 0.05);
    limb(furniture_, {cx, cy, top + 0.03}, {cx, cy, top + 0.07}, 0.038, 0.038,
         mugs_[static_cast<std::size_t>(r.integer(0, 3))], none);
    const int n = r.integer(1, 4);
    double z = top;
    const double bx = x + r.uniform(-0.6, 0.6), by = y + r.uniform(-0.28, 0.2);
    for (int b = 0; b < n; ++b) {
      const double thick = r.uniform(0.015, 0.045), yaw = r.uniform(-0.4, 0.4);
      box(furniture_, at(bx, by, z + thick / 2, yaw), {0.21, 0.28, thick},
          posters_[static_cast<std::size_t>(r.integer(0, 7))], none);
      z += thick;
    }
  }
}

void Scene::make_room(Random& r) {
  const Tag none;
  const double w = 4.2, back = 4.6, front = -2.5, high = 2.8;
  quad(furniture_,
       {Vector3d(-w, front, 0), Vector3d(w, front, 0), Vector3d(w, back, 0), Vector3d(-w, back, 0)}, floor_,
       none);
  quad(furniture_,
       {Vector3d(-w, back, high), Vector3d(w, back, high), Vector3d(w, front, high),
        Vector3d(-w, front, high)},
       ceiling_, none);
  quad(furniture_,
       {Vector3d(-w, back, 0), Vector3d(w, back, 0), Vector3d(w, back, high), Vector3d(-w, back, high)},
       wall_, none);
  quad(furniture_,
       {Vector3d(-w, front, 0), Vector3d(-w, back, 0), Vector3d(-w, back, high), Vector3d(-w, front, high)},
       wall_, none);
  quad(furniture_,
       {Vector3d(w, back, 0), Vector3d(w, front, 0), Vector3d(w, front, high), Vector3d(w, back, high)},
       wall_, none);
  quad(furniture_,
       {Vector3d(w, front, 0), Vector3d(-w, front, 0), Vector3d(-w, front, high), Vector3d(w, front, high)},
       wall_, none);
  // Posters on the back and side walls, a partition behind the desks, shelves, a plant, boxes.
  for (int k = 0; k < 7; ++k) {
    const double x = -3.4 + 1.05 * k + r.uniform(-0.15, 0.15), z = r.uniform(1.4, 1.9);
    box(furniture_, at(x, back - 0.02, z), {r.uniform(0.4, 0.6), 0.02, r.uniform(0.55, 0.8)}, wall_, none,
        posters_[static_cast<std::size_t>(k)]);
  }
  box(furniture_, at(0, 3.25, 0.65), {4.2, 0.06, 1.3}, partition_, none);
  for (int k = 0; k < 4; ++k) {
    const double x = -1.6 + k + r.uniform(-0.2, 0.2), z = 1.05 + r.uniform(-0.08, 0.06);
    box(furniture_, at(x, 3.2, z), {0.3, 0.02, 0.34}, partition_, none,
        posters_[static_cast<std::size_t>(r.integer(0, 7))]);
  }
  for (const double side : {-1.0, 1.0}) {
    const double x = side * 3.1;
    box(furniture_, at(x, 4.2, 0.95), {1.3, 0.5, 1.9}, wood_, none);
    for (int row = 0; row < 4; ++row) {
      box(furniture_, at(x, 3.94, 0.35 + 0.45 * row), {1.2, 0.04, 0.3}, dark_, none,
          books_[static_cast<std::size_t>(r.integer(0, 2))]);
    }
    for (int k = 0; k < 3; ++k) {
      const double z = r.uniform(1.3, 1.7);
      box(furniture_, at(side * 4.18, 0.4 + 1.1 * k, z, -side * std::numbers::pi / 2), {0.5, 0.02, 0.7},
          wall_, none, posters_[static_cast<std::size_t>(r.integer(0, 7))]);
    }
    const double bx = side * r.uniform(2.4, 2.9), by = r.uniform(2.0, 2.8);
    box(furniture_, at(bx, by, 0.2, r.uniform(0, 1)), {0.5, 0.4, 0.4}, carton_, none);
  }
  const double px = r.uniform(-2.6, -2.2), py = 3.0;
  limb(furniture_, {px, py, 0.12}, {px, py, 0.32}, 0.14, 0.17, carton_, none);
  for (int k = 0; k < 9; ++k) {
    const double a = r.uniform(0, 2 * std::numbers::pi), s = r.uniform(0.2, 0.45);
    limb(furniture_, {px, py, 0.45}, {px + s * std::cos(a), py + s * std::sin(a), r.uniform(0.7, 1.25)},
         0.015, 0.05, leaf_, none);
  }
  for (const double x : {-1.65, 0.0, 1.65}) {
    const double dx = x + r.uniform(-0.05, 0.05);
    make_desk(r, dx, 2.6 + r.uniform(-0.05, 0.05));
  }
  for (const double x : {-2.0, 2.0})
    box(furniture_, at(x, 1.5, high - 0.04), {0.3, 1.4, 0.06}, ceiling_, none);
  for (const double left : {-1.7, 0.2}) {
    const double x = left + r.uniform(0, 0.3), y = r.uniform(1.75, 1.95);
    make_chair(x, y, r.uniform(-0.6, 0.6));
  }
  sitter_x_ = r.uniform(1.45, 1.7);
  sitter_y_ = r.uniform(1.75, 1.9);
  make_chair(sitter_x_, sitter_y_, 0.0);
  if (options_.path != "loop") return;
  // The side behind the usual cameras: pictures, a long shelf with books, boxes.
  for (int k = 0; k < 8; ++k) {
    const double x = -3.6 + 1.03 * k + r.uniform(-0.15, 0.15), z = r.uniform(1.4, 1.9);
    box(furniture_, at(x, front + 0.02, z, std::numbers::pi),
        {r.uniform(0.4, 0.6), 0.02, r.uniform(0.5, 0.8)}, wall_, none,
        posters_[static_cast<std::size_t>(k % 8)]);
  }
  for (const double x : {-2.2, 0.3, 2.4}) {
    box(furniture_, at(x, front + 0.2, 0.45), {1.2, 0.36, 0.9}, wood_, none);
    box(furniture_, at(x, front + 0.39, 0.5, std::numbers::pi), {1.1, 0.03, 0.5}, dark_, none,
        books_[static_cast<std::size_t>(r.integer(0, 2))]);
    box(furniture_, at(x + r.uniform(-0.3, 0.3), front + 0.2, 1.02, r.uniform(0, 1)), {0.3, 0.2, 0.24},
        carton_, none);
  }
  for (const double side : {-1.0, 1.0}) {
    for (int k = 0; k < 3; ++k) {
      box(furniture_, at(side * 4.18, -1.9 + 0.8 * k, r.uniform(1.3, 1.8), -side * std::numbers::pi / 2),
          {0.5, 0.02, 0.7}, wall_, none, posters_[static_cast<std::size_t>(r.integer(0, 7))]);
    }
    box(furniture_, at(side * 3.6, r.uniform(-1.5, -0.5), 0.3, r.uniform(0, 1)), {0.6, 0.5, 0.6}, carton_,
        none);
  }
}

Scene::Scene(const SynthOptions& options) : options_(options) {
  Random r(options.seed * 0x51ED2701ULL + 17);
  make_textures(r);
  make_room(r);
  const int walkers = options_.scenario == "walking" ? options_.walkers : 0;
  for (int k = 0; k < walkers; ++k) {
    const auto i = static_cast<std::size_t>(k % 4);
    const double direction = k % 2 == 0 ? 1 : -1;
    walkers_.push_back({direction * r.uniform(-1.9, -1.2), 0.75 + 0.4 * (k % 3) + r.uniform(-0.08, 0.08),
                        direction * r.uniform(0.65, 1.0), r.uniform(0, 6), r.uniform(1.62, 1.88),
                        r.uniform(1.7, 2.3), shirts_[i], trousers_[i], skins_[i], hairs_[i], ++instances_,
                        options_.box && k == 0});
  }
  ++instances_;  // the sitter's and a lone box's
}

void Scene::add_walker(std::vector<Triangle>& out, const Person& person, double t) const {
  // Back and forth along x: a triangle wave of position, with a quick turn at its ends.
  const double period = 4 * person.range / std::abs(person.speed);
  const double shift = std::asin(std::clamp(person.x0 / person.range, -1.0, 1.0)) * 2 / std::numbers::pi *
                       person.range / std::abs(person.speed);
  double s =
      std::fmod(t + (person.speed > 0 ? shift : period / 2 - shift) + 10 * period, period) / period;  // 0..1
  const double triangle = s < 0.25 ? 4 * s : s < 0.75 ? 2 - 4 * s : 4 * s - 4;                        // -1..1
  const double direction = s < 0.25 || s >= 0.75 ? 1 : -1;
  const double to_turn = std::min(std::abs(s - 0.25), std::abs(s - 0.75)) * period;
  const double turn =
      std::clamp(1 - to_turn / 0.35, 0.0, 1.0) * std::numbers::pi / 2;  // faces the camera while turning
  const double x = triangle * person.range, y = person.y + 0.12 * std::sin(0.9 * t + person.phase);
  const double heading = direction > 0 ? -turn : std::numbers::pi + turn;
  const double scale = person.height / 1.75;
  const double phase = t * std::abs(person.speed) * 4.4 + person.phase;
  const Affine3d T = at(x, y, 0.02 * std::sin(2 * phase), heading) * Eigen::Scaling(scale);
  const Tag tag{Label::person, person.instance, true};
  const auto p = [&](double forward, double left, double up) {
    return Vector3d(T * Vector3d(forward, left, up));
  };
  const auto add = [&](const Vector3d& a, const Vector3d& b, double ra, double rb, int texture) {
    limb(out, a, b, ra * scale, rb * scale, texture, tag);
  };
  add(p(0, 0.07, 1.0), p(0.02, 0.06, 1.32), 0.145, 0.15, person.shirt);  // two capsules make a broad trunk
  add(p(0, -0.07, 1.0), p(0.02, -0.06, 1.32), 0.145, 0.15, person.shirt);
  add(p(0, 0, 0.9), p(0, 0, 0.98), 0.155, 0.16, person.trousers);
  add(p(0.03, 0, 1.45), p(0.04, 0, 1.52), 0.055, 0.055, person.skin);
  add(p(0.05, 0, 1.6), p(0.05, 0, 1.66), 0.095, 0.1, person.skin);
  add(p(0.02, 0, 1.66), p(0.01, 0, 1.69), 0.105, 0.1, person.hair);
  for (const double side : {-1.0, 1.0}) {
    const double swing = 0.5 * std::sin(phase + (side > 0 ? 0 : std::numbers::pi));
    const double bend = 0.35 + 0.35 * std::max(0.0, -std::cos(phase + (side > 0 ? 0 : std::numbers::pi)));
    const double hip = 0.09 * side;
    const Vector3d knee(0.43 * std::sin(swing), hip, 0.9 - 0.43 * std::cos(swing));
    const Vector3d ankle = knee + Vector3d(0.43 * std::sin(swing - bend), 0, -0.43 * std::cos(swing - bend));
    add(p(0, hip, 0.9), p(knee.x(), knee.y(), knee.z()), 0.085, 0.06, person.trousers);
    add(p(knee.x(), knee.y(), knee.z()), p(ankle.x(), ankle.y(), ankle.z()), 0.06, 0.045, person.trousers);
    add(p(ankle.x(), ankle.y(), ankle.z()), p(ankle.x() + 0.16, ankle.y(), std::max(0.04, ankle.z() - 0.03)),
        0.05, 0.04, dark_);
    const Vector3d shoulder(0.02, 0.22 * side, 1.38);
    Vector3d elbow, hand;
    if (person.carries) {
      elbow = shoulder + Vector3d(0.12, 0.02 * side, -0.26);
      hand = elbow + Vector3d(0.24, -0.05 * side, 0.02);
    } else {
      const double arm = -0.55 * std::sin(phase + (side > 0 ? 0 : std::numbers::pi));
      elbow = shoulder + Vector3d(0.28 * std::sin(arm), 0.03 * side, -0.28 * std::cos(arm));
      hand = elbow + Vector3d(0.25 * std::sin(arm + 0.4), 0, -0.25 * std::cos(arm + 0.4));
    }
    add(p(shoulder.x(), shoulder.y(), shoulder.z()), p(elbow.x(), elbow.y(), elbow.z()), 0.055, 0.045,
        person.shirt);
    add(p(elbow.x(), elbow.y(), elbow.z()), p(hand.x(), hand.y(), hand.z()), 0.042, 0.036, person.skin);
  }
  if (person.carries) {
    box(out, at(0, 0, 0) * T * Translation3d(0.44, 0, 1.12), {0.34, 0.46, 0.34}, carton_,
        {Label::background, 0, true, true});
  }
}

void Scene::add_sitter(std::vector<Triangle>& out, double t) const {
  const Tag tag{Label::person, instances_, false};
  const Affine3d T = at(sitter_x_, sitter_y_, 0, std::numbers::pi / 2);
  const double sway = 0.008 * std::sin(1.3 * t);  // nobody sits like a stone
  const auto p = [&](double forward, double left, double up) {
    return Vector3d(T * Vector3d(forward, left, up));
  };
  const int shirt = shirts_[2], trousers = trousers_[2], skin = skins_[2], hair = hairs_[2];
  limb(out, p(-0.08, 0.07, 0.62), p(0.0 + sway, 0.06, 0.98), 0.14, 0.145, shirt, tag);
  limb(out, p(-0.08, -0.07, 0.62), p(0.0 + sway, -0.06, 0.98), 0.14, 0.145, shirt, tag);
  limb(out, p(0.02 + sway, 0, 1.1), p(0.03 + sway, 0, 1.18), 0.055, 0.055, skin, tag);
  limb(out, p(0.05 + sway, 0, 1.25), p(0.05 + sway, 0, 1.31), 0.095, 0.1, skin, tag);
  limb(out, p(0.02 + sway, 0, 1.31), p(0.01 + sway, 0, 1.34), 0.105, 0.1, hair, tag);
  for (const double side : {-1.0, 1.0}) {
    limb(out, p(-0.05, 0.1 * side, 0.58), p(0.36, 0.11 * side, 0.56), 0.085, 0.065, trousers, tag);
    limb(out, p(0.36, 0.11 * side, 0.56), p(0.38, 0.12 * side, 0.1), 0.06, 0.045, trousers, tag);
    limb(out, p(0.38, 0.12 * side, 0.06), p(0.52, 0.13 * side, 0.05), 0.05, 0.04, dark_, tag);
    limb(out, p(0.0 + sway, 0.21 * side, 1.02), p(0.12, 0.24 * side, 0.78), 0.055, 0.045, shirt, tag);
    limb(out, p(0.12, 0.24 * side, 0.78), p(0.38, 0.14 * side, 0.78), 0.042, 0.036, skin, tag);
  }
}

std::vector<Triangle> Scene::triangles(double t) const {
  std::vector<Triangle> out = furniture_;
  for (const Person& person : walkers_) add_walker(out, person, t);
  if (options_.scenario == "walking" || options_.scenario == "sitting") add_sitter(out, t);
  if (options_.scenario == "board") {  // it fills a sixth of the view and has most of its corners
    const double x = 0.35 * std::sin(1.1 * t), y = 1.0 + 0.1 * std::sin(0.7 * t),
                 z = 1.2 + 0.1 * std::sin(1.3 * t);
    box(out, at(x, y, z, 0.25 * std::sin(0.8 * t)), {0.8, 0.03, 0.6}, board_,
        {Label::background, 0, true, true});
  }
  if (options_.scenario == "box") {
    const double x = 0.9 * std::sin(0.9 * t - 1.2), y = 1.0 + 0.25 * std::sin(0.6 * t),
                 z = 1.15 + 0.15 * std::sin(1.1 * t);
    box(out, at(x, y, z, 0.5 * std::sin(0.7 * t)), {0.55, 0.3, 0.45}, carton_,
        {Label::background, 0, true, true});
  }
  return out;
}

}  // namespace dynslam::runtime::synth
