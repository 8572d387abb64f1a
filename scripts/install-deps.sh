#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Installs the packages that dynslam needs on Debian or Ubuntu; ONNX Runtime is the distribution's (Debian 13), or put
# into this repository where that has none. Does nothing when all is there. ONNXRUNTIME=off leaves ONNX Runtime out.
#
#   scripts/install-deps.sh          everything: program, tests, benchmarks, second compiler
#   scripts/install-deps.sh app      only what building and running the program needs
#   scripts/install-deps.sh python   what the program needs and the Python module beside it (docs/python.md)
#   scripts/install-deps.sh arm64    what scripts/test-arm64.sh needs: a cross compiler and an emulator
#   scripts/install-deps.sh core     only what the headers need: a compiler, CMake, Ninja and Eigen
set -euo pipefail

core=(build-essential cmake ninja-build libeigen3-dev)
app=("${core[@]}" ccache curl ca-certificates libopencv-dev liboctomap-dev libcli11-dev nlohmann-json3-dev libtomlplusplus-dev libfmt-dev
  libjpeg-dev libdeflate-dev libbz2-dev liblz4-dev libzstd-dev libsqlite3-dev file)  # file: cpack asks it which files are programs
development=(git clang doctest-dev libbenchmark-dev libceres-dev libspng-dev libopencv-contrib-dev
  pkg-config python3 unzip doxygen libjs-mathjax parallel)
python=(pybind11-dev python3-dev python3-numpy)
# For one test each (the first with 60 packages of ROS and Boost), and not in every release: taken where apt has them.
optional=(librosbag-storage-dev chromium xvfb)
# PNG is decompressed by ISA-L, which not every architecture has, or by libdeflate.
optional_app=(libisal-dev)
[ "${ONNXRUNTIME:-on}" = off ] || optional_app+=(libonnxruntime-dev)
# The page of reports is bundled by npm. A node from elsewhere has its own npm, beside which Debian's cannot be installed.
command -v node > /dev/null && command -v npm > /dev/null || app+=(nodejs npm)

fail() {
  echo "install-deps: $*" >&2
  exit 1
}

case "${1:-all}" in
  core) packages=("${core[@]}") optional_app=() ONNXRUNTIME=off ;;
  app) packages=("${app[@]}") ;;
  arm64) packages=("${core[@]}" doctest-dev g++-aarch64-linux-gnu qemu-user) optional_app=() ONNXRUNTIME=off ;;
  python) packages=("${app[@]}" "${python[@]}") ;;
  all) packages=("${app[@]}" "${development[@]}") ;;
  *) fail "unknown argument '$1' (known: core, app, python, arm64, all)" ;;
esac

command -v apt-get > /dev/null && command -v dpkg-query > /dev/null ||
  fail "no apt-get here; install by hand: ${packages[*]}"

installed() {
  [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2> /dev/null)" = installed ]
}

# The sanitizers' runtime carries the version of the distribution's clang in its name.
sanitizer_runtime() {
  local version
  version=$(dpkg-query -W -f '${Depends}' clang 2> /dev/null | grep -oE 'clang-[0-9]+' | head -n 1) ||
    version=$(apt-cache depends clang 2> /dev/null | grep -oE 'clang-[0-9]+' | head -n 1) || return 0
  local package="libclang-rt-${version#clang-}-dev"
  # Older distributions ship it inside another package that clang depends on.
  if installed "$package" || apt-cache show "$package" > /dev/null 2>&1; then
    echo "$package"
  fi
}

missing() {
  local package
  for package in "${packages[@]}"; do
    installed "$package" || echo "$package"
  done
}

with_what_apt_has() {
  local package wanted=("${optional_app[@]}")
  if [ "${1:-all}" = all ]; then
    local runtime
    runtime=$(sanitizer_runtime)
    [ -z "$runtime" ] || packages+=("$runtime")
    wanted+=("${optional[@]}")
  fi
  for package in "${wanted[@]}"; do
    if installed "$package" || apt-cache show "$package" > /dev/null 2>&1; then
      packages+=("$package")
    fi
  done
}

# Segmentation works without it, on OpenCV's dnn: slower, and with fewer models.
onnxruntime() {
  [ "${ONNXRUNTIME:-on}" != off ] || return 0
  "$(dirname "${BASH_SOURCE[0]}")/install-onnxruntime.sh" ||
    echo "install-deps: going on without ONNX Runtime; networks will run on OpenCV's dnn" >&2
}

if [ -z "$(missing)" ]; then
  with_what_apt_has "${1:-all}"
  if [ -z "$(missing)" ]; then
    echo "install-deps: all ${#packages[@]} packages are installed"
    onnxruntime
    exit 0
  fi
fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo > /dev/null ||
    fail "not root and no sudo; have these installed: $(missing | tr '\n' ' ')"
  as_root=(sudo)
fi
export DEBIAN_FRONTEND=noninteractive

"${as_root[@]}" apt-get -q update || fail "apt-get update failed (is the network up?)"
with_what_apt_has "${1:-all}"
read -r -d "" -a wanted <<< "$(missing)" || true
echo "install-deps: installing ${wanted[*]}"
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get -q install -y --no-install-recommends "${wanted[@]}" ||
  fail "apt-get could not install: ${wanted[*]}"
onnxruntime
echo "install-deps: done"
