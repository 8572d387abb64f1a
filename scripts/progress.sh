# SPDX-License-Identifier: BSD-3-Clause
# Says how long a command has been running; to be sourced.
# shellcheck shell=bash

# with_progress TEXT LOG COMMAND...: runs COMMAND with its output in LOG. On a terminal one line is overwritten each second;
# elsewhere there is a line in the beginning and every 10 s. Where COMMAND fails its last lines are shown.
with_progress() {
  local text=$1 log=$2 began=$SECONDS said=$SECONDS status=0 last
  shift 2
  "$@" > "$log" 2>&1 &
  local process=$!
  # Background processes of a script do not get Ctrl-C.
  trap 'kill "$process" 2> /dev/null; exit 130' INT TERM
  [ -t 1 ] || echo "$text"
  while kill -0 "$process" 2> /dev/null; do
    sleep 0.2
    if [ $((SECONDS - began)) -lt 2 ]; then continue; fi
    last=$(tail -c 300 "$log" 2> /dev/null | tr '\r' '\n' | grep -oE '^\[ *[0-9]+/[0-9]+\]|[0-9]+/[0-9]+ [a-z]+' | tail -n 1) || last=
    if [ -t 1 ]; then
      printf '\r\033[K%s  %d s  %s' "$text" $((SECONDS - began)) "$last"
    elif [ $((SECONDS - said)) -ge 10 ]; then
      echo "$text: $((SECONDS - began)) s $last"
      said=$SECONDS
    fi
  done
  wait "$process" || status=$?
  trap - INT TERM
  [ ! -t 1 ] || printf '\r\033[K%s: %d s\n' "$text" $((SECONDS - began))
  if [ "$status" -ne 0 ]; then
    echo "FAILED ($status): $*" >&2
    tail -n 30 "$log" >&2
    return "$status"
  fi
}
