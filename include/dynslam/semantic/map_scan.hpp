// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/semantic/depth_code.hpp"

namespace dynslam {

/// Which pixels of a keyframe become map, and how much they count.
template <std::floating_point S = float>
struct MapScanOptions {
  int pixel_stride = 2;  ///< every so many pixels in both directions: voxels are coarser than pixels
  /// Depth up to which surfaces are mapped [m along the optical axis]; what is farther clears the way up to
  /// there. 0: where the noise says, see range().
  double max_range = 0;
  /// Edges of a voxel that one standard deviation of depth may span. At 1 the mean with the neighbours is off
  /// by less than half an edge more often than not.
  double range_edges = 1;
  /// Between ray and surface normal [rad]; beyond, a pixel is grazing or at an edge.
  double max_incidence = 78 * std::numbers::pi / 180;
  int edge_reach = 2;  ///< pixels to the neighbours that this is measured with, and the depth's mean taken of
  S edge_sigmas = S(3);   ///< standard deviations by which their depth may differ beside that
  S carve_sigmas = S(2);  ///< a ray stops so many standard deviations before the surface
  S full_weight_edge =
      S(4);             ///< standard deviations that a voxel's edge must span for a surface to count fully
  int mover_label = 1;  ///< is never surface (people); -1: none
  DepthNoise<S> noise;

  /// Depth up to which surfaces are mapped [m]. @param edge  of the map's voxels [m]
  [[nodiscard]] double range(double edge) const {
    if (max_range > 0) return max_range;
    return static_cast<double>(noise.range(static_cast<S>(range_edges * edge)));
  }
};

/// Pixels with a colour, as (red, green, blue).
template <class I>
concept RgbImage = ImageLike<I> && std::convertible_to<typename I::Pixel, std::array<std::uint8_t, 3>>;

/// A keyframe reduced to what a map needs, in the camera's frame, so that it can be inserted again after
/// the pose was corrected. 3 bytes per sampled pixel and 3 more per pixel that becomes surface: about 400 kB
/// for a VGA image at stride 2.
/// @tparam Labels  that can be told apart, 0 (none) included; above 64 a sampled pixel takes a byte more
template <int Labels = 64>
struct MapScan {
  using Code = std::conditional_t<(Labels <= 64), std::uint8_t, std::uint16_t>;
  static_assert(Labels > 0 && Labels <= 16384);
  static constexpr int kLabelBits = 8 * static_cast<int>(sizeof(Code)) - 2;

  /// What a sampled pixel says.
  enum class Use : std::uint8_t {
    nothing,  ///< no depth, or depth that cannot be trusted: at an edge or grazing
    free,     ///< the way to it is free, it is no surface of the map: on a mover, or beyond a given range
    surface
  };

  std::vector<std::uint16_t> depth;  ///< DepthCode of all sampled pixels
  std::vector<Code> code;            ///< Use in the upper two bits, label in the others
  std::vector<std::uint8_t> rgb;     ///< of the surface pixels, in turn

  [[nodiscard]] Use use(std::size_t k) const { return static_cast<Use>(code[k] >> kLabelBits); }
  [[nodiscard]] int label(std::size_t k) const { return code[k] & ((1 << kLabelBits) - 1); }

  [[nodiscard]] std::size_t bytes() const {
    return depth.capacity() * sizeof(depth[0]) + code.capacity() * sizeof(Code) + rgb.capacity();
  }

  /// Whether the parts belong together, as after pack(); for scans that were read from somewhere.
  [[nodiscard]] bool consistent() const {
    if (depth.size() != code.size()) return false;
    std::size_t surface = 0;
    for (std::size_t k = 0; k < code.size(); ++k) {
      if (use(k) > Use::surface) return false;
      surface += use(k) == Use::surface ? 1U : 0U;
    }
    return rgb.size() == 3 * surface;
  }
};

/// Turns keyframes into scans and scans into voxels. The lens is undone per pixel, once.
/// @tparam S  scalar of the rays
template <std::floating_point S = float>
class MapScanner {
 public:
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  /// @param camera         that of the images; pixels for which it has no ray are no part of a scan
  /// @param width, height  of the images [px]
  template <CameraModel Camera>
    requires HasPinhole<Camera> || DifferentiableCamera<Camera> MapScanner(
        const Camera& camera, int width, int height, const MapScanOptions<S>& options = {})
        : options_(options), width_(width), height_(height) {
      using T = typename Camera::ScalarType;
      // On a surface seen at angle a depth changes by tan(a) times what one pixel spans, z / f.
      const auto pinhole = ideal_pinhole(camera);
      const T focal = T(0.5) * (pinhole.fx() + pinhole.fy());
      max_slope_ = static_cast<S>(std::tan(options.max_incidence) / static_cast<double>(focal));
      for (int v = options_.pixel_stride / 2; v < height; v += options_.pixel_stride) {
        for (int u = options_.pixel_stride / 2; u < width; u += options_.pixel_stride) {
          const std::optional<Eigen::Matrix<T, 3, 1>> ray =
              camera.unproject(Eigen::Matrix<T, 2, 1>(T(u), T(v)), T(1));
          if (!ray) continue;
          rays_.push_back(ray->template cast<S>());
          pixels_.push_back(v * width + u);
        }
      }
    }

    /// Pixels of a scan.
    [[nodiscard]] std::size_t samples() const {
      return pixels_.size();
    }

    /// Selects and packs the pixels of a keyframe. All images have the scanner's size.
    /// @param depth         metres, NaN = invalid
    /// @param dynamic_mask  nonzero is no surface of the map; may be 0 x 0
    /// @param labels        may be 0 x 0; those that the scan cannot tell apart count as 0
    /// @param colours       of the surfaces
    template <int Labels = 64, DepthImage Depth, LabelImage Mask, LabelImage LabelsImage, RgbImage Colours>
    [[nodiscard]] MapScan<Labels> pack(const Depth& depth, const Mask& dynamic_mask,
                                       const LabelsImage& labels, const Colours& colours) const {
      using Scan = MapScan<Labels>;
      DYNSLAM_ASSERT(fits(depth) && fits(colours) && (empty(dynamic_mask) || fits(dynamic_mask)) &&
                         (empty(labels) || fits(labels)),
                     "all images have the size of the camera's");
      // Where the noise sets the range, that depends on the voxels: gather() knows it.
      const S max_range =
          options_.max_range > 0 ? static_cast<S>(options_.max_range) : std::numeric_limits<S>::infinity();
      const bool masked = !empty(dynamic_mask), labelled = !empty(labels);
      Scan scan;
      scan.depth.resize(pixels_.size());
      scan.code.resize(pixels_.size());
      scan.rgb.reserve(3 * pixels_.size());
      for (std::size_t k = 0; k < pixels_.size(); ++k) {
        const int v = pixels_[k] / width_, u = pixels_[k] % width_;
        const std::optional<S> z = surface_depth(depth, u, v);
        if (!z) continue;
        const int label = labelled ? static_cast<int>(labels(u, v)) : 0;
        const bool mover = (masked && dynamic_mask(u, v) != 0) || label == options_.mover_label;
        const bool surface = !mover && *z <= max_range;
        scan.depth[k] = DepthCode::of(*z).bits;
        const int use = static_cast<int>(surface ? Scan::Use::surface : Scan::Use::free);
        scan.code[k] = static_cast<typename Scan::Code>(use << Scan::kLabelBits |
                                                        (label >= 0 && label < Labels ? label : 0));
        if (!surface) continue;
        const std::array<std::uint8_t, 3> rgb = colours(u, v);
        scan.rgb.insert(scan.rgb.end(), rgb.begin(), rgb.end());
      }
      scan.rgb.shrink_to_fit();
      return scan;
    }

    /// The voxels that a scan hits and passes. Rays end some standard deviations before the surface, those
    /// towards moving objects and beyond the range too; far surfaces count less. Rays out of the grid end at
    /// its border. `out` is cleared and finished.
    /// @param out  ScanVoxels, or what offers the same to write
    template <int Labels, std::floating_point T, class Voxels>
    void gather(const MapScan<Labels>& scan, const SE3<T>& T_w_c, Voxels& out) const {
      using Scan = MapScan<Labels>;
      DYNSLAM_ASSERT(scan.depth.size() == samples(), "the scan is of another camera");
      out.clear();
      const Eigen::Matrix<S, 3, 3> R = T_w_c.rotation_matrix().template cast<S>();
      const Vector3 t = T_w_c.translation().template cast<S>();
      const auto edge = static_cast<S>(out.grid().resolution());
      const auto range = static_cast<S>(options_.range(out.grid().resolution()));
      const S border = S(32767.5) * edge;  // safely inside the grid
      std::size_t colour = 0;
      for (std::size_t k = 0; k < scan.depth.size(); ++k) {
        const auto use = scan.use(k);
        if (use == Scan::Use::nothing) continue;
        const S z = static_cast<S>(DepthCode(scan.depth[k]).metres());
        const S sigma = options_.noise.sigma(z);
        const Vector3 ray = R * rays_[k];
        const Vector3 p = t + ray * z;
        const std::size_t rgb_at = colour;
        if (use == Scan::Use::surface) colour += 3;
        S clear = z - options_.carve_sigmas * sigma;
        const bool surface =
            use == Scan::Use::surface && z <= range && p.template lpNorm<Eigen::Infinity>() < border;
        if (surface) {
          const std::array<std::uint8_t, 3> rgb{scan.rgb[rgb_at], scan.rgb[rgb_at + 1], scan.rgb[rgb_at + 2]};
          // A surface that noise spreads over several voxels is seen in each of them less often.
          const S weight = std::min(S(1), edge / (options_.full_weight_edge * sigma));
          if (!out.add_end(p, static_cast<LabelOf<Labels>>(scan.label(k)), rgb, static_cast<float>(weight)))
            continue;  // one ray per voxel clears the way
        } else {
          clear =
              std::min(clear - edge, range);  // a mover's outline is not exact: a voxel's distance from it
        }
        for (Eigen::Index i = 0; i < 3; ++i) {
          if (std::abs(t(i) + ray(i) * clear) > border)
            clear = std::min(clear, (std::copysign(border, ray(i)) - t(i)) / ray(i));
        }
        if (!(clear > S(0))) continue;
        const Vector3 end = t + ray * clear;
        if (surface) {
          out.carve(t, end);
        } else {
          out.carve_once(t, end);
        }
      }
      out.finish();
    }

   private:
    template <int Labels>
    using LabelOf = std::conditional_t<(Labels <= 256), std::uint8_t, std::uint16_t>;

    template <ImageLike I>
    [[nodiscard]] static bool empty(const I& image) {
      return image.width() == 0 || image.height() == 0;
    }
    template <ImageLike I>
    [[nodiscard]] bool fits(const I& image) const {
      return image.width() == width_ && image.height() == height_;
    }

    /// Depth of the surface around a pixel, from it and those of its neighbours that have an opposite one: a
    /// plane's own, with less than half the noise of one pixel. nullopt where the surface is not seen well.
    template <DepthImage Depth>
    [[nodiscard]] std::optional<S> surface_depth(const Depth& depth, int u, int v) const {
      const auto z = static_cast<S>(depth(u, v));
      if (!is_valid_depth(z)) return std::nullopt;
      const int reach = options_.edge_reach;
      const S limit = static_cast<S>(reach) * max_slope_ * z + options_.edge_sigmas * options_.noise.sigma(z);
      S sum = z;
      int count = 1;
      // Whether two opposite neighbours are as near in depth as the surface allows.
      const auto near = [&](int du, int dv) {
        const auto at = [&](int x, int y) {
          const bool inside = x >= 0 && y >= 0 && x < width_ && y < height_;
          return inside ? static_cast<S>(depth(x, y)) : S(0);
        };
        const S a = at(u - du, v - dv), b = at(u + du, v + dv);
        const bool has_a = is_valid_depth(a), has_b = is_valid_depth(b);
        if ((has_a && std::abs(a - z) > limit) || (has_b && std::abs(b - z) > limit)) return false;
        if (has_a && has_b) {
          sum += a + b;
          count += 2;
        }
        return true;
      };
      if (!near(reach, 0) || !near(0, reach)) return std::nullopt;
      return sum / static_cast<S>(count);
    }

    MapScanOptions<S> options_;
    int width_, height_;
    S max_slope_;                // of depth per pixel and metre of depth, at max_incidence
    std::vector<Vector3> rays_;  // per sampled pixel, z = 1
    std::vector<int> pixels_;    // its index in the image
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
