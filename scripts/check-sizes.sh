#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Says which files of include/, runtime/, tools/, examples/ and bench/ are longer than 400 lines, without the includes that
# begin and end every header (push_macros.hpp, pop_macros.hpp), and which functions longer than 80; exits with 1 where
# there are any. It reads the layout that clang-format gives: a function begins with a line that is indented less than what
# follows and ends in "{", and ends with a "}" of the same indentation.
# Without a FOLDER it has scripts/check-classes.sh say, too, which classes of runtime/ are too large.
#
#   scripts/check-sizes.sh [FOLDER...]
#
# Environment: MAX_FILE, MAX_FUNCTION other limits; EXPECT_FAULTS so many faults are a success (for its own test).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
max_file=${MAX_FILE:-400} max_function=${MAX_FUNCTION:-80}
classes=true
if [ $# -eq 0 ]; then
  set -- include runtime tools examples bench
  scripts/check-classes.sh || classes=false
fi

faults=$(find "$@" -name '*.hpp' -o -name '*.cpp' | sort | xargs awk -v max_file="$max_file" -v max_function="$max_function" '
  function report(text) { print text }
  FNR == 1 {
    if (file != "" && lines > max_file) report(file ": " lines " lines, at most " max_file)
    file = FILENAME
    depth = 0
  }
  FNR == 1 { same = 0 }
  /^#include "dynslam\/(push|pop)_macros.hpp"$/ { same += 2 }
  { lines = FNR - same; sub(/[ ]+\/\/ .*$/, "") }
  # What is being declared: the lines since the last one that ended something.
  /^[ ]*(\/\/|#|$)/ { next }
  {
    indent = match($0, /[^ ]/) - 1
    if (declaration == "") { declaration_line = FNR; declaration_indent = indent }
    declaration = declaration $0
  }
  /^[ ]*\}/ {
    if (depth > 0 && indent == open_indent[depth]) {
      if (is_function[depth] && FNR - open_line[depth] + 1 > max_function)
        report(FILENAME ":" open_line[depth] ": a function of " (FNR - open_line[depth] + 1) " lines, at most " max_function)
      --depth
      if ($0 !~ /\{$/) { declaration = ""; next }
    }
  }
  /\{$/ {
    # Not in a function: a namespace, a type or a function opens here. In a function its end is all that counts.
    if (depth == 0 || !is_function[depth]) {
      ++depth
      open_indent[depth] = declaration_indent
      open_line[depth] = declaration_line
      is_function[depth] = declaration ~ /\)/ &&
        declaration !~ /^[ ]*(template <.*>[ ]*)?(inline )?(namespace|class|struct|enum|union|extern)[ {]/
    }
    declaration = ""
    next
  }
  /[;}]$/ || /^[ ]*(public|private|protected):/ { declaration = "" }
  END {
    if (lines > max_file) report(file ": " lines " lines, at most " max_file)
  }')
[ -z "$faults" ] || echo "$faults"
[ "$(grep -c . <<< "$faults")" -eq "${EXPECT_FAULTS:-0}" ] && $classes
