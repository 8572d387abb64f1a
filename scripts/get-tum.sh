#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# Fetches sequences of the TUM RGB-D and Bonn RGB-D Dynamic data sets. The data keep their own licences.
#
#   [OUT=DIR] scripts/get-tum.sh NAME...   unpacks each into OUT (this repository's data/)
#   scripts/get-tum.sh --list              the names that it knows
#
# NAME is the official one or a short one: rgbd_dataset_freiburg3_walking_xyz, freiburg3_walking_xyz, fr3_walking_xyz;
# rgbd_bonn_balloon, bonn_balloon. What broke off goes on where it stopped, within one call and over several: until it
# is whole, an archive is OUT/ARCHIVE.part. It is tested before it is unpacked, a folder appears when it is complete,
# and one that is there is left alone.
#
# Environment: ARCHIVE_SHA256 the whole sum that the archive must have (with one NAME). Without it the sum that OUT
# holds from an earlier download (ARCHIVE.sha256) is taken; without that, too, the first download is believed as far as
# HTTPS goes, and its sum is kept for the next one. BASE_URL another server or mirror: a TUM archive is asked for as
# BASE_URL/freiburgN/NAME.tgz, one of Bonn as BASE_URL/NAME.zip. TRIES (5) and PAUSE (3 s) for transfers that break off.
set -euo pipefail
out=${OUT:-$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)/data} tries=${TRIES:-5} pause=${PAUSE:-3}

fail() {
  echo "get-tum: $*" >&2
  exit 1
}

tum=(freiburg1_{360,desk,desk2,floor,plant,room,rpy,teddy,xyz}
  freiburg2_{360_hemisphere,360_kidnap,coke,desk,desk_with_person,dishes,flowerbouquet,flowerbouquet_brownbackground}
  freiburg2_{large_no_loop,large_with_loop,metallic_sphere,metallic_sphere2,pioneer_360,pioneer_slam,pioneer_slam2}
  freiburg2_{pioneer_slam3,rpy,xyz}
  freiburg3_{cabinet,large_cabinet,long_office_household,nostructure_notexture_far}
  freiburg3_{nostructure_notexture_near_withloop,nostructure_texture_far,nostructure_texture_near_withloop}
  freiburg3_{structure_notexture,structure_texture}_{far,near} freiburg3_teddy
  freiburg3_{sitting,walking}_{halfsphere,rpy,static,xyz})
bonn=(balloon{,2} balloon_tracking{,2} crowd{,2,3} kidnapping_box{,2} moving_nonobstructing_box{,2}
  moving_obstructing_box{,2} person_tracking{,2} placing_nonobstructing_box{,2,3} placing_obstructing_box
  removing_nonobstructing_box{,2} removing_obstructing_box static static_close_far synchronous{,2})
known=("${tum[@]/#/rgbd_dataset_}" "${bonn[@]/#/rgbd_bonn_}")

# official NAME: the name of the sequence's folder.
official() {
  local name=$1 candidate
  case $name in
    fr[123]_*) name=rgbd_dataset_freiburg${name#fr} ;;
    freiburg*) name=rgbd_dataset_$name ;;
    bonn_*) name=rgbd_$name ;;
  esac
  for candidate in "${known[@]}"; do
    [ "$candidate" != "$name" ] || { echo "$name"; return; }
  done
  fail "unknown sequence '$1'; scripts/get-tum.sh --list prints those of TUM and Bonn"
}

size_of() { stat -c %s "$1" 2> /dev/null || echo 0; }

fetching=(curl -L --connect-timeout 20 --speed-limit 1000 --speed-time 60)
[ -n "${BASE_URL:-}" ] || fetching+=(--proto '=https')

# Sets `size` to the archive's bytes, or to nothing where the server does not tell.
ask_size() {
  local headers status
  headers=$("${fetching[@]}" -sI "$1" | tr -d '\r') || true
  status=$(awk '/^HTTP\// {s = $2} END {print s}' <<< "$headers")
  [[ $status != 4* ]] || fail "$1 is not there (HTTP status $status)"
  size=$(awk '/^HTTP\// {n = ""} tolower($1) == "content-length:" {n = $2} END {print n}' <<< "$headers")
  [[ $status == 2* && $size =~ ^[0-9]+$ ]] || size=
}

# The archive and what comes out of it (images that are compressed already) must fit beside each other.
check_space() {
  [ -n "$size" ] || return 0
  local needed free
  needed=$((size * 22 / 10 - $(size_of "$part")))
  free=$(df --output=avail -B1 "$out" | tail -n 1)
  [ "$free" -ge "$needed" ] ||
    fail "no space for $name: it takes $((needed / 1000000 + 1)) MB, and $out has $((free / 1000000)) MB left"
}

# transfer: goes on with `part` until it is whole.
transfer() {
  local try code reason=''
  for ((try = 1; try <= tries; ++try)); do
    [ "$try" -eq 1 ] || sleep "$pause"
    if [ -n "$size" ]; then
      [ "$(size_of "$part")" -le "$size" ] || : > "$part"  # of another file
      [ "$(size_of "$part")" -ne "$size" ] || return 0
    fi
    code=0
    "${fetching[@]}" -fsS -C - -o "$part" "$url" 2> "$work/log" || code=$?
    [ "$code" -ne 0 ] || [ "$(size_of "$part")" -ne "${size:-$(size_of "$part")}" ] || return 0
    reason=$(grep '^curl: ' "$work/log" | tail -n 1) || reason="curl ended with $code"
    case $code in
      22 | 33) : > "$part" ;;  # cannot be gone on with: the server has another file by now, or no ranges
      23) fail "could not write $part (is the disk full?)" ;;
    esac
  done
  [ -s "$part" ] || fail "could not fetch $url ($reason); is the network up?"
  fail "$url broke off at $(size_of "$part") of ${size:-?} bytes, $tries times ($reason);" \
    "the same command goes on from there"
}

# No byte of the archive is damaged.
whole() {
  case $archive in
    *.tgz) gzip -t "$part" ;;
    *.zip) unzip -tqq "$part" ;;
  esac > /dev/null 2>&1
}

# Sets `sum` to the SHA-256 that the archive must have, if that is known, and `said_by` to who says so.
ask_sum() {
  sum='' said_by=''
  if [ -n "${ARCHIVE_SHA256:-}" ]; then
    sum=$ARCHIVE_SHA256 said_by=ARCHIVE_SHA256
  elif [ -e "$out/$archive.sha256" ]; then
    sum=$(cut -d' ' -f1 "$out/$archive.sha256") said_by=$out/$archive.sha256
  fi
  [[ -z $said_by || $sum =~ ^[0-9a-f]{64}$ ]] || fail "$said_by: '$sum' is no SHA-256 of 64 digits 0-9 a-f"
}

# refuse REASON: the archive is not what it should be, however often it is fetched.
refuse() {
  rm -f "$part"
  fail "$archive $*; it was removed"
}

# Unpacks beside the place and renames: the folder is there when all of it is. It holds plain files and folders alone,
# with the modes of this user's own: an archive may name devices, links out of the folder and setuid programs.
unpack() {
  local other=
  mkdir "$work/unpacked"
  [[ $archive != *.tgz ]] || other=$(tar -tvzf "$part" 2> /dev/null | grep -m 1 -v '^[-d]') || true
  [ -z "$other" ] || refuse "holds what is no plain file: $(printf %q "$other")"
  case $archive in
    *.tgz) tar -xzf "$part" --no-same-owner --no-same-permissions -C "$work/unpacked" ;;
    *.zip) unzip -qq "$part" -d "$work/unpacked" ;;
  esac 2> "$work/log" || fail "could not unpack $archive into $out ($(tail -n 1 "$work/log"))"
  other=$(find "$work/unpacked" ! -type f ! -type d -print -quit)
  [ -z "$other" ] || refuse "holds what is no plain file: $(printf %q "${other#"$work/unpacked/"}")"
  chmod -R a-st,u+rwX "$work/unpacked"
  [ -f "$work/unpacked/$name/rgb.txt" ] || refuse "has no $name/rgb.txt"
  mv -T "$work/unpacked/$name" "$out/$name"
}

get() {
  local found resumed
  name=$1
  case $name in
    rgbd_bonn_*)
      archive=$name.zip url=${BASE_URL:-https://www.ipb.uni-bonn.de/html/projects/rgbd_dynamic2019}/$name.zip
      command -v unzip > /dev/null || fail "needs unzip for Bonn's archives: apt-get install unzip" ;;
    *)
      archive=$name.tgz url=${name#rgbd_dataset_}
      url=${BASE_URL:-https://cvg.cit.tum.de/rgbd/dataset}/${url%%_*}/$name.tgz ;;
  esac
  [ ! -e "$out/$name" ] || { echo "get-tum: $out/$name is there"; return; }
  mkdir -p "$out"
  ask_sum
  part=$out/$archive.part
  exec 9>> "$part"
  flock -n 9 || fail "$part is being fetched by another process"
  # On the same disk, so that the last step is a rename.
  work=$(mktemp -d "$out/.get-tum.XXXXXX")
  trap 'rm -rf "$work"; [ -s "$part" ] || rm -f "$part"' EXIT
  ask_size "$url"
  check_space
  echo "get-tum: fetching $url${size:+, $((size / 1000000 + 1)) MB}" >&2
  resumed=$(size_of "$part")
  transfer
  if [ "$resumed" -gt 0 ] && ! whole; then
    echo "get-tum: what an earlier call left of $archive is not what the server has now; fetching all of it" >&2
    : > "$part"
    transfer
  fi
  whole || { rm "$part"; fail "$archive is damaged as it comes from $url; it was removed"; }
  found=$(sha256sum < "$part")
  found=${found%% *}
  [ "$found" = "${sum:-$found}" ] || { rm "$part"; fail "$archive has the SHA-256 $found, not $sum ($said_by)"; }
  [ -n "$sum" ] ||
    echo "get-tum: its SHA-256 $found is kept in $out/$archive.sha256 and compared from now on" >&2
  unpack
  echo "$found  $archive" > "$out/$archive.sha256"
  rm -rf "$part" "$work"
  exec 9>&-
  trap - EXIT
  echo "get-tum: $out/$name"
}

[ $# -gt 0 ] || fail "usage: scripts/get-tum.sh NAME... (or --list)"
[ "$1" != --list ] || { printf '%s\n' "${known[@]}"; exit; }
[ -z "${ARCHIVE_SHA256:-}" ] || [ $# -eq 1 ] || fail "ARCHIVE_SHA256 is the sum of one archive: give one NAME"
[[ $tries =~ ^[1-9][0-9]*$ ]] || fail "TRIES='$tries' is no number of attempts"
command -v curl > /dev/null || fail "needs curl"
names=()
for argument in "$@"; do
  sequence=$(official "$argument")
  names+=("$sequence")
done
for sequence in "${names[@]}"; do
  get "$sequence"
done
