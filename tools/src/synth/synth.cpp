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
#include <opencv2/core.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/atomic_file.hpp"
#include "dynslam/runtime/io/convert.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"
#include "io/make_folder.hpp"
#include "synth/camera_path.hpp"
#include "synth/random.hpp"
#include "synth/synth_render.hpp"
#include "synth/synth_scene.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

constexpr double kStart = 1000000.0;    // first time stamp [s]
constexpr double kDepthUnits = 5000.0;  // per metre

/// Pixels of the images per pixel of TUM's.
double scale_of(const SynthOptions& o) {
  return o.width / 640.0;
}

/// TUM's fr3 in images of another size. Centres of pixels are whole numbers, so the image begins at -0.5.
Pinhole<double> camera_of(const SynthOptions& o) {
  if (o.width == 640 && o.height == 480) return {535.4, 539.2, 320.1, 247.6};
  const double s = scale_of(o);
  return {535.4 * s, 539.2 * s, (320.1 + 0.5) * s - 0.5, (247.6 - 239.5) * s + 0.5 * (o.height - 1)};
}

void check(const SynthOptions& o) {
  const auto one_of = [](const std::string& value, std::initializer_list<const char*> allowed) {
    return std::find(allowed.begin(), allowed.end(), value) != allowed.end();
  };
  if (!one_of(o.path, {"static", "xyz", "rpy", "halfsphere", "loop"})) {
    throw UsageError(fmt::format("unknown camera path '{}': static, xyz, rpy, halfsphere or loop", o.path));
  }
  if (!one_of(o.scenario, {"walking", "sitting", "box", "board", "crowd", "empty"})) {
    throw UsageError(
        fmt::format("unknown scenario '{}': walking, sitting, box, board, crowd or empty", o.scenario));
  }
  if (o.frames < 1 || o.frames > 100000) throw UsageError("--frames must be from 1 to 100000");
  if (o.walkers < 0 || o.walkers > 8) throw UsageError("--walkers must be from 0 to 8");
  if (o.blackout_from < 0 || o.blackout_frames < 0)
    throw UsageError("a blackout cannot begin or last less than 0 frames");
  if (!(o.fps >= 1 && o.fps <= 240)) throw UsageError("--fps must be from 1 to 240");
  if (!(std::abs(o.readout_time) * o.fps <= 1))
    throw UsageError("--readout-time must not be longer than the time between two frames");
  if (o.width < 64 || o.width > 4096 || o.height < 64 || o.height > 4096)
    throw UsageError(fmt::format("--size {}x{}: must be from 64x64 to 4096x4096", o.width, o.height));
}

/// The lists of a sequence, and where the camera is.
struct Plan {
  std::string rgb = "# timestamp filename\n", depth = rgb, associations;
  std::vector<std::string> stamps;
  std::vector<StampedPose<double>> truth;
};

Plan plan(const SynthOptions& options, const synth::Shake& shake) {
  Plan p;
  const synth::View view = synth::view_of(options.scenario);
  for (int i = 0; i < options.frames; ++i) {
    // Microseconds as integers: stamps are exact in the text and in the poses alike.
    const auto microseconds = static_cast<long long>(std::llround(1e6 * i / options.fps));
    const std::string stamp = fmt::format("{}.{:06}", static_cast<long long>(kStart) + microseconds / 1000000,
                                          microseconds % 1000000);
    p.stamps.push_back(stamp);
    p.rgb += fmt::format("{0} rgb/{0}.png\n", stamp);
    p.depth += fmt::format("{0} depth/{0}.png\n", stamp);
    p.associations += fmt::format("{0} rgb/{0}.png {0} depth/{0}.png\n", stamp);
    p.truth.push_back({kStart + static_cast<double>(microseconds) * 1e-6,
                       synth::camera_pose(options.path, view, i / options.fps, shake)});
  }
  return p;
}

/// Takes the pictures: each depends on its number alone, whoever takes it.
class Photographer {
 public:
  Photographer(const SynthOptions& options, const Plan& plan, const synth::Shake& shake, fs::path out)
      : options_(options),
        plan_(plan),
        shake_(shake),
        out_(std::move(out)),
        camera_(camera_of(options)),
        view_(synth::view_of(options.scenario)),
        scene_(options) {}

  void take(int i) const {
    const double t = i / options_.fps;
    synth::Random random(options_.seed * 0x9E3779B1ULL + static_cast<std::uint64_t>(i) * 7919 + 11);
    synth::Rendering picture = render(t);
    if (i >= options_.blackout_from && i < options_.blackout_from + options_.blackout_frames) {
      for (cv::Mat* image :
           {&picture.bgr, &picture.depth, &picture.label, &picture.instance, &picture.dynamic, &picture.box})
        image->setTo(0);
    }
    const cv::Mat depth = [&] {
      if (options_.noise) return synth::sense_depth(picture, camera_.fx(), scale_of(options_), random);
      cv::Mat raw;
      picture.depth.convertTo(raw, CV_16UC1, kDepthUnits);
      return raw;
    }();
    const cv::Mat bgr = expose(picture.bgr, t, random);
    const std::string name = plan_.stamps[static_cast<std::size_t>(i)] + ".png";
    write_image(out_ / "rgb" / name, bgr);
    write_image(out_ / "depth" / name, depth);
    write_image(out_ / "label" / name, picture.label);
    write_image(out_ / "instance" / name, picture.instance);
    write_image(out_ / "dynamic_mask" / name, picture.dynamic);
    write_image(out_ / "box_mask" / name, picture.box);
  }

 private:
  [[nodiscard]] synth::Rendering render(double t) const {
    if (options_.readout_time == 0) return render(t, camera_, options_.height);
    synth::Rendering picture;
    for (int v = 0; v < options_.height; ++v) {
      const double after_middle = (v / (options_.height - 1.0) - 0.5) * options_.readout_time;
      const Pinhole<double> row(camera_.fx(), camera_.fy(), camera_.cx(), camera_.cy() - v);
      picture.append(render(t + after_middle, row, 1));
    }
    return picture;
  }

  /// All rows at once.
  [[nodiscard]] synth::Rendering render(double t, const Pinhole<double>& camera, int height) const {
    return synth::render(scene_.triangles(t), scene_.textures(), camera,
                         synth::camera_pose(options_.path, view_, t, shake_).inverse(), options_.width,
                         height);
  }

  /// Motion blur, exposure and noise of the colour image.
  [[nodiscard]] cv::Mat expose(const cv::Mat& exact, double t, synth::Random& random) const {
    cv::Mat bgr = exact;
    if (options_.motion_blur) {  // the shutter is open for half a frame, symmetric about the stamp
      cv::Mat sum;
      exact.convertTo(sum, CV_32FC3);
      for (const double shift : {-0.25, -0.125, 0.125, 0.25}) {
        const double ts = t + shift / options_.fps;
        cv::Mat part;
        render(ts).bgr.convertTo(part, CV_32FC3);
        sum += part;
      }
      sum.convertTo(bgr, CV_8UC3, 1.0 / 5.0);
    }
    if (options_.exposure_change) bgr.convertTo(bgr, CV_8UC3, 1.0 + 0.25 * std::sin(1.7 * t));
    if (options_.noise) add_noise(bgr, random);
    return bgr;
  }

  static void add_noise(cv::Mat& bgr, synth::Random& random) {
    for (int v = 0; v < bgr.rows; ++v) {
      auto* row = bgr.ptr<cv::Vec3b>(v);
      for (int u = 0; u < bgr.cols; ++u) {
        const double n = 4.0 * (random.uniform(-1, 1) + random.uniform(-1, 1));
        for (int c = 0; c < 3; ++c) row[u][c] = cv::saturate_cast<std::uint8_t>(row[u][c] + n);
      }
    }
  }

  const SynthOptions& options_;
  const Plan& plan_;
  const synth::Shake& shake_;
  fs::path out_;
  Pinhole<double> camera_;
  synth::View view_;
  synth::Scene scene_;
};

/// Calls make(0) to make(n - 1) on all cores; reports after each. @throws what one of them threw
void in_parallel(int n, const std::function<void(int)>& make, const std::function<void(int, int)>& progress) {
  std::atomic<int> next{0};
  std::mutex mutex;
  int done = 0;
  std::exception_ptr failure;
  const auto work = [&] {
    try {
      for (int i = next++; i < n; i = next++) {
        make(i);
        const std::lock_guard lock(mutex);
        ++done;
        if (progress) progress(done, n);
      }
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
      next = n;
    }
  };
  {
    std::vector<std::jthread> threads;
    const unsigned cores = std::clamp(std::thread::hardware_concurrency(), 1U, 16U);
    for (unsigned k = 0; k < cores; ++k) threads.emplace_back(work);
  }
  if (failure) std::rethrow_exception(failure);
}

nlohmann::json to_json(const SynthOptions& options) {
  return {{"seed", options.seed},
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
          {"fps", options.fps},
          {"readout_time", options.readout_time},
          {"width", options.width},
          {"height", options.height}};
}

constexpr std::array kImageFolders{"rgb", "depth", "label", "instance", "dynamic_mask", "box_mask"};

/// Refuses a folder with a sequence that this program did not make: its ground truth and images would be
/// lost.
void check_folder(const fs::path& out) {
  if (fs::exists(out / "synth.json")) return;
  for (const char* folder : kImageFolders) {
    if (count_pngs(out / folder) > 0)
      throw InputError((out / folder).string(), 0,
                       "holds images that `dynslam synth` did not make (no synth.json beside it); they would "
                       "be lost");
  }
  for (const char* list : kSequenceFiles) {
    if (fs::exists(out / list))
      throw InputError(
          (out / list).string(), 0,
          "is of a sequence that `dynslam synth` did not make (no synth.json beside it); it would be "
          "overwritten");
  }
}

}  // namespace

void synthesize(const SynthOptions& options, const fs::path& out,
                const std::function<void(int, int)>& progress) {
  check(options);
  make_folder(out);
  const FileHandle lock = lock_folder(out);
  check_folder(out);
  begin_sequence(out, kImageFolders);
  write_file(out / "synth.json",
             to_json(options).dump(2) + "\n");  // of the images that follow, should it end
  synth::Random random(options.seed * 0x2545F491ULL + 3);
  const synth::Shake shake(random);
  const Plan lists = plan(options, shake);
  const Photographer photographer(options, lists, shake, out);
  in_parallel(
      options.frames, [&](int i) { photographer.take(i); }, progress);

  write_file(out / "rgb.txt", lists.rgb);
  write_file(out / "depth.txt", lists.depth);
  write_file(out / "associations.txt", lists.associations);
  write_trajectory(out / "groundtruth.txt", lists.truth);
  CameraConfig camera;
  camera.name = "synthetic";
  camera.width = options.width;
  camera.height = options.height;
  camera.model = camera_of(options);
  camera.depth_units_per_metre = kDepthUnits;
  camera.readout_time = options.readout_time;
  write_file(out / "camera.txt", camera_text(camera));
  fs::remove(out / kUnfinished);
}

}  // namespace dynslam::runtime
