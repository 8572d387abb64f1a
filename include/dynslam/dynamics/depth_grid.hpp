// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// How DepthGrid reduces a depth image.
struct DepthGridOptions {
  /// Cells across the image. Fewer lose thin limbs, more cost time: 160 are 4 pixels each at 640 x 480, and
  /// what is counted in cells elsewhere is a share of the image whatever its resolution.
  int columns = 160;
  /// Half the field of view of a camera that names no pinhole [rad]: beyond, a flat grid wastes its cells.
  double max_half_angle = 1.22;  // 70 degrees
  /// Depths in one cell that differ by more than base + quad z^2 [m, 1/m] lie at an edge, where the sensor
  /// makes up values between the two surfaces.
  float edge_base = 0.03F, edge_quad = 0.010F;
};

/// Half-open range of grid rows.
struct RowRange {
  int begin = 0, end = 0;
};

/// A pixel of the recorded image; (-1, -1): outside.
struct RecordedPixel {
  int u = -1, v = -1;
};

/// A grid of square cells over the ideal pinhole image of a camera, and which recorded pixels belong to which
/// cell. Lenses cost nothing once it is made: dense work goes along the cells' rays.
///
/// The grid lies over the whole image where the camera has a pinhole of its own, otherwise over that part of
/// the tangent pinhole's image which the camera sees within `max_half_angle`.
class DepthGrid {
 public:
  DepthGrid() = default;

  /// @param width, height  of the recorded images [px]
  template <DifferentiableCamera C>
  DepthGrid(const C& camera, int width, int height, const DepthGridOptions& options)
      : options_(options), image_width_(width), image_height_(height) {
    DYNSLAM_ASSERT(width > 0 && height > 0 && options.columns > 0, "an image and a grid have a size");
    const auto pinhole = ideal_pinhole(camera);
    stride_ = std::max(1, static_cast<int>(std::lround(static_cast<double>(width) / options.columns)));
    int ideal_width = width, ideal_height = height;
    if constexpr (!has_own_pinhole<C>) find_extent(camera, pinhole, ideal_width, ideal_height);
    width_ = (ideal_width + stride_ - 1) / stride_;
    height_ = (ideal_height + stride_ - 1) / stride_;
    const float per_cell = 1.0F / static_cast<float>(stride_);
    fx_ = static_cast<float>(pinhole.fx()) * per_cell;
    fy_ = static_cast<float>(pinhole.fy()) * per_cell;
    cx_ = (static_cast<float>(pinhole.cx()) - static_cast<float>(left_) + 0.5F) * per_cell;
    cy_ = (static_cast<float>(pinhole.cy()) - static_cast<float>(top_) + 0.5F) * per_cell;
    look_up_cells(camera, pinhole);
    look_up_pixels(camera, pinhole);
  }

  [[nodiscard]] int width() const { return width_; }    ///< cells
  [[nodiscard]] int height() const { return height_; }  ///< cells
  [[nodiscard]] std::size_t cells() const { return pixel_of_cell_.size(); }
  [[nodiscard]] int image_width() const { return image_width_; }    ///< pixels
  [[nodiscard]] int image_height() const { return image_height_; }  ///< pixels
  [[nodiscard]] int stride() const { return stride_; }              ///< ideal pixels per cell

  /// Recorded pixel nearest to a cell's centre.
  [[nodiscard]] RecordedPixel pixel_of(std::size_t cell) const { return pixel_of_cell_[cell]; }
  /// Cell of a recorded pixel inside the image as j * width + i; -1: none.
  [[nodiscard]] int cell(int u, int v) const {
    return cell_of_pixel_[static_cast<std::size_t>(v * image_width_ + u)];
  }
  /// The same for any coordinates (NaN too), rounded to the nearest pixel.
  [[nodiscard]] int cell_at(float u, float v) const {
    const float x = std::nearbyint(u), y = std::nearbyint(v);
    if (!(x >= 0 && y >= 0 && x < static_cast<float>(image_width_) && y < static_cast<float>(image_height_)))
      return -1;
    return cell(static_cast<int>(x), static_cast<int>(y));
  }
  /// Rows of cells that a row of recorded pixels meets.
  [[nodiscard]] RowRange rows(int v) const { return rows_[static_cast<std::size_t>(v)]; }

  /// x/z and y/z of the cells' rays.
  [[nodiscard]] const float* ray_x() const { return ray_x_.data(); }
  [[nodiscard]] const float* ray_y() const { return ray_y_.data(); }
  /// The pinhole in cells: a point is in the cell (int(fx x/z + cx), int(fy y/z + cy)).
  [[nodiscard]] float fx() const { return fx_; }
  [[nodiscard]] float fy() const { return fy_; }
  [[nodiscard]] float cx() const { return cx_; }
  [[nodiscard]] float cy() const { return cy_; }

  /// Reduces a depth image [m] to one depth per cell: that of the pixel at its centre, or where this has none
  /// the nearest of four around it, NaN without any.
  /// @param smooth  out: 1 where the cell lies on one surface
  template <DepthImage D>
  void reduce(const D& depth, Image<float>& out, Image<std::uint8_t>& smooth) const {
    DYNSLAM_ASSERT(depth.width() == image_width_ && depth.height() == image_height_,
                   "the depth image has the camera's size");
    out.resize(width_, height_);
    smooth.resize(width_, height_);
    const int w = image_width_, h = image_height_, reach = stride_ / 2;
    for (std::size_t c = 0; c < pixel_of_cell_.size(); ++c) {
      const auto [u, v] = pixel_of_cell_[c];
      Sample sample;
      if (u >= 0) {
        const auto add = [&](int x, int y) {
          if (x >= 0 && y >= 0 && x < w && y < h) sample.add(static_cast<float>(depth(x, y)));
        };
        sample.centre(static_cast<float>(depth(u, v)));
        add(u - reach, v);
        add(u + reach, v);
        add(u, v - reach);
        add(u, v + reach);
      }
      out.data()[c] = sample.depth();
      const float rise = options_.edge_base + options_.edge_quad * sample.lo * sample.lo;
      const bool flat = (sample.valid >= 4) & (sample.hi - sample.lo < rise);
      smooth.data()[c] = flat ? 1 : 0;
    }
  }

 private:
  /// Depths in a cell; without branches, for half of them would be guessed wrong at an edge.
  struct Sample {
    float lo = std::numeric_limits<float>::max(), hi = 0, middle = std::numeric_limits<float>::quiet_NaN();
    int valid = 0;

    void add(float z) {
      const bool ok = is_valid_depth(z);
      lo = std::min(lo, ok ? z : lo);
      hi = std::max(hi, ok ? z : hi);
      valid += ok ? 1 : 0;
    }
    void centre(float z) {
      add(z);
      middle = is_valid_depth(z) ? z : middle;
    }
    [[nodiscard]] float depth() const { return valid > 0 && !is_valid_depth(middle) ? lo : middle; }
  };

  template <class C>
  static constexpr bool has_own_pinhole = HasPinhole<C> || std::same_as<C, Pinhole<typename C::ScalarType>>;

  /// The part of the tangent pinhole's image that the camera sees.
  template <class C>
  void find_extent(const C& camera, const Pinhole<typename C::ScalarType>& pinhole, int& width, int& height) {
    using S = typename C::ScalarType;
    const S bound = std::tan(S(options_.max_half_angle));
    S low_x = bound, high_x = -bound, low_y = bound, high_y = -bound;
    for (int v = 0; v < image_height_; ++v) {
      for (int u = 0; u < image_width_; ++u) {
        const auto p = camera.unproject(Eigen::Matrix<S, 2, 1>(S(u), S(v)), S(1));
        if (!p) continue;
        low_x = std::min(low_x, std::max(-bound, p->x()));
        high_x = std::max(high_x, std::min(bound, p->x()));
        low_y = std::min(low_y, std::max(-bound, p->y()));
        high_y = std::max(high_y, std::min(bound, p->y()));
      }
    }
    left_ = static_cast<int>(std::floor(pinhole.fx() * low_x + pinhole.cx()));
    top_ = static_cast<int>(std::floor(pinhole.fy() * low_y + pinhole.cy()));
    width = std::max(1, static_cast<int>(std::ceil(pinhole.fx() * high_x + pinhole.cx())) + 1 - left_);
    height = std::max(1, static_cast<int>(std::ceil(pinhole.fy() * high_y + pinhole.cy())) + 1 - top_);
  }

  template <class C>
  void look_up_cells(const C& camera, const Pinhole<typename C::ScalarType>& pinhole) {
    using S = typename C::ScalarType;
    const auto n = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
    pixel_of_cell_.assign(n, RecordedPixel());
    ray_x_.resize(n);
    ray_y_.resize(n);
    for (int j = 0; j < height_; ++j) {
      for (int i = 0; i < width_; ++i) {
        const auto c = static_cast<std::size_t>(j * width_ + i);
        const Eigen::Matrix<S, 2, 1> ideal(S(left_) + (S(i) + S(0.5)) * S(stride_) - S(0.5),
                                           S(top_) + (S(j) + S(0.5)) * S(stride_) - S(0.5));
        const Eigen::Matrix<S, 3, 1> ray = pinhole.ray(ideal);
        ray_x_[c] = static_cast<float>(ray.x());
        ray_y_[c] = static_cast<float>(ray.y());
        const auto raw = from_ideal(camera, pinhole, ideal);
        if (!raw) continue;
        const int u = static_cast<int>(std::lround(raw->x())), v = static_cast<int>(std::lround(raw->y()));
        if (u >= 0 && v >= 0 && u < image_width_ && v < image_height_) pixel_of_cell_[c] = {u, v};
      }
    }
  }

  template <class C>
  void look_up_pixels(const C& camera, const Pinhole<typename C::ScalarType>& pinhole) {
    using S = typename C::ScalarType;
    cell_of_pixel_.assign(static_cast<std::size_t>(image_width_) * static_cast<std::size_t>(image_height_),
                          -1);
    rows_.assign(static_cast<std::size_t>(image_height_), RowRange());
    for (int v = 0; v < image_height_; ++v) {
      RowRange range{height_, 0};
      for (int u = 0; u < image_width_; ++u) {
        const auto ideal = to_ideal(camera, pinhole, Eigen::Matrix<S, 2, 1>(S(u), S(v)));
        if (!ideal) continue;
        const S x = std::floor((ideal->x() - S(left_) + S(0.5)) / S(stride_)),
                y = std::floor((ideal->y() - S(top_) + S(0.5)) / S(stride_));
        if (!(x >= S(0) && y >= S(0) && x < S(width_) && y < S(height_))) continue;
        const int i = static_cast<int>(x), j = static_cast<int>(y);
        cell_of_pixel_[static_cast<std::size_t>(v * image_width_ + u)] = j * width_ + i;
        range = {std::min(range.begin, j), std::max(range.end, j + 1)};
      }
      if (range.end > 0) rows_[static_cast<std::size_t>(v)] = range;
    }
  }

  DepthGridOptions options_;
  int image_width_ = 0, image_height_ = 0;
  int stride_ = 1, width_ = 0, height_ = 0;
  int left_ = 0, top_ = 0;  // ideal pixel of the grid's corner
  float fx_ = 1, fy_ = 1, cx_ = 0, cy_ = 0;
  std::vector<RecordedPixel> pixel_of_cell_;
  std::vector<int> cell_of_pixel_;
  std::vector<RowRange> rows_;
  std::vector<float> ray_x_, ray_y_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
