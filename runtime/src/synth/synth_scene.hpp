// SPDX-License-Identifier: BSD-3-Clause
// The synthetic office: geometry, textures and people. Internal to the runtime.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "dynslam/robust/split_mix64.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/synth/synth.hpp"

namespace dynslam::runtime::synth {

/// What pictures and sensors draw from the generator.
class Random {
 public:
  explicit Random(std::uint64_t seed) : generator_(seed) {}
  double uniform(double low, double high);
  int integer(int low, int high);  ///< both ends included
  double normal();

 private:
  SplitMix64 generator_;
};

/// A picture repeated over a surface, with reduced copies against aliasing.
struct Texture {
  std::vector<cv::Mat> levels;  ///< CV_8UC3
  double texels_per_metre = 1;
};

struct Triangle {
  std::array<Eigen::Vector3d, 3> p;   ///< world [m]
  std::array<Eigen::Vector2d, 3> uv;  ///< metres on the surface
  Eigen::Vector3d normal;
  int texture = 0;
  Label label = Label::background;
  std::uint16_t instance = 0;  ///< 0: none
  bool dynamic = false, box = false;
};

/// Static furniture, and people and boxes that depend on time. World: x right, y forward, z up.
class Scene {
 public:
  explicit Scene(const SynthOptions& options);
  [[nodiscard]] const std::vector<Texture>& textures() const { return textures_; }
  /// Everything at `t` seconds.
  [[nodiscard]] std::vector<Triangle> triangles(double t) const;

 private:
  struct Tag {
    Label label = Label::background;
    std::uint16_t instance = 0;
    bool dynamic = false, box = false;
  };
  struct Person {
    double x0, y, speed, phase, height, range;
    int shirt, trousers, skin, hair;
    std::uint16_t instance;
    bool carries;
  };
  int add_texture(const cv::Mat& image, double width_m);
  void make_textures(Random& random);
  void make_room(Random& random);
  void make_desk(Random& random, double x, double y);
  void make_chair(double x, double y, double angle);
  static void quad(std::vector<Triangle>& out, const std::array<Eigen::Vector3d, 4>& p, int texture,
                   const Tag& tag);
  static void box(std::vector<Triangle>& out, const Eigen::Affine3d& T, const Eigen::Vector3d& size,
                  int texture, const Tag& tag, int front = -1);
  static void limb(std::vector<Triangle>& out, const Eigen::Vector3d& a, const Eigen::Vector3d& b, double ra,
                   double rb, int texture, const Tag& tag);
  void add_walker(std::vector<Triangle>& out, const Person& person, double t) const;
  void add_sitter(std::vector<Triangle>& out, double t) const;

  SynthOptions options_;
  std::vector<Texture> textures_;
  std::vector<Triangle> furniture_;
  std::vector<Person> walkers_;
  std::uint16_t instances_ = 0;
  double sitter_x_ = 0, sitter_y_ = 0;
  // texture groups
  int floor_ = 0, wall_ = 0, partition_ = 0, wood_ = 0, metal_ = 0, dark_ = 0, ceiling_ = 0, keyboard_ = 0,
      carton_ = 0, leaf_ = 0, cloth_ = 0, board_ = 0;
  std::vector<int> posters_, screens_, books_, shirts_, trousers_, skins_, hairs_, mugs_;
};

}  // namespace dynslam::runtime::synth
