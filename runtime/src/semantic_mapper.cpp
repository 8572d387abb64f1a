// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/semantic_mapper.hpp"

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

#include "dynslam/image/depth.hpp"
#include "dynslam/interop/octomap.hpp"
#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {

octomap::ColorOcTreeNode::Color class_colour(Label label) {
  switch (label) {
    case Label::person: return {220, 20, 60};
    case Label::chair: return {192, 0, 0};
    case Label::display: return {0, 64, 128};
    case Label::background: break;
  }
  return {128, 128, 128};
}

Label label_of_colour(const octomap::ColorOcTreeNode::Color& colour) {
  for (const Label label : {Label::chair, Label::display}) {
    if (colour == class_colour(label)) return label;
  }
  return Label::background;
}

SemanticMapper::SemanticMapper(const DistortedPinhole<double>& camera, int width, int height,
                               const SemanticMapperOptions& options)
    : options_(options), width_(width), tree_(options.resolution) {
  for (int v = options_.pixel_stride / 2; v < height; v += options_.pixel_stride) {
    for (int u = options_.pixel_stride / 2; u < width; u += options_.pixel_stride) {
      const auto ideal = camera.undistort_pixel(Eigen::Vector2d(u, v));
      if (!ideal) continue;
      rays_.push_back(camera.pinhole().ray(*ideal).cast<float>());
      pixels_.push_back(v * width + u);
    }
  }
  interop::set_parameters(tree_, options_.occupancy);
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

void SemanticMapper::insert(MapKeyframe keyframe) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return queue_.size() < options_.queue || failure_; });
  if (failure_) std::rethrow_exception(failure_);
  queue_.push_back(std::move(keyframe));
  changed_.notify_all();
}

void SemanticMapper::finish() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return (queue_.empty() && !busy_) || failure_; });
  if (failure_) std::rethrow_exception(failure_);
  if (tree_.size() > 0) tree_.updateInnerOccupancy();  // OctoMap does not look whether there is a root
}

void SemanticMapper::work(const std::stop_token& stop) {
  for (;;) {
    MapKeyframe keyframe;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [&] { return !queue_.empty(); })) return;
      keyframe = std::move(queue_.front());
      queue_.pop_front();
      busy_ = true;
      changed_.notify_all();
    }
    std::exception_ptr failure;
    try {
      fuse(keyframe);
    } catch (...) {
      failure = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    busy_ = false;
    if (failure) failure_ = failure;
    changed_.notify_all();
    if (failure) return;
  }
}

void SemanticMapper::fuse(const MapKeyframe& keyframe) {
  const Eigen::Matrix3f R = keyframe.T_w_c.rotation_matrix().cast<float>();
  const Eigen::Vector3f t = keyframe.T_w_c.translation().cast<float>();
  const octomap::point3d origin(t.x(), t.y(), t.z());
  const auto max_range = static_cast<float>(options_.max_range);
  hits_.clear();
  misses_.clear();
  hit_set_.clear();
  miss_set_.clear();

  // Surface voxels first, each with its votes; a voxel's first point stands for all when its ray is cast.
  struct End {
    Key key;
    octomap::point3d point;
  };
  std::vector<End> ends;
  for (std::size_t k = 0; k < rays_.size(); ++k) {
    const int pixel = pixels_[k];
    const int u = pixel % width_, v = pixel / width_;
    const float z = keyframe.depth.ptr<float>(v)[u];
    if (!is_valid_depth(z) || z > max_range) continue;
    if (!keyframe.dynamic_mask.empty() && keyframe.dynamic_mask.ptr<std::uint8_t>(v)[u] != 0) continue;
    const auto label = keyframe.labels.empty() ? Label::background : static_cast<Label>(keyframe.labels.ptr<std::uint8_t>(v)[u]);
    if (label == Label::person) continue;
    const Eigen::Vector3f p = R * (rays_[k] * z) + t;
    const octomap::point3d point(p.x(), p.y(), p.z());
    Key key;
    if (!tree_.coordToKeyChecked(point, key)) continue;
    if (hit_set_.insert(key).second) {
      hits_.push_back(key);
      ends.push_back({key, point});
    }
    Voxel& voxel = voxels_[key];
    voxel.labels.add(static_cast<std::uint8_t>(label));
    const auto& bgr = keyframe.bgr.ptr<cv::Vec3b>(v)[u];
    voxel.samples = std::min(voxel.samples + 1, 1000);
    for (int c = 0; c < 3; ++c) {
      float& mean = voxel.colour[static_cast<std::size_t>(c)];
      mean += (static_cast<float>(bgr[2 - c]) - mean) / static_cast<float>(voxel.samples);
    }
  }
  // Free space: every voxel that a ray passes, unless it holds a surface in the same image.
  for (const End& end : ends) {
    if (!tree_.computeRayKeys(origin, end.point, ray_)) continue;
    for (const Key& key : ray_) {
      if (hit_set_.contains(key)) continue;
      if (miss_set_.insert(key).second) misses_.push_back(key);
    }
  }
  for (const Key& key : misses_) tree_.updateNode(key, options_.occupancy.miss, true);
  for (const Key& key : hits_) {
    octomap::ColorOcTreeNode* node = tree_.updateNode(key, options_.occupancy.hit, true);
    const Voxel& voxel = voxels_[key];
    const auto label = static_cast<Label>(voxel.labels.top());
    if (label == Label::chair || label == Label::display) {
      node->setColor(class_colour(label));
    } else {
      octomap::ColorOcTreeNode::Color colour(static_cast<std::uint8_t>(voxel.colour[0]), static_cast<std::uint8_t>(voxel.colour[1]),
                                             static_cast<std::uint8_t>(voxel.colour[2]));
      if (label_of_colour(colour) != Label::background) colour.b ^= 1;  // never a class colour by chance
      node->setColor(colour);
    }
  }
}

void SemanticMapper::save(const std::filesystem::path& path) const {
  const std::filesystem::path temporary = path.string() + ".tmp.ot";
  if (!tree_.write(temporary.string())) throw InputError(path.string(), 0, "cannot be written");
  std::error_code error;
  std::filesystem::rename(temporary, path, error);
  if (error) throw InputError(path.string(), 0, "cannot be written: " + error.message());
}

}  // namespace dynslam::runtime
