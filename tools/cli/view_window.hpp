// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "dynslam/runtime/view/live_view.hpp"

namespace dynslam::app {

/// A window on the screen, in a process of its own: toolkits end the process where something is wrong with
/// the display, and a run must not end with it.
class ViewWindow : public runtime::ViewScreen {
 public:
  /// Forks, so it comes before any thread. @throws UsageError: no display, or a program without windows
  explicit ViewWindow(const std::string& title);
  ~ViewWindow() override;
  bool show(const cv::Mat& canvas) override;
  std::vector<runtime::ViewKey> keys() override;

 private:
  void end();

  pid_t child_ = -1;
  int socket_ = -1;
};

}  // namespace dynslam::app
