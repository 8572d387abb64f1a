// SPDX-License-Identifier: BSD-3-Clause
// The Python module dynslam._dynslam.
#include <pybind11/pybind11.h>

#include "bindings.hpp"
#include "dynslam/runtime/error.hpp"

PYBIND11_MODULE(_dynslam, m) {
  using namespace dynslam;
  m.doc() = "RGB-D SLAM for dynamic scenes.";
  m.attr("__version__") = DYNSLAM_VERSION;
  python::py::register_exception<runtime::InputError>(m, "InputError", PyExc_ValueError).attr("__doc__") =
      "A file or frame that cannot be used: the message is 'FILE:LINE: reason'.";
  python::py::register_exception<runtime::UsageError>(m, "UsageError", PyExc_ValueError).attr("__doc__") =
      "A request that makes no sense: wrong names, values or combinations of options.";
  python::bind_camera(m);
  python::bind_trajectory(m);
  python::bind_sequence(m);
  python::bind_segmenter(m);
  python::bind_static_weights(m);
  python::bind_map(m);
  python::bind_slam(m);
}
