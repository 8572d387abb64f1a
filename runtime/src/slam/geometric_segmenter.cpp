// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/geometric_segmenter.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <utility>

#include "dynslam/dynamics/classify.hpp"
#include "dynslam/dynamics/residuals.hpp"
#include "dynslam/dynamics/static_weight.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/robust/t_distribution.hpp"
#include "dynslam/runtime/stopwatch.hpp"

namespace dynslam::runtime {
namespace {

/// Ages, in frames, of the views that the present one is compared with: near ones follow what was
/// found, far ones show slow motion.
constexpr std::array<std::size_t, 7> kLags{1, 4, 8, 15, 25, 40, 60};
constexpr std::size_t kOldLag = 8;    // a mover has left its own volume by then
constexpr std::size_t kRestLag = 25;  // what has stayed for so long is at rest
constexpr std::size_t kMinMatches = 30;
constexpr std::uint8_t kPause =
    3;  // frames after which a keypoint that was not to be found is searched again
constexpr std::uint8_t kNeverSeen = 255;
// What a view's mask rests on: motion that was measured, or the a-priori mask alone (a person may sit still).
constexpr std::uint8_t kMoved = 1, kSuspected = 2;

}  // namespace

GeometricSegmenter::GeometricSegmenter(const CameraConfig& camera, const GeometryOptions& options)
    : camera_(camera),
      options_(options),
      width_((camera.width + options.stride - 1) / options.stride),
      height_((camera.height + options.stride - 1) / options.stride) {
  const auto cells = static_cast<std::size_t>(width_ * height_);
  const auto& pinhole = camera_.model.pinhole();
  pixel_of_cell_.assign(cells, -1);
  ray_x_.resize(cells);
  ray_y_.resize(cells);
  for (int j = 0; j < height_; ++j) {
    for (int i = 0; i < width_; ++i) {
      const auto c = static_cast<std::size_t>(j * width_ + i);
      const Eigen::Vector2d ideal((i + 0.5) * options_.stride - 0.5, (j + 0.5) * options_.stride - 0.5);
      const Eigen::Vector3d ray = pinhole.ray(ideal);
      ray_x_[c] = static_cast<float>(ray.x());
      ray_y_[c] = static_cast<float>(ray.y());
      const auto raw = camera_.model.distort_pixel(ideal);
      if (!raw) continue;
      const int u = static_cast<int>(std::lround(raw->x())), v = static_cast<int>(std::lround(raw->y()));
      if (u >= 0 && v >= 0 && u < camera_.width && v < camera_.height)
        pixel_of_cell_[c] = v * camera_.width + u;
    }
  }
  cell_of_pixel_.assign(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height),
                        -1);
  for (int v = 0; v < camera_.height; ++v) {
    cv::Range rows(height_, 0);
    for (int u = 0; u < camera_.width; ++u) {
      const auto ideal = camera_.model.undistort_pixel(Eigen::Vector2d(u, v));
      if (!ideal) continue;
      const int i = static_cast<int>(std::floor((ideal->x() + 0.5) / options_.stride));
      const int j = static_cast<int>(std::floor((ideal->y() + 0.5) / options_.stride));
      if (i >= 0 && j >= 0 && i < width_ && j < height_) {
        cell_of_pixel_[static_cast<std::size_t>(v * camera_.width + u)] = j * width_ + i;
        rows = cv::Range(std::min(rows.start, j), std::max(rows.end, j + 1));
      }
    }
    row_cells_.push_back(rows.end > 0 ? rows : cv::Range(0, 0));
  }
  for (auto* image : {&seed_, &barrier_, &mask_, &age_, &smooth_, &zone_, &verified_})
    image->resize(width_, height_);
  depth_.resize(width_, height_);
}

int GeometricSegmenter::cell_of_pixel(float u, float v) const {
  const int x = cvRound(u), y = cvRound(v);
  if (x < 0 || y < 0 || x >= camera_.width || y >= camera_.height) return -1;
  return cell_of_pixel_[static_cast<std::size_t>(y * camera_.width + x)];
}

bool GeometricSegmenter::verified_static(float u, float v) const {
  const int c = cell_of_pixel(u, v);
  return c >= 0 && verified_.data()[c] != 0;
}

std::vector<cv::Mat> flow_pyramid(const cv::Mat& gray, const GeometryOptions& options) {
  std::vector<cv::Mat> pyramid;
  // Neither the image's memory nor what lies around it there: its owner may use both again.
  constexpr bool kShare = false;
  cv::buildOpticalFlowPyramid(gray, pyramid, {options.lk_window, options.lk_window}, options.lk_levels, true,
                              cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED, cv::BORDER_CONSTANT, kShare);
  return pyramid;
}

void GeometricSegmenter::set_reference(const Frame& frame, const RgbdFrame& input,
                                       const ImagePyramid& pyramid) {
  reference_ = Reference();
  reference_.gray = input.gray.clone();  // the caller may use its image again
  reference_.T_c_w = frame.T_c_w;
  reference_.pyramid = input.flow_pyramid.empty() ? flow_pyramid(input.gray, options_) : input.flow_pyramid;
  // All keypoints with depth, static and dynamic alike; thinned evenly where there are too many.
  std::vector<std::size_t> usable;
  for (std::size_t i = 0; i < frame.features.size(); ++i) {
    const float z = frame.features[i].depth;
    if (is_valid_depth(z) && static_cast<double>(z) < options_.max_depth) usable.push_back(i);
  }
  const auto wanted = static_cast<std::size_t>(options_.lk_points);
  const std::size_t n = std::min(wanted, usable.size());
  for (std::size_t k = 0; k < n; ++k) {
    const Feature& f = frame.features[usable[k * usable.size() / n]];
    const Eigen::Vector2d ideal(f.x, f.y);
    reference_.pixels.emplace_back(f.u, f.v);
    reference_.patches.push_back(cut_patch<double>(pyramid, Eigen::Vector2d(f.u, f.v), f.octave));
    reference_.patches.back().depth = f.depth;
    reference_.ideal.push_back(ideal);
    reference_.pause.push_back(0);
    reference_.points.push_back(camera_.model.pinhole().ray(ideal) * static_cast<double>(f.depth));
  }
}

void GeometricSegmenter::reduce(const cv::Mat& depth) {
  const int w = camera_.width, h = camera_.height;
  const auto* raw = depth.ptr<float>();
  const auto step = static_cast<int>(depth.step1());
  for (std::size_t c = 0; c < pixel_of_cell_.size(); ++c) {
    float z = std::numeric_limits<float>::quiet_NaN();
    bool smooth = false;
    const int pixel = pixel_of_cell_[c];
    if (pixel >= 0) {
      const int u = pixel % w, v = pixel / w;
      const int reach = options_.stride / 2;
      float lo = std::numeric_limits<float>::max(), hi = 0.0F;
      int valid = 0;
      const auto look = [&](int x, int y) {
        if (x < 0 || y < 0 || x >= w || y >= h) return;
        const float d = raw[y * step + x];
        if (!is_valid_depth(d)) return;
        lo = std::min(lo, d);
        hi = std::max(hi, d);
        ++valid;
      };
      look(u, v);
      const float centre = valid > 0 ? lo : z;
      look(u - reach, v);
      look(u + reach, v);
      look(u, v - reach);
      look(u, v + reach);
      if (valid > 0) z = is_valid_depth(centre) ? centre : lo;
      // At a depth edge the sensor makes up values between the two surfaces: no evidence from there.
      smooth = valid >= 4 && hi - lo < options_.step_base + options_.step_quad * lo * lo;
    }
    depth_.view().data()[c] = z;
    smooth_.view().data()[c] = smooth ? 1 : 0;
  }
}

void GeometricSegmenter::track_reference(const RgbdFrame& input, const ImagePyramid& image,
                                         const SE3<double>& T_c_w, const cv::Mat& prior,
                                         GeometryStatistics& statistics) {
  const cv::Mat &gray = input.gray, &depth = input.depth;
  matches_.clear();
  Stopwatch watch;
  const std::size_t n = reference_.pixels.size();
  std::vector<cv::Point2f> from, to, projected;  // of those that must be searched
  std::vector<std::size_t> index;
  std::vector<Eigen::Matrix2d> warps;
  struct Track {
    std::size_t reference;
    cv::Point2f to, projected;
    Eigen::Vector2d ideal;  // of `to`
    bool masked;            // on the a-priori mask
    bool mismatch;
  };
  std::vector<Track> tracks;
  const auto add_track = [&](std::size_t i, const cv::Point2f& found, const cv::Point2f& expected) {
    const auto ideal = camera_.model.undistort_pixel(Eigen::Vector2d(found.x, found.y));
    const int u = cvRound(found.x), v = cvRound(found.y);
    if (!ideal || u < 0 || v < 0 || u >= camera_.width || v >= camera_.height) return;
    const bool masked = !prior.empty() && prior.at<std::uint8_t>(v, u) != 0;
    tracks.push_back({i, found, expected, *ideal, masked, false});
  };
  // Most points are where the pose says. A patch looks there first; only who is not found there is searched
  // by optical flow, and what that finds must look like the patch.
  const SE3<double> T_cur_ref = T_c_w * reference_.T_c_w.inverse();
  const Eigen::Matrix3d R = T_cur_ref.rotation_matrix();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d p_c = T_cur_ref * reference_.points[i];
    const auto x = camera_.model.project(p_c);
    if (!x || x->x() < 8 || x->y() < 8 || x->x() >= camera_.width - 8 || x->y() >= camera_.height - 8)
      continue;
    const cv::Point2f expected(static_cast<float>(x->x()), static_cast<float>(x->y()));
    const PointPatch& patch = reference_.patches[i];
    const auto warp = patch_warp(camera_.model.pinhole(), patch, p_c, R);
    if (patch.level < 0 || !warp) continue;
    const auto match = match_patch<double>(image, patch, *warp, *x);
    if (match && (match->x - *x).norm() < options_.at_rest_px) {
      add_track(i, {static_cast<float>(match->x.x()), static_cast<float>(match->x.y())}, expected);
      continue;
    }
    if (reference_.pause[i] > 0) {
      --reference_.pause[i];
      continue;
    }
    from.push_back(reference_.pixels[i]);
    to.push_back(expected);
    index.push_back(i);
    warps.push_back(*warp);
  }
  if (!from.empty()) {
    projected = to;
    const cv::Size window(options_.lk_window, options_.lk_window);
    const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 10, 0.1);
    const std::vector<cv::Mat> pyramid =
        input.flow_pyramid.empty() ? flow_pyramid(gray, options_) : input.flow_pyramid;
    std::vector<std::uint8_t> found;
    cv::calcOpticalFlowPyrLK(reference_.pyramid, pyramid, from, to, found, cv::noArray(), window,
                             options_.lk_levels, stop, cv::OPTFLOW_USE_INITIAL_FLOW);
    for (std::size_t k = 0; k < from.size(); ++k) {
      const Eigen::Vector2d x(to[k].x, to[k].y);
      const auto match = found[k] != 0 ? match_patch<double>(image, reference_.patches[index[k]], warps[k], x)
                                       : std::nullopt;
      if (match && (match->x - x).norm() <= options_.confirmed_px) {
        add_track(index[k], to[k], projected[k]);
      } else {
        reference_.pause[index[k]] = kPause;
      }
    }
  }
  statistics.lk_ms = watch.lap_ms();

  statistics.tracked = static_cast<int>(tracks.size());

  // Eq (8): matches far from their epipolar line are mismatches. F is estimated outside the a-priori
  // mask only, and only where the translation gives it meaning.
  std::vector<Eigen::Vector2d> x, x_m;
  for (const Track& t : tracks) {
    if (t.masked) continue;
    x.push_back(reference_.ideal[t.reference]);
    x_m.push_back(t.ideal);
  }
  if (x.size() >= kMinMatches && baseline_verdict<double>(x, x_m, camera_.model.pinhole(), T_cur_ref.so3(),
                                                          options_.min_parallax_px) == Baseline::sufficient) {
    FundamentalRansacOptions<double> ransac;
    ransac.threshold_px = options_.epipolar_px;
    ransac.seed = options_.seed;
    const auto fundamental = fundamental_ransac<double>(x, x_m, ransac);
    if (fundamental.status == FundamentalStatus::ok) {
      statistics.epipolar_used = true;
      for (Track& t : tracks) {
        t.mismatch = line_distance<double>(fundamental.F, reference_.ideal[t.reference], t.ideal) >
                     options_.epipolar_px;
        statistics.epipolar_outliers += t.mismatch ? 1 : 0;
      }
    }
  }

  // Eqs (3), (5), (6) per match.
  const auto reference_gray = interop::view<const std::uint8_t>(reference_.gray);
  const auto present_gray = interop::view<const std::uint8_t>(gray);
  const auto present_depth = interop::view<const float>(depth);
  std::vector<KeypointResiduals<double>> residuals(tracks.size());
  std::vector<double> photometric, reprojection, scaled_depth;
  const DepthNoise<double> noise;
  for (std::size_t k = 0; k < tracks.size(); ++k) {
    const Track& t = tracks[k];
    KeypointResiduals<double>& r = residuals[k];
    const Eigen::Vector3d p_c = T_cur_ref * reference_.points[t.reference];
    const Eigen::Vector2d from_px(reference_.pixels[t.reference].x, reference_.pixels[t.reference].y);
    const Eigen::Vector2d projected_px(t.projected.x, t.projected.y);
    const Eigen::Vector2d to_px(t.to.x, t.to.y);
    r.reprojection = (projected_px - to_px).norm();
    const auto e_i = photometric_residual<double>(reference_gray, from_px, present_gray, projected_px);
    r.has_photometric = e_i.has_value();
    r.photometric = e_i.value_or(0.0);
    const auto e_d = depth_residual<double>(p_c, present_depth, to_px);
    r.has_depth = e_d.has_value();
    r.depth = e_d.value_or(0.0);
    if (t.masked || t.mismatch) continue;
    if (r.has_photometric) photometric.push_back(r.photometric);
    reprojection.push_back(r.reprojection);
    if (r.has_depth) scaled_depth.push_back(r.depth / noise.sigma(p_c.z()));
  }
  if (reprojection.size() < kMinMatches) {
    statistics.residuals_ms = watch.lap_ms();
    return;
  }
  // Exposure differs between the two images: the median photometric error is not a residual.
  double bias = 0;
  if (!photometric.empty()) {
    std::vector<double> sorted = photometric;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    bias = *middle;
    for (double& e : photometric) e -= bias;
  }
  // Floors: with perfect tracking the estimate would go to zero and everything would be an outlier.
  const auto scale_of = [&](const std::vector<double>& values, double floor) {
    const auto sigma = estimate_scale<double>(std::span<const double>(values), options_.nu);
    return sigma ? std::max(floor, *sigma) : floor;
  };
  statistics.sigma_photometric = scale_of(photometric, 6.0);
  statistics.sigma_reprojection = scale_of(reprojection, 0.7);
  statistics.sigma_depth_factor = scale_of(scaled_depth, 2.0);

  for (std::size_t k = 0; k < tracks.size(); ++k) {
    const Track& t = tracks[k];
    if (t.mismatch) continue;
    KeypointResiduals<double>& r = residuals[k];
    r.photometric -= bias;
    const double z = (T_cur_ref * reference_.points[t.reference]).z();
    const StaticWeightScales<double> scales{statistics.sigma_photometric, statistics.sigma_reprojection,
                                            statistics.sigma_depth_factor * noise.sigma(z)};
    const double weight = static_weight<double>(r, scales, options_.nu);
    const bool dynamic = is_dynamic(weight, options_.tau);
    statistics.dynamic_keypoints += dynamic ? 1 : 0;
    matches_.push_back({reference_.pixels[t.reference], t.to, static_cast<float>(weight), dynamic});
  }
  statistics.residuals_ms = watch.lap_ms();
}

/// Where an earlier view had the surfaces of the cells first, first + 1, ...: cell (-1: outside) and depth.
void GeometricSegmenter::find_cells(const SE3<double>& T_v_c, std::size_t first, std::span<int> cell,
                                    std::span<float> z) const {
  const Eigen::Matrix3f R = T_v_c.rotation_matrix().cast<float>();
  const Eigen::Vector3f t = T_v_c.translation().cast<float>();
  const auto& pinhole = camera_.model.pinhole();
  const float per_cell = 1.0F / static_cast<float>(options_.stride);
  const float fx = static_cast<float>(pinhole.fx()) * per_cell,
              fy = static_cast<float>(pinhole.fy()) * per_cell;
  const float cx = (static_cast<float>(pinhole.cx()) + 0.5F) * per_cell,
              cy = (static_cast<float>(pinhole.cy()) + 0.5F) * per_cell;
  const auto max_depth = static_cast<float>(options_.max_depth);
  const auto width = static_cast<float>(width_), height = static_cast<float>(height_);
  constexpr float kNear = 0.2F;
  const float *depth = depth_.view().data() + first, *rx = ray_x_.data() + first, *ry = ray_y_.data() + first;
  for (std::size_t k = 0; k < cell.size(); ++k) {  // without branches: several at once
    const float d = depth[k];
    const float pz = d * (R(2, 0) * rx[k] + R(2, 1) * ry[k] + R(2, 2)) + t.z();
    const float inverse = 1.0F / pz;
    const float x = fx * (d * (R(0, 0) * rx[k] + R(0, 1) * ry[k] + R(0, 2)) + t.x()) * inverse + cx;
    const float y = fy * (d * (R(1, 0) * rx[k] + R(1, 1) * ry[k] + R(1, 2)) + t.y()) * inverse + cy;
    const bool inside =
        (d > 0.0F) & (d < max_depth) & (pz >= kNear) & (x >= 0.0F) & (y >= 0.0F) & (x < width) & (y < height);
    // What is outside, or not a number, is not a place that an integer could hold.
    const int i = static_cast<int>(inside ? x : 0.0F), j = static_cast<int>(inside ? y : 0.0F);
    cell[k] = inside ? j * width_ + i : -1;
    z[k] = pz;
  }
}

void GeometricSegmenter::check_free_space(const SE3<double>& T_c_w) {
  const auto cells = pixel_of_cell_.size();
  std::vector<std::uint8_t> violations(cells, 0), support(cells, 0);
  age_.fill(kNeverSeen);
  const std::size_t oldest = views_.size();
  const std::size_t old_lag = std::max<std::size_t>(2, std::min(kOldLag, oldest));
  constexpr std::size_t kBlock = 64;
  std::array<int, kBlock> cell;
  std::array<float, kBlock> z;
  const std::uint8_t* smooth = smooth_.view().data();
  std::uint8_t* age = age_.view().data();
  for (std::size_t k = 0; k < kLags.size(); ++k) {
    std::size_t lag = kLags[k];
    if (lag > oldest) {  // young sequence: the oldest view there is, once
      if (k == 0 || oldest <= kLags[k - 1]) break;
      lag = oldest;
    }
    const View& view = views_[lag - 1];
    const SE3<double> T_v_c = view.T_c_w * T_c_w.inverse();
    const float* nearest = view.bounds.nearest.view().data();
    const float* farthest = view.bounds.farthest.view().data();
    const std::uint8_t* dynamic = view.dynamic.view().data();
    const std::uint8_t* view_age = view.age.view().data();
    for (std::size_t c = 0; c < cells; ++c) {
      const std::size_t b = c % kBlock;
      if (b == 0) {
        const std::size_t n = std::min(kBlock, cells - c);
        find_cells(T_v_c, c, std::span(cell).first(n), std::span(z).first(n));
      }
      if (cell[b] < 0) continue;
      const auto q = static_cast<std::size_t>(cell[b]);
      switch (free_space_evidence(z[b], nearest[q], farthest[q], options_.margins)) {
        case DepthEvidence::violation:
          if (smooth[c] != 0 && lag > 1) ++violations[c];
          break;
        case DepthEvidence::consistent:
          if (dynamic[q] == kMoved && lag <= kLags[1]) {
            age[c] = static_cast<std::uint8_t>(
                std::min<std::size_t>({age[c], view_age[q] + lag, kNeverSeen - 1U}));
          }
          // A surface that was in this very place long ago is at rest, whatever it was taken for then.
          if (lag >= (dynamic[q] == kMoved ? kRestLag : old_lag)) ++support[c];
          break;
        case DepthEvidence::unknown:
          break;
      }
    }
  }
  std::uint8_t* seed = seed_.view().data();
  std::uint8_t* barrier = barrier_.view().data();
  std::uint8_t* verified = verified_.data();
  for (std::size_t c = 0; c < cells; ++c) {
    const bool contradicted = violations[c] > support[c];
    const bool carried = age[c] <= options_.carry_frames && support[c] == 0;
    seed[c] = contradicted || carried ? 1 : 0;
    if (contradicted) age[c] = 0;
    barrier[c] = verified[c] = support[c] > violations[c] ? 1 : 0;
  }
}

void GeometricSegmenter::add_keypoint_seeds() {
  // One keypoint may err; three close together that all move do not, and outweigh the depth check,
  // which is blind to motion inside a surface.
  constexpr float kRadius = 40.0F;
  constexpr int kSupport = 3;
  for (const Match& m : matches_) {
    if (!m.dynamic) continue;
    int near = 0, near_static = 0;
    for (const Match& other : matches_) {
      if (std::abs(other.to.x - m.to.x) > kRadius || std::abs(other.to.y - m.to.y) > kRadius) continue;
      ++(other.dynamic ? near : near_static);
    }
    if (near < kSupport || near < near_static) continue;
    const int c = cell_of_pixel(m.to.x, m.to.y);
    if (c < 0) continue;
    const int i = c % width_, j = c / width_;
    for (int dj = -1; dj <= 1; ++dj) {
      for (int di = -1; di <= 1; ++di) {
        if (i + di < 0 || j + dj < 0 || i + di >= width_ || j + dj >= height_) continue;
        seed_(i + di, j + dj) = 1;
        barrier_(i + di, j + dj) = 0;
        age_(i + di, j + dj) = 0;
      }
    }
  }
}

void GeometricSegmenter::grow(GeometryStatistics& statistics) {
  remove_small(seed_.view(), options_.min_seed_cells, morphology_);
  std::vector<PixelIndex> seeds;
  for (int j = 0; j < height_; ++j) {
    for (int i = 0; i < width_; ++i) {
      if (seed_(i, j) != 0) seeds.push_back({i, j});
    }
  }
  statistics.seeds = static_cast<int>(seeds.size());
  mask_.fill(0);
  // Growing completes objects around what was seen to move; it must not wander through parts of the
  // scene that nothing is known of yet, so it stays near fresh evidence.
  for (int j = 0; j < height_; ++j) {
    for (int i = 0; i < width_; ++i) zone_(i, j) = seed_(i, j) != 0 && age_(i, j) == 0 ? 1 : 0;
  }
  dilate(zone_.view(), zone_.view(), options_.growing_reach, morphology_);
  for (int j = 0; j < height_; ++j) {
    for (int i = 0; i < width_; ++i) {
      if (zone_(i, j) == 0 && seed_(i, j) == 0) barrier_(i, j) = 1;
    }
  }
  if (!seeds.empty()) {
    RegionGrowingOptions growing;
    growing.max_region_fraction = options_.max_fraction;
    growing.min_region_pixels = options_.min_region_cells;
    const RelativeStep<float> criterion{options_.step_base, options_.step_quad};
    const auto result =
        grow_regions(std::as_const(depth_).view(), std::as_const(barrier_).view(),
                     std::span<const PixelIndex>(seeds), criterion, growing, mask_.view(), growing_);
    statistics.regions_leaked = result.regions_leaked;
    // A hole in a mover is the mover: its inside overlaps where it was before and looks at rest. What touches
    // the outside at a corner is not counted as inside: it more often is what is seen past the mover.
    fill_holes(mask_.view(), options_.max_hole_cells, Connectivity::eight, morphology_);
  }
  // Cells that only the growing reached are as old as the newest evidence of their region; without
  // that a mask would feed on itself.
  const int n = connected_components(mask_.view(), morphology_.labels, morphology_.counts, morphology_);
  region_age_.assign(static_cast<std::size_t>(n) + 1, kNeverSeen);
  const int* label = morphology_.labels.data();
  std::uint8_t* age = age_.data();
  const std::uint8_t* seed = seed_.data();
  for (std::size_t c = 0; c < pixel_of_cell_.size(); ++c) {
    if (label[c] == 0 || seed[c] == 0) continue;
    auto& youngest = region_age_[static_cast<std::size_t>(label[c])];
    youngest = std::min(youngest, age[c]);
  }
  for (std::size_t c = 0; c < pixel_of_cell_.size(); ++c) {
    if (label[c] != 0 && seed[c] == 0) age[c] = region_age_[static_cast<std::size_t>(label[c])];
  }
}

void GeometricSegmenter::enlarge(const cv::Mat& depth, cv::Mat& mask) {
  mask = cv::Mat::zeros(camera_.height, camera_.width, CV_8UC1);
  const std::uint8_t* cells = mask_.view().data();
  if (std::none_of(cells, cells + width_ * height_, [](std::uint8_t c) { return c != 0; })) return;
  const float* cell_depth = depth_.view().data();
  // Only at the rim of a region must pixels be looked at one by one.
  enum : std::uint8_t { kOutside, kRim, kInside };
  for (int j = 0; j < height_; ++j) {
    for (int i = 0; i < width_; ++i) {
      bool any = false, all = true;
      for (int y = std::max(0, j - 1); y <= std::min(height_ - 1, j + 1); ++y) {
        for (int x = std::max(0, i - 1); x <= std::min(width_ - 1, i + 1); ++x) {
          const bool on = cells[y * width_ + x] != 0;
          any = any || on;
          all = all && on;
        }
      }
      zone_(i, j) = all ? kInside : any ? kRim : kOutside;
    }
  }
  const std::uint8_t* zone = zone_.data();
  const auto near_region = [&](cv::Range rows) {
    return std::any_of(zone + rows.start * width_, zone + rows.end * width_,
                       [](std::uint8_t z) { return z != kOutside; });
  };
  // Each pixel near the region follows the neighbouring cell whose depth is most like its own, which
  // restores the object's outline at full resolution.
  for (int v = 0; v < camera_.height; ++v) {
    if (!near_region(row_cells_[static_cast<std::size_t>(v)])) continue;
    const float* z = depth.ptr<float>(v);
    std::uint8_t* out = mask.ptr<std::uint8_t>(v);
    for (int u = 0; u < camera_.width; ++u) {
      const int c = cell_of_pixel_[static_cast<std::size_t>(v * camera_.width + u)];
      if (c < 0 || zone[c] == kOutside) continue;
      if (zone[c] == kInside) {
        out[u] = 255;
        continue;
      }
      const int i = c % width_, j = c / width_;
      int on = 0, total = 0;
      float best = std::numeric_limits<float>::max();
      std::uint8_t verdict = 0;
      for (int y = std::max(0, j - 1); y <= std::min(height_ - 1, j + 1); ++y) {
        for (int x = std::max(0, i - 1); x <= std::min(width_ - 1, i + 1); ++x) {
          const auto q = static_cast<std::size_t>(y * width_ + x);
          ++total;
          on += cells[q] != 0 ? 1 : 0;
          const float difference = std::abs(cell_depth[q] - z[u]);
          if (difference < best) {
            best = difference;
            verdict = cells[q];
          }
        }
      }
      const bool valid = is_valid_depth(z[u]);
      if ((valid && verdict != 0) || (!valid && 2 * on >= total)) out[u] = 255;
    }
  }
}

cv::Mat GeometricSegmenter::segment(const RgbdFrame& input, const ImagePyramid& pyramid,
                                    const SE3<double>& T_c_w, const cv::Mat& prior,
                                    GeometryStatistics& statistics) {
  track_reference(input, pyramid, T_c_w, prior, statistics);
  Stopwatch watch;
  reduce(input.depth);
  if (options_.free_space) {
    check_free_space(T_c_w);
  } else {
    for (auto* image : {&seed_, &barrier_, &verified_}) image->fill(0);
    age_.fill(kNeverSeen);
  }
  add_keypoint_seeds();
  statistics.dense_ms = watch.lap_ms();
  grow(statistics);
  cv::Mat mask;
  enlarge(input.depth, mask);
  statistics.growing_ms = watch.lap_ms();
  return mask;
}

void GeometricSegmenter::follow(const SE3<double>& D) {
  for (View& view : views_) view.T_c_w = view.T_c_w * D;
}

void GeometricSegmenter::remember(const cv::Mat& depth, const SE3<double>& T_c_w, const cv::Mat& dynamic_mask,
                                  bool segmented) {
  if (!segmented) {
    reduce(depth);
    age_.fill(kNeverSeen);
  }
  View view;
  if (!spare_.empty()) {
    view = std::move(spare_.back());
    spare_.pop_back();
  }
  view.bounds.compute(std::as_const(depth_).view());
  view.T_c_w = T_c_w;
  view.dynamic.resize(width_, height_);
  view.age.resize(width_, height_);
  for (int j = 0; j < height_; ++j) {
    for (int i = 0; i < width_; ++i) {
      const int pixel = pixel_of_cell_[static_cast<std::size_t>(j * width_ + i)];
      const bool dynamic = pixel >= 0 && dynamic_mask.ptr<std::uint8_t>()[pixel] != 0;
      view.dynamic(i, j) = !dynamic ? 0 : (segmented && mask_(i, j) != 0 ? kMoved : kSuspected);
      // A mask that the geometry did not find (the semantic one) counts as fresh evidence.
      view.age(i, j) = dynamic && age_(i, j) != kNeverSeen ? age_(i, j) : std::uint8_t{0};
    }
  }
  views_.push_front(std::move(view));
  if (views_.size() > kLags.back()) {
    spare_.push_back(std::move(views_.back()));
    views_.pop_back();
  }
}

}  // namespace dynslam::runtime
