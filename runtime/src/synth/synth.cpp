// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/synth/synth.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <thread>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "synth/synth_render.hpp"
#include "synth/synth_scene.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;

constexpr int kWidth = 640, kHeight = 480;
constexpr double kStart = 1000000.0;  // first time stamp [s]

/// Pose of a camera at `eye` that looks at `target`, with small extra rotations about its axes.
SE3<double> look_at(const Vector3d& eye, const Vector3d& target, const Vector3d& turn) {
  const Vector3d z = (target - eye).normalized();
  const Vector3d x = z.cross(Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return SE3<double>(SO3<double>(R) * SO3<double>::exp(turn), eye);
}

/// Hand shake: a few incommensurate sines per axis.
class Shake {
 public:
  explicit Shake(synth::Random& random) {
    for (auto& axis : phase_) {
      for (double& p : axis) p = random.uniform(0, 2 * std::numbers::pi);
    }
  }
  [[nodiscard]] double operator()(std::size_t axis, double t) const {
    return 0.5 * std::sin(4.1 * t + phase_[axis][0]) + 0.3 * std::sin(7.3 * t + phase_[axis][1]) +
           0.2 * std::sin(13.7 * t + phase_[axis][2]);
  }

 private:
  std::array<std::array<double, 3>, 6> phase_{};
};

SE3<double> camera_pose(const std::string& path, double t, const Shake& shake) {
  const Vector3d target(0.1, 2.6, 0.95);
  Vector3d eye(0, -0.55, 1.35);
  Vector3d turn = 0.006 * Vector3d(shake(0, t), shake(1, t), shake(2, t));
  const auto wave = [&](double frequency) { return std::sin(2 * std::numbers::pi * frequency * t); };
  if (path == "xyz") {
    eye += Vector3d(0.30 * wave(0.23), 0.22 * wave(0.17), 0.18 * wave(0.31));
    eye += 0.004 * Vector3d(shake(3, t), shake(4, t), shake(5, t));
    return look_at(eye, target + (eye - Vector3d(0, -0.55, 1.35)), turn);
  }
  if (path == "rpy") {
    turn += Vector3d(0.14 * wave(0.29), 0.22 * wave(0.19), 0.20 * wave(0.37));
  } else if (path == "halfsphere") {
    const double azimuth = 0.5 * wave(0.09), elevation = 0.24 + 0.16 * wave(0.13), radius = 3.1;
    eye = target + radius * Vector3d(std::sin(azimuth) * std::cos(elevation),
                                     -std::cos(azimuth) * std::cos(elevation), std::sin(elevation));
  }
  if (path == "loop") {  // outwards, on a circle
    const double a = 2 * std::numbers::pi * t / 18.0;
    const Vector3d out(std::sin(a), std::cos(a), 0), centre(0, -0.4, 1.35);
    eye = centre + 0.55 * out + Vector3d(0, 0, 0.12 * std::sin(2 * a)) +
          0.004 * Vector3d(shake(3, t), shake(4, t), shake(5, t));
    return look_at(eye, eye + out + Vector3d(0, 0, -0.12), turn);
  }
  const double shiver = path == "static" ? 0.002 : 0.004;
  eye += shiver * Vector3d(shake(3, t), shake(4, t), shake(5, t));
  return look_at(eye, target, turn);
}

void check(const SynthOptions& o) {
  const auto one_of = [](const std::string& value, std::initializer_list<const char*> allowed) {
    return std::find(allowed.begin(), allowed.end(), value) != allowed.end();
  };
  if (!one_of(o.path, {"static", "xyz", "rpy", "halfsphere", "loop"})) {
    throw UsageError(fmt::format("unknown camera path '{}': static, xyz, rpy, halfsphere or loop", o.path));
  }
  if (!one_of(o.scenario, {"walking", "sitting", "box", "board", "empty"})) {
    throw UsageError(fmt::format("unknown scenario '{}': walking, sitting, box, board or empty", o.scenario));
  }
  if (o.frames < 1 || o.frames > 100000) throw UsageError("--frames must be from 1 to 100000");
  if (o.walkers < 0 || o.walkers > 8) throw UsageError("--walkers must be from 0 to 8");
  if (o.blackout_from < 0 || o.blackout_frames < 0)
    throw UsageError("a blackout cannot begin or last less than 0 frames");
  if (!(o.fps >= 1 && o.fps <= 240)) throw UsageError("--fps must be from 1 to 240");
}

}  // namespace

void synthesize(const SynthOptions& options, const fs::path& out,
                const std::function<void(int, int)>& progress) {
  check(options);
  for (const char* folder : {"rgb", "depth", "label", "instance", "dynamic_mask", "box_mask"}) {
    std::error_code error;
    fs::create_directories(out / folder, error);
    if (error) throw InputError((out / folder).string(), 0, "cannot be made: " + error.message());
  }
  const synth::Scene scene(options);
  const Pinhole<double> camera(535.4, 539.2, 320.1, 247.6);  // TUM fr3
  synth::Random random(options.seed * 0x2545F491ULL + 3);
  const Shake shake(random);

  std::string rgb_list = "# timestamp filename\n", depth_list = rgb_list, associations;
  std::vector<StampedPose<double>> truth;
  std::vector<std::string> stamps;
  for (int i = 0; i < options.frames; ++i) {
    // Microseconds as integers: stamps are exact in the text and in the poses alike.
    const auto microseconds = static_cast<long long>(std::llround(1e6 * i / options.fps));
    const std::string stamp = fmt::format("{}.{:06}", static_cast<long long>(kStart) + microseconds / 1000000,
                                          microseconds % 1000000);
    stamps.push_back(stamp);
    rgb_list += fmt::format("{0} rgb/{0}.png\n", stamp);
    depth_list += fmt::format("{0} depth/{0}.png\n", stamp);
    associations += fmt::format("{0} rgb/{0}.png {0} depth/{0}.png\n", stamp);
    truth.push_back({kStart + static_cast<double>(microseconds) * 1e-6,
                     camera_pose(options.path, i / options.fps, shake)});
  }

  const auto make_frame = [&](int i) {
    const double t = i / options.fps;
    synth::Random frame_random(options.seed * 0x9E3779B1ULL + static_cast<std::uint64_t>(i) * 7919 + 11);
    const auto triangles = scene.triangles(t);
    synth::Rendering picture =
        synth::render(triangles, scene.textures(), camera, truth[static_cast<std::size_t>(i)].T_w_c.inverse(),
                      kWidth, kHeight);
    if (i >= options.blackout_from && i < options.blackout_from + options.blackout_frames) {
      for (cv::Mat* image :
           {&picture.bgr, &picture.depth, &picture.label, &picture.instance, &picture.dynamic, &picture.box})
        image->setTo(0);
    }
    const cv::Mat depth = [&] {
      if (options.noise) return synth::sense_depth(picture, camera.fx(), frame_random);
      cv::Mat raw;
      picture.depth.convertTo(raw, CV_16UC1, 5000.0);
      return raw;
    }();
    cv::Mat bgr = picture.bgr;
    if (options.motion_blur) {  // the shutter is open for half a frame, symmetric about the stamp
      cv::Mat sum;
      picture.bgr.convertTo(sum, CV_32FC3);
      for (const double shift : {-0.25, -0.125, 0.125, 0.25}) {
        const double ts = t + shift / options.fps;
        cv::Mat part;
        synth::render(scene.triangles(ts), scene.textures(), camera,
                      camera_pose(options.path, ts, shake).inverse(), kWidth, kHeight)
            .bgr.convertTo(part, CV_32FC3);
        sum += part;
      }
      sum.convertTo(bgr, CV_8UC3, 1.0 / 5.0);
    }
    if (options.exposure_change) bgr.convertTo(bgr, CV_8UC3, 1.0 + 0.25 * std::sin(1.7 * t));
    if (options.noise) {
      for (int v = 0; v < kHeight; ++v) {
        auto* row = bgr.ptr<cv::Vec3b>(v);
        for (int u = 0; u < kWidth; ++u) {
          const double n = 4.0 * (frame_random.uniform(-1, 1) + frame_random.uniform(-1, 1));
          for (int c = 0; c < 3; ++c) row[u][c] = cv::saturate_cast<std::uint8_t>(row[u][c] + n);
        }
      }
    }
    const std::string name = stamps[static_cast<std::size_t>(i)] + ".png";
    write_image(out / "rgb" / name, bgr);
    write_image(out / "depth" / name, depth);
    write_image(out / "label" / name, picture.label);
    write_image(out / "instance" / name, picture.instance);
    write_image(out / "dynamic_mask" / name, picture.dynamic);
    write_image(out / "box_mask" / name, picture.box);
  };

  // Frames are independent, so their bytes do not depend on who makes them.
  std::atomic<int> next{0};
  std::mutex mutex;
  int done = 0;
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      for (int i = next++; i < options.frames; i = next++) {
        make_frame(i);
        const std::lock_guard lock(mutex);
        ++done;
        if (progress) progress(done, options.frames);
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
      next = options.frames;
    }
  };
  {
    std::vector<std::jthread> threads;
    const unsigned n = std::clamp(std::thread::hardware_concurrency(), 1U, 16U);
    for (unsigned k = 0; k < n; ++k) threads.emplace_back(work);
  }
  if (failure) std::rethrow_exception(failure);

  write_file(out / "rgb.txt", rgb_list);
  write_file(out / "depth.txt", depth_list);
  write_file(out / "associations.txt", associations);
  write_trajectory(out / "groundtruth.txt", truth);
  write_file(out / "camera.txt",
             fmt::format("name = synthetic\nwidth = {}\nheight = {}\nfx = {}\nfy = {}\ncx = {}\ncy = "
                         "{}\ndepth_units_per_metre = 5000\n",
                         kWidth, kHeight, camera.fx(), camera.fy(), camera.cx(), camera.cy()));
  const nlohmann::json options_json{{"seed", options.seed},
                                    {"frames", options.frames},
                                    {"path", options.path},
                                    {"scenario", options.scenario},
                                    {"walkers", options.walkers},
                                    {"box", options.box},
                                    {"exposure_change", options.exposure_change},
                                    {"motion_blur", options.motion_blur},
                                    {"noise", options.noise},
                                    {"blackout_from", options.blackout_from},
                                    {"blackout_frames", options.blackout_frames},
                                    {"fps", options.fps}};
  write_file(out / "synth.json", options_json.dump(2) + "\n");
}

}  // namespace dynslam::runtime
