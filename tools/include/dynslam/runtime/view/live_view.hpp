// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <atomic>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "dynslam/runtime/run/run_sequence.hpp"

namespace dynslam::runtime {

/// What a user who looks at a view may ask for.
enum class ViewKey : std::uint8_t {
  pause,  ///< to hold the run, or to let it go on
  close   ///< to see no more of it
};

/// What LiveView shows its pictures on: a window, a video, a test. Called on LiveView's thread alone.
class ViewScreen {
 public:
  ViewScreen() = default;
  ViewScreen(const ViewScreen&) = delete;
  ViewScreen& operator=(const ViewScreen&) = delete;
  virtual ~ViewScreen() = default;
  /// Shows a picture, CV_8UC3, which is another one afterwards. It must not block for good.
  /// @return false: nothing can be shown any more
  virtual bool show(const cv::Mat& canvas) = 0;
  /// What was pressed since the last call.
  virtual std::vector<ViewKey> keys() = 0;
};

/// Shows a run while it goes on (ViewPainter), on a thread of its own:
///
///     LiveView view(screen, options, stop);
///     run_sequence(options, stop, {}, [&](const auto& sequence, const auto& camera) { view.open(sequence,
///     camera); },
///                  view.watch());
///
/// The tracker hands each frame over with one copy of its masks and goes on; of frames that come faster than
/// they are drawn the newest is shown. The results of the run are those of one that nobody looks at.
class LiveView {
 public:
  /// @param stop  ends a pause, as it ends the run
  LiveView(ViewScreen& screen, const RunOptions& options, const std::atomic<bool>& stop);
  ~LiveView();
  LiveView(const LiveView&) = delete;
  LiveView& operator=(const LiveView&) = delete;

  /// The sequence and its camera, before the first frame.
  void open(const Sequence& sequence, const CameraConfig& camera);
  /// What the run is to call. This object must live as long as the run.
  [[nodiscard]] RunWatch watch();
  /// Ends the drawing. @throws what went wrong there: it ends the view and not the run
  void finish();
  /// Nobody looks any more; the run goes on.
  [[nodiscard]] bool closed() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
