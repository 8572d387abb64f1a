# SPDX-License-Identifier: BSD-3-Clause
#
# Finds the headers of toml++, by which configurations are read. Its own package would link a library.
find_path(Tomlplusplus_INCLUDE_DIR toml++/toml.h)
mark_as_advanced(Tomlplusplus_INCLUDE_DIR)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Tomlplusplus REQUIRED_VARS Tomlplusplus_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "Debian: libtomlplusplus-dev")
