// SPDX-License-Identifier: BSD-3-Clause
#include "slam/separate_maps.hpp"

#include <algorithm>
#include <utility>

namespace dynslam::runtime {

TrackResult SeparateMap::track(const RgbdFrame& frame, const std::optional<Masks>& prior,
                               bool lost_elsewhere) {
  TrackResult result = tracker_.track(frame, prior);
  if (result.ok() && lost_elsewhere) frames_.add(frame, result);
  if (result.ok()) {
    lost_since.reset();
  } else if (!lost_since) {
    lost_since = frame.t;
  }
  return result;
}

bool SeparateMap::agrees(const SE3<double>& T_main_c, const SE3<double>& T_w_c,
                         const NewMapOptions& options) {
  // By how much the camera is off where the placing of the frame before is taken.
  const SE3<double> off = T_main_c.inverse() * (T_main_w_ * T_w_c);
  const bool same = agreeing_ > 0 && off.translation().norm() < options.agreement &&
                    off.so3().log().norm() < options.agreement_turn;
  T_main_w_ = T_main_c * T_w_c.inverse();
  agreeing_ = same ? agreeing_ + 1 : 1;
  return agreeing_ >= options.agreeing;
}

void SeparateMap::keep(Scan scan, std::size_t most) {
  if (scans_.size() >= std::max<std::size_t>(2, most)) {  // every other one shows most of what there was
    std::size_t kept = 0;
    for (std::size_t i = 0; i < scans_.size(); i += 2) scans_[kept++] = std::move(scans_[i]);
    scans_.resize(kept);
  }
  scans_.push_back(std::move(scan));
}

std::unique_ptr<SeparateMap> SeparateMaps::see(const RgbdFrame& frame, const std::optional<Masks>& prior,
                                               TrackResult& result) {
  if (result.state == TrackingState::not_initialised || !options_.begin) return nullptr;
  if (result.ok()) {
    lost_since_.reset();
    return maps_.empty() ? nullptr : see_found(frame, prior, result);
  }
  if (!lost_since_) lost_since_ = frame.t;
  if (frame.t - *lost_since_ >= options_.after) see_lost(frame, prior, result);
  return nullptr;
}

void SeparateMaps::see_lost(const RgbdFrame& frame, const std::optional<Masks>& prior, TrackResult& result) {
  const bool none = maps_.empty() || !maps_.back()->watched;
  const bool lost =
      !none && maps_.back()->lost_since && frame.t - *maps_.back()->lost_since >= options_.after;
  if (lost && maps_.back()->frames().size() > 0) maps_.back()->watched = false;
  if (none || !maps_.back()->watched) maps_.push_back(std::make_unique<SeparateMap>(camera_, tracking_));
  SeparateMap& map = *maps_.back();
  map.disagrees();
  const TrackResult own = map.track(frame, prior, true);
  if (!own.ok()) return;
  if (map.number == 0) map.number = 1 + ++begun_;
  result.separate = SeparatePose{map.number, own.T_w_c};
  result.dynamic_mask = own.dynamic_mask;
  if (own.keyframe && scans_) map.keep({own, frame, prior}, options_.scans);
}

std::unique_ptr<SeparateMap> SeparateMaps::see_found(const RgbdFrame& frame,
                                                     const std::optional<Masks>& prior,
                                                     const TrackResult& result) {
  // One in which nothing was ever seen is none.
  std::erase_if(maps_, [](const auto& map) { return map->frames().size() == 0; });
  for (auto& map : maps_) {
    if (!map->watched && !result.keyframe) continue;
    const TrackResult own = map->track(frame, prior, false);
    map->watched = own.ok() && ++map->beside < options_.patience;
    if (!map->watched) map->beside = 0;
    if (!own.ok()) {
      map->disagrees();
      continue;
    }
    if (!map->agrees(result.T_w_c, own.T_w_c, options_)) continue;
    std::unique_ptr<SeparateMap> joined = std::move(map);
    std::erase(maps_, nullptr);
    return joined;
  }
  return nullptr;
}

void SeparateMaps::finish() {
  for (auto& map : maps_) map->tracker().finish();
}

}  // namespace dynslam::runtime
