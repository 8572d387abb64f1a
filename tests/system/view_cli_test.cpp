// SPDX-License-Identifier: BSD-3-Clause
// `dynslam run --view` where there is no window to be had.
#include <doctest/doctest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "program.hpp"
#include "tum_fixture.hpp"

using namespace dynslam;

TEST_CASE("without a display --view is an error of one line, before anything is done") {
  const test::TemporaryFolder folder;
  const std::string out = (folder.path / "out").string();
  const std::string arguments = " run nowhere --dynamics geometric --view --out " + out + " 2>&1";
  const auto fails = [&](const std::string& variables, const std::string& part) {
    const auto r =
        test::shell("env -u DISPLAY -u WAYLAND_DISPLAY " + variables + " " DYNSLAM_PROGRAM + arguments);
    CAPTURE(r.out);
    CHECK(r.code == 2);
    CHECK(r.out.starts_with("dynslam: error: --view"));
    CHECK(std::count(r.out.begin(), r.out.end(), '\n') == 1);
    CHECK(r.out.find(part) != std::string::npos);
    CHECK_FALSE(std::filesystem::exists(out));
  };
#ifdef DYNSLAM_HAVE_WINDOW
  fails("", "neither DISPLAY nor WAYLAND_DISPLAY is set");
  fails("DISPLAY=", "neither DISPLAY nor WAYLAND_DISPLAY is set");
  fails("DISPLAY=:6789", "no window can be opened on the display ':6789'");
#else
  fails("DISPLAY=:6789", "built without windows");
#endif
}
