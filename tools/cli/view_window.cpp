// SPDX-License-Identifier: BSD-3-Clause
#include "view_window.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <thread>

#include "dynslam/runtime/error.hpp"
#ifdef DYNSLAM_HAVE_WINDOW
#include <opencv2/highgui.hpp>
#endif

namespace dynslam::app {
namespace {

using runtime::UsageError;

/// What the two processes say to each other: pictures one way, as width, height and pixels; letters the
/// other.
using PictureHead = std::array<std::int32_t, 2>;
[[maybe_unused]] constexpr char kReady = 'r', kPause = 'p', kClose = 'c';
constexpr int kPatience = 3000;  // milliseconds that the other side may do nothing

bool has_variable(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr && *value != '\0';
}

bool waits_for(int socket, short what, int milliseconds) {
  pollfd one{socket, what, 0};
  int ready = 0;
  do {
    ready = ::poll(&one, 1, milliseconds);
  } while (ready < 0 && errno == EINTR);
  return ready > 0;
}

/// @return false: the other side is gone, or does nothing
bool send_bytes(int socket, const void* data, std::size_t size) {
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    if (!waits_for(socket, POLLOUT, kPatience)) return false;
    const ssize_t sent = ::send(socket, at, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (sent <= 0) return false;
    at += sent;
    size -= static_cast<std::size_t>(sent);
  }
  return true;
}

#ifdef DYNSLAM_HAVE_WINDOW
bool receive_bytes(int socket, void* data, std::size_t size) {
  char* at = static_cast<char*>(data);
  while (size > 0) {
    const ssize_t got = ::recv(socket, at, size, 0);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

bool say(int socket, char letter) {
  return send_bytes(socket, &letter, 1);
}

/// What the window's process does, until the other one goes or the window is closed.
void show_pictures(int socket, const std::string& title) {
  constexpr int kEscape = 27, kSpace = ' ', kTick = 15;  // milliseconds
  cv::namedWindow(title, cv::WINDOW_AUTOSIZE | cv::WINDOW_GUI_NORMAL);
  if (!say(socket, kReady)) return;
  cv::Mat picture;
  PictureHead head{};
  while (true) {
    const int key = cv::waitKey(kTick) & 0xff;
    const bool visible = picture.empty() || cv::getWindowProperty(title, cv::WND_PROP_VISIBLE) > 0;
    if (key == kEscape || !visible) {
      (void)say(socket, kClose);
      return;
    }
    if (key == kSpace && !say(socket, kPause)) return;
    if (!waits_for(socket, POLLIN, 0)) continue;
    if (!receive_bytes(socket, head.data(), sizeof(head))) return;
    picture.create(head[1], head[0], CV_8UC3);
    if (!receive_bytes(socket, picture.data, picture.total() * picture.elemSize())) return;
    cv::imshow(title, picture);
  }
}

/// The window's process: silent, since toolkits say much, and untouched by the terminal's Ctrl-C, which is
/// for the run: it ends when the other one does.
[[noreturn]] void be_window(int socket, const std::string& title) {
  for (const int signal : {SIGINT, SIGHUP, SIGPIPE}) std::signal(signal, SIG_IGN);
  std::signal(SIGTERM, SIG_DFL);
  const int nowhere = ::open("/dev/null", O_RDWR);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
  (void)!::nice(5);  // the tracker goes first
  try {
    show_pictures(socket, title);
  } catch (...) {  // it could not be opened, or shown
  }
  ::_exit(0);
}
#endif

/// @throws UsageError  where no window can be
void check_display() {
#ifndef DYNSLAM_HAVE_WINDOW
  throw UsageError(
      "--view: this program was built without windows: OpenCV's highgui was missing (Debian: libopencv-dev)");
#endif
  if (!has_variable("DISPLAY") && !has_variable("WAYLAND_DISPLAY"))
    throw UsageError("--view needs a display, and neither DISPLAY nor WAYLAND_DISPLAY is set");
}

}  // namespace

ViewWindow::ViewWindow([[maybe_unused]] const std::string& title) {
  check_display();
#ifdef DYNSLAM_HAVE_WINDOW
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw UsageError("--view: no window can be opened, the system has no sockets left");
  child_ = ::fork();
  if (child_ == 0) {
    ::close(ends[0]);
    be_window(ends[1], title);
  }
  ::close(ends[1]);
  socket_ = ends[0];
  constexpr int kOpening = 20000;  // milliseconds; a display may be far away
  char letter = 0;
  if (child_ > 0 && waits_for(socket_, POLLIN, kOpening) && ::recv(socket_, &letter, 1, 0) == 1 &&
      letter == kReady)
    return;
  const bool x11 = has_variable("DISPLAY");
  const std::string name = std::getenv(x11 ? "DISPLAY" : "WAYLAND_DISPLAY");
  end();
  throw UsageError(fmt::format("--view: no window can be opened on the display '{}' ({})", name,
                               x11 ? "DISPLAY" : "WAYLAND_DISPLAY"));
#endif
}

ViewWindow::~ViewWindow() {
  end();
}

void ViewWindow::end() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  if (child_ <= 0) return;
  // The window's process ends by itself; one that hangs with its display does not.
  using namespace std::chrono_literals;
  for (int i = 0; i < 100; ++i) {
    if (::waitpid(child_, nullptr, WNOHANG) != 0) {
      child_ = -1;
      return;
    }
    std::this_thread::sleep_for(20ms);
  }
  ::kill(child_, SIGKILL);
  ::waitpid(child_, nullptr, 0);
  child_ = -1;
}

bool ViewWindow::show(const cv::Mat& canvas) {
  const PictureHead head{canvas.cols, canvas.rows};
  if (!send_bytes(socket_, head.data(), sizeof(head))) return false;
  const std::size_t row = static_cast<std::size_t>(canvas.cols) * canvas.elemSize();
  if (canvas.isContinuous())
    return send_bytes(socket_, canvas.data, row * static_cast<std::size_t>(canvas.rows));
  for (int v = 0; v < canvas.rows; ++v) {
    if (!send_bytes(socket_, canvas.ptr(v), row)) return false;
  }
  return true;
}

std::vector<runtime::ViewKey> ViewWindow::keys() {
  std::vector<runtime::ViewKey> pressed;
  while (waits_for(socket_, POLLIN, 0)) {
    char letter = 0;
    if (::recv(socket_, &letter, 1, 0) != 1) letter = kClose;  // the display is gone
    pressed.push_back(letter == kPause ? runtime::ViewKey::pause : runtime::ViewKey::close);
    if (letter == kClose) break;
  }
  return pressed;
}

}  // namespace dynslam::app
