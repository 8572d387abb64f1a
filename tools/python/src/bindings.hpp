// SPDX-License-Identifier: BSD-3-Clause
// The parts of the module, each in a source of its own.
#pragma once

#include <pybind11/pybind11.h>

#include <mutex>
#include <utility>

namespace dynslam::python {

namespace py = pybind11;

void bind_camera(py::module_& m);
void bind_trajectory(py::module_& m);
void bind_sequence(py::module_& m);
void bind_segmenter(py::module_& m);
void bind_static_weights(py::module_& m);
void bind_map(py::module_& m);
void bind_slam(py::module_& m);

/// What one thread at a time may use. Others wait, without Python's lock, so that nothing stands still but
/// them.
template <class T>
class Shared {
 public:
  template <class... A>
  explicit Shared(A&&... arguments) : value_(std::forward<A>(arguments)...) {}

  /// Calls work(value) without Python's lock: nothing of Python may be touched there.
  template <class F>
  auto use(F&& work) {
    const py::gil_scoped_release released;
    const std::scoped_lock lock(mutex_);
    return work(value_);
  }

 private:
  std::mutex mutex_;
  T value_;
};

}  // namespace dynslam::python
