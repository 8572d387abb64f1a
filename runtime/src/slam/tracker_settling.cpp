// SPDX-License-Identifier: BSD-3-Clause
// How a pose is made sure of on the local map where the start was poor.
#include <algorithm>
#include <vector>

#include "median.hpp"
#include "slam/tracker_present.hpp"

namespace dynslam::runtime {

/// From a poor start the local map's points may be matched to a pose that is centimetres off, and still be
/// many. Another look from there finds those that were missed, and so on for as long as they grow more.
bool Tracker::settle_on_local_map(Present& now, int wanted) {
  const PoseSearchOptions& o = options_.search;
  int most = 0;
  for (int pass = 0; pass < o.settling_passes; ++pass) {
    if (!prove_on_local_map(now, std::min(wanted, o.min_inliers))) return false;
    const bool grows = now.result.inliers >= o.settling_growth * most;
    most = std::max(most, now.result.inliers);
    if (!grows) break;
  }
  return most >= wanted;
}

/// Patches of what repeats, as the keys of a keyboard, fit beside their place almost as well as there, and a
/// pose that hardly anything else tells goes with them. Then the points of all else are missing. Where far
/// fewer fit than usually, poses a little to the side are tried as well, and one that more points fit is
/// taken. Not farther: there the next key has most. Points made a moment ago do not count: they are where
/// they were seen, whatever they move with, and a board that has just come in would be followed.
/// @return whether there was reason to look
bool Tracker::look_around(Present& now) {
  const PoseSearchOptions& o = options_.search;
  if (!additions_.look_around || now.result.inliers >= o.fallen_inliers * usual_inliers_) return false;
  Attempt best = attempt(now);
  int most = old_matches(now.frame);
  const SE3<double> centre = now.T_c_w;
  const double step = o.aside / camera_.model.pinhole().fx() * depth_of_matches(now);
  for (const int y : {-1, 0, 1}) {
    for (const int x : {-1, 0, 1}) {
      if (x == 0 && y == 0) continue;
      matcher_.clear(now.frame);
      now.T_c_w = SE3<double>(SO3<double>(), {x * step, y * step, 0}) * centre;
      if (!settle_on_local_map(now, o.min_inliers)) continue;
      const int old = old_matches(now.frame);
      if (old < o.settling_growth * most) continue;
      best = attempt(now);
      most = old;
    }
  }
  take_back(now, best);
  return true;
}

/// How many matches of a frame are with points that were seen for a while.
int Tracker::old_matches(const Frame& frame) const {
  return static_cast<int>(std::count_if(frame.point.begin(), frame.point.end(), [&](int p) {
    return p >= 0 && map_.point(p).visible >= options_.arbitration.young;
  }));
}

/// Median depth of the points that a frame matches [m]; 0 without any.
double Tracker::depth_of_matches(const Present& now) const {
  std::vector<double> depths;
  for (const int p : now.frame.point) {
    if (p >= 0) depths.push_back((now.T_c_w * map_.point(p).p_w).z());
  }
  return median_of(depths);
}

}  // namespace dynslam::runtime
