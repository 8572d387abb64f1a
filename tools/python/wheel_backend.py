# SPDX-License-Identifier: BSD-3-Clause
"""Builds the wheel of the Python module for pip (PEP 517), with CMake and the standard library alone."""
import base64
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

SOURCE = pathlib.Path(__file__).resolve().parents[2]
BUILD = SOURCE / "build" / "wheel"  # kept: a second call compiles what has changed


def version():
    return re.search(r"VERSION (\d+\.\d+\.\d+)", (SOURCE / "CMakeLists.txt").read_text(encoding="utf-8")).group(1)


def installed(stage):
    """The package's folder below `stage`, built and installed there."""
    options = ["-D", "CMAKE_BUILD_TYPE=Release", "-D", "DYNSLAM_BUILD_PYTHON=ON", "-D", "CMAKE_UNITY_BUILD=ON",
               "-D", f"Python_EXECUTABLE={sys.executable}", "-D", "CMAKE_INSTALL_LIBDIR=lib"]
    for part in ("TESTS", "BENCHMARKS", "EXAMPLES"):
        options += ["-D", f"DYNSLAM_BUILD_{part}=OFF"]
    if shutil.which("ninja"):
        options += ["-G", "Ninja"]
    jobs = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL", str(os.cpu_count() or 1))
    subprocess.run(["cmake", "-S", SOURCE, "-B", BUILD, *options], check=True)
    subprocess.run(["cmake", "--build", BUILD, "--target", "dynslam_python", "-j", jobs], check=True)
    for component in ("dynslam_python", "dynslam_onnxruntime"):
        subprocess.run(["cmake", "--install", BUILD, "--component", component, "--prefix", stage, "--strip"], check=True)
    package = next(stage.glob("lib/python*/*/dynslam"))
    for library in (stage / "lib" / "dynslam").glob("*"):
        shutil.copy(library, package)
    return package


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{re.sub('[-.]', '_', sysconfig.get_platform())}"
    name, info = f"dynslam-{version()}-{tag}.whl", f"dynslam-{version()}.dist-info"
    with tempfile.TemporaryDirectory() as stage:
        package = installed(pathlib.Path(stage))
        files = {str(file.relative_to(package.parent)): file.read_bytes() for file in sorted(package.rglob("*")) if file.is_file()}
    files[f"{info}/METADATA"] = (f"Metadata-Version: 2.1\nName: dynslam\nVersion: {version()}\nLicense: BSD-3-Clause\n"
                                 "Summary: RGB-D SLAM for dynamic scenes\nRequires-Python: >=3.9\nRequires-Dist: numpy\n").encode()
    files[f"{info}/WHEEL"] = f"Wheel-Version: 1.0\nGenerator: dynslam\nRoot-Is-Purelib: false\nTag: {tag}\n".encode()
    files[f"{info}/LICENSE"] = (SOURCE / "LICENSE").read_bytes()
    record = ""
    for path, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record += f"{path},sha256={digest},{len(content)}\n"
    files[f"{info}/RECORD"] = (record + f"{info}/RECORD,,\n").encode()
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, content in files.items():
            entry = zipfile.ZipInfo(path)
            entry.external_attr = (0o755 if ".so" in path else 0o644) << 16
            wheel.writestr(entry, content, zipfile.ZIP_DEFLATED)
    return name
