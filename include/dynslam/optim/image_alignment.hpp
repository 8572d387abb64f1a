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
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/image/sample.hpp"
#include "dynslam/optim/levenberg_marquardt.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/robust/rho_sum.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// Options of align_images().
template <std::floating_point S>
struct ImageAlignmentOptions {
  int rounds = 2;               ///< on each level; before each the residuals' scale is estimated anew
  int max_iterations = 8;       ///< accepted or refused steps per round
  S tolerance = S(1e-3);        ///< relative decrease of the cost that ends a round
  S nu = S(5);                  ///< degrees of freedom of the t-distribution (Kerl et al. 2013)
  S min_scale = S(2);           ///< of the residuals [grey values]: noise, and what interpolation blurs
  S min_gradient = S(5);        ///< a pixel with less tells nothing [grey values per pixel of the level]
  int max_pixels = 3000;        ///< per level, spread over it: more cost time and tell little
  int min_pixels = 60;          ///< fewer on a level: it is passed over
  S min_overlap = S(0.4);       ///< share of the reference's pixels that must be seen in the image
  S outside_deviations = S(3);  ///< a pixel outside costs as one that deviates so much, so that turning away
                                ///< from what does not fit is no way out
  S initial_damping = S(1e-4), min_damping = S(1e-9);  ///< lambda of Levenberg-Marquardt (see there)
};

/// How align_images() ended.
enum class ImageAlignmentStatus : std::uint8_t {
  converged,
  max_iterations,  ///< the finest level used still moved when its iterations ended; the pose is usable
  too_few_pixels,  ///< with depth and a gradient, on each level
  little_overlap   ///< less than min_overlap of them, or fewer than min_pixels, are seen in the image
};

/// The motion that align_images() found, and how well it explains the image.
template <std::floating_point S>
struct ImageAlignmentResult {
  SE3<S> T_image_reference;  ///< reference camera to the image's; the first start value on failure
  S brightness = S(0);       ///< how much brighter the image is [grey values]
  S scale = S(0);            ///< of the residuals on the finest level [grey values]
  int pixels = 0;            ///< compared on the finest level that has enough
  S overlap = S(0);          ///< share of the reference's that they are
  int iterations = 0;        ///< on all levels
  ImageAlignmentStatus status = ImageAlignmentStatus::too_few_pixels;
  [[nodiscard]] bool ok() const {
    return status == ImageAlignmentStatus::converged || status == ImageAlignmentStatus::max_iterations;
  }
};

/// A pixel of the reference: its point, grey value, and the derivative of the grey value by a left increment
/// of the point's place.
template <std::floating_point S>
struct AlignedPixel {
  Eigen::Matrix<S, 3, 1> p;  ///< in the reference camera [m]
  Eigen::Matrix<S, 1, 6> J;  ///< [grey values per metre and radian]
  S grey = S(0);
};

/// Memory of align_images(); keep it between calls to avoid allocation.
template <std::floating_point S>
struct ImageAlignmentWorkspace {
  std::vector<AlignedPixel<S>> pixels;
  std::vector<S> residuals, trial;  ///< NaN where the pixel is outside
  ScaleWorkspace<S> scale;
};

namespace detail {

/// Where the alignment stands.
template <std::floating_point S>
struct AlignedMotion {
  SE3<S> T_image_reference;
  S brightness = S(0), scale = S(1);
};

/// The motion between two images on one level of their pyramids as a LeastSquaresProblem: inverse
/// compositional, so that gradients and derivatives are those of the reference, computed once.
template <std::floating_point S, class Camera, RowImage I>
class ImageAlignmentProblem {
 public:
  ImageAlignmentProblem(const Camera& camera, const I& image, const Eigen::Vector2d& pixel_size,
                        const ImageAlignmentOptions<S>& options, ImageAlignmentWorkspace<S>& workspace)
      : camera_(camera),
        image_(image),
        inverse_size_(pixel_size.cwiseInverse().cast<S>()),
        options_(options),
        kernel_(TDistribution<S>::with_dimension(options.nu, 1)),
        ws_(workspace) {}

  /// Minimises from a motion. @return false, with nothing changed: from there nothing of the reference is
  /// seen
  [[nodiscard]] bool minimise(AlignedMotion<S>& motion, ImageAlignmentResult<S>& result) {
    motion_ = motion;
    for (int round = 0; round < options_.rounds; ++round) {
      compare(motion_, ws_.residuals);
      ScaleOptions<S> scale;
      scale.nu = options_.nu;
      scale.floor = options_.min_scale;
      const auto sigma = estimate_scale<S>(ws_.residuals, {}, scale, ws_.scale);
      if (!sigma) return false;
      motion_.scale = *sigma;
      const auto end =
          levenberg_marquardt<S>(*this, cost_of(ws_.residuals, motion_.scale), damping_of<S>(options_));
      result.iterations += end.iterations;
      result.status = status_of<ImageAlignmentStatus>(end.status);
    }
    motion = motion_;
    return true;
  }
  /// What a motion costs with a scale that need not be its own.
  [[nodiscard]] S cost(const AlignedMotion<S>& motion, S scale) {
    compare(motion, ws_.trial);
    return cost_of(ws_.trial, scale);
  }
  /// How many of the reference's pixels are seen.
  [[nodiscard]] int seen(const AlignedMotion<S>& motion) {
    compare(motion, ws_.trial);
    return static_cast<int>(
        std::count_if(ws_.trial.begin(), ws_.trial.end(), [](S r) { return std::isfinite(r); }));
  }

  void linearise() {
    system_.set_zero();
    const S information = S(1) / (motion_.scale * motion_.scale);
    for (std::size_t i = 0; i < ws_.pixels.size(); ++i) {
      const S r = ws_.residuals[i];
      if (!std::isfinite(r)) continue;
      Eigen::Matrix<S, 1, 7> J;
      J << -ws_.pixels[i].J, S(-1);
      system_.add_row(J, r, kernel_.weight(r * r * information) * information);
    }
  }
  [[nodiscard]] bool solve(const S& lambda) { return system_.solve(lambda, step_); }
  [[nodiscard]] S apply() {
    trial_ = motion_;
    trial_.T_image_reference = motion_.T_image_reference * SE3<S>::exp(step_.template head<6>()).inverse();
    trial_.brightness += step_(6);
    compare(trial_, ws_.trial);
    return cost_of(ws_.trial, motion_.scale);
  }
  [[nodiscard]] S accept(const S& trial) {
    motion_ = trial_;
    std::swap(ws_.residuals, ws_.trial);
    return trial;
  }
  void restore() {}
  [[nodiscard]] bool converged(bool moved, const S& decrease, const S& cost) const {
    return moved && decrease <= options_.tolerance * cost;
  }

 private:
  void compare(const AlignedMotion<S>& motion, std::vector<S>& residuals) const {
    residuals.resize(ws_.pixels.size());
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      residuals[i] = std::numeric_limits<S>::quiet_NaN();
      const auto x = camera_.project(motion.T_image_reference * ws_.pixels[i].p);
      if (!x) continue;
      const S u = (x->x() + S(0.5)) * inverse_size_.x() - S(0.5);
      const S v = (x->y() + S(0.5)) * inverse_size_.y() - S(0.5);
      if (const auto grey = bilinear<S>(image_, u, v))
        residuals[i] = *grey - motion.brightness - ws_.pixels[i].grey;
    }
  }

  [[nodiscard]] S cost_of(const std::vector<S>& residuals, S scale) const {
    const S information = S(1) / (scale * scale);
    const S outside = kernel_.rho(options_.outside_deviations * options_.outside_deviations);
    RhoSum<S, TDistribution<S>> inside(kernel_);
    std::size_t invisible = 0;
    for (const S r : residuals) {
      if (std::isfinite(r)) {
        inside.add(r * r * information);
      } else {
        ++invisible;
      }
    }
    return S(0.5) * (inside.value() + static_cast<S>(invisible) * outside);
  }

  const Camera& camera_;
  const I& image_;
  Eigen::Matrix<S, 2, 1> inverse_size_;
  const ImageAlignmentOptions<S>& options_;
  TDistribution<S> kernel_;
  ImageAlignmentWorkspace<S>& ws_;
  AlignedMotion<S> motion_, trial_;
  NormalEquations<S, 7> system_;
  Eigen::Matrix<S, 7, 1> step_ = Eigen::Matrix<S, 7, 1>::Zero();
};

/// The pixels of a level that have depth and a gradient, to `out`; every n-th where they are too many.
template <std::floating_point S, ImagePyramidLike P, DepthImage D, DifferentiableCameraOf<S> Camera>
void take_pixels(const P& reference, const D& depth, int level, const Camera& camera,
                 const ImageAlignmentOptions<S>& options, std::vector<AlignedPixel<S>>& out) {
  out.clear();
  const auto& image = reference.image(level);
  const Eigen::Matrix<S, 2, 1> size = reference.scale(level).template cast<S>();
  const S columns = static_cast<S>(depth.width()) / static_cast<S>(image.width());
  const S rows = static_cast<S>(depth.height()) / static_cast<S>(image.height());
  const auto each = [&](auto&& visit) {
    for (int v = 1; v + 1 < image.height(); ++v) {
      const int depth_v = static_cast<int>((static_cast<S>(v) + S(0.5)) * rows);
      const auto *above = image.row(v - 1), *row = image.row(v), *below = image.row(v + 1);
      for (int u = 1; u + 1 < image.width(); ++u) {
        const Eigen::Matrix<S, 1, 2> g(S(0.5) * (static_cast<S>(row[u + 1]) - static_cast<S>(row[u - 1])),
                                       S(0.5) * (static_cast<S>(below[u]) - static_cast<S>(above[u])));
        if (!(g.squaredNorm() >= options.min_gradient * options.min_gradient)) continue;
        const auto z = depth(static_cast<int>((static_cast<S>(u) + S(0.5)) * columns), depth_v);
        if (is_valid_depth(z)) visit(u, v, g, static_cast<S>(z), static_cast<S>(row[u]));
      }
    }
  };
  int found = 0;
  each([&](auto&&...) { ++found; });
  const int stride = std::max(1, (found + options.max_pixels - 1) / std::max(1, options.max_pixels));
  int visited = 0;
  each([&](int u, int v, const Eigen::Matrix<S, 1, 2>& g, S z, S grey) {
    if (visited++ % stride != 0) return;
    const Eigen::Matrix<S, 2, 1> at(static_cast<S>(u), static_cast<S>(v));
    const auto p = camera.unproject(to_base<S>(reference, at, level), z);
    if (!p) return;
    Eigen::Matrix<S, 2, 3> dx;
    if (!camera.project(*p, &dx)) return;
    // Component by component: g++ 12 sees packets of four floats in rows of three and warns.
    AlignedPixel<S> pixel;
    pixel.p = *p;
    pixel.grey = grey;
    std::array<S, 3> a;
    for (int i = 0; i < 3; ++i) {
      a[static_cast<std::size_t>(i)] = g(0) / size.x() * dx(0, i) + g(1) / size.y() * dx(1, i);
      pixel.J(i) = a[static_cast<std::size_t>(i)];
    }
    pixel.J(3) = p->y() * a[2] - p->z() * a[1];
    pixel.J(4) = p->z() * a[0] - p->x() * a[2];
    pixel.J(5) = p->x() * a[1] - p->y() * a[0];
    out.push_back(pixel);
  });
}

/// Minimises from each start. @return the motion that fits best, if any does
template <std::floating_point S, class Problem>
[[nodiscard]] std::optional<AlignedMotion<S>> best_of(Problem& problem, std::span<const SE3<S>> starts,
                                                      ImageAlignmentResult<S>& result) {
  std::optional<AlignedMotion<S>> best;
  for (const SE3<S>& start : starts) {
    AlignedMotion<S> motion;
    motion.T_image_reference = start;
    if (!problem.minimise(motion, result)) continue;
    // One scale for both, the smaller, or what fits nowhere would forgive itself most.
    const S scale = best ? std::min(best->scale, motion.scale) : motion.scale;
    if (!best || problem.cost(motion, scale) < problem.cost(*best, scale)) best = motion;
  }
  return best;
}

}  // namespace detail

/// The motion of a camera between two images by their grey values alone, without features (direct alignment,
/// Kerl et al., "Robust odometry estimation for RGB-D cameras", ICRA 2013, Eqs 7 to 15, with the
/// t-distribution of Eq 4 of the paper; inverse compositional as Baker and Matthews 2004): from coarse to
/// fine it minimises
///
///     sum rho(r^2 / sigma^2),  r = image(project(T p)) - brightness - reference(x),  p = unproject(x,
///     depth(x)),
///
/// over T and the change of brightness. It needs nothing but gradients and so finds the way through blur and
/// where few features are left; it is good to a fraction of a pixel of the finest level.
/// @param reference  pyramid of the reference image
/// @param depth      of the reference [m], of the size of its level 0 or any other that shows the same view;
///                   invalid where it shall not be looked at, as on what moves
/// @param image      pyramid of the present image, with the same sizes
/// @param camera     of both, over pixels of which pyramid.scale() tells the levels' size
/// @param starts     T_image_reference to start from, one or more: each is tried on the coarsest level
template <std::floating_point S, ImagePyramidLike P, DepthImage D, ImagePyramidLike Q,
          DifferentiableCameraOf<S> Camera>
[[nodiscard]] ImageAlignmentResult<S> align_images(const P& reference, const D& depth, const Q& image,
                                                   const Camera& camera, std::span<const SE3<S>> starts,
                                                   const ImageAlignmentOptions<S>& options,
                                                   ImageAlignmentWorkspace<S>& ws) {
  DYNSLAM_ASSERT(!starts.empty(), "a motion to start from");
  DYNSLAM_ASSERT(reference.size() == image.size(), "pyramids of as many levels");
  ImageAlignmentResult<S> result;
  result.T_image_reference = starts.front();
  std::optional<detail::AlignedMotion<S>> motion;
  std::size_t wanted = 0;  // pixels of the finest level that has enough
  for (int level = reference.size() - 1; level >= 0; --level) {
    detail::take_pixels(reference, depth, level, camera, options, ws.pixels);
    if (static_cast<int>(ws.pixels.size()) < options.min_pixels) continue;
    wanted = ws.pixels.size();
    const auto& present = image.image(level);
    detail::ImageAlignmentProblem<S, Camera, std::remove_cvref_t<decltype(present)>> problem(
        camera, present, image.scale(level), options, ws);
    if (motion) {
      (void)problem.minimise(*motion, result);
    } else {
      motion = detail::best_of<S>(problem, starts, result);
    }
    result.pixels = motion ? problem.seen(*motion) : 0;
  }
  if (wanted > 0) result.overlap = static_cast<S>(result.pixels) / static_cast<S>(wanted);
  if (wanted == 0) {
    result.status = ImageAlignmentStatus::too_few_pixels;
  } else if (result.pixels < options.min_pixels || result.overlap < options.min_overlap) {
    result.status = ImageAlignmentStatus::little_overlap;
  } else {
    result.T_image_reference = motion->T_image_reference;
    result.brightness = motion->brightness;
    result.scale = motion->scale;
  }
  return result;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
