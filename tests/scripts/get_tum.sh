#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-3-Clause
#
# scripts/get-tum.sh against a file server on this machine: whole, broken, resumed, damaged and replaced transfers, and
# that none of them leaves a folder that is not complete. Ends with 77 (skipped) where python3 or unzip is missing.
set -euo pipefail
script=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)/scripts/get-tum.sh
for tool in python3 unzip curl; do
  command -v "$tool" > /dev/null || { echo "SKIPPED: no $tool"; exit 77; }
done
work=$(mktemp -d)
server=
trap 'rm -rf "$work"; [ -z "$server" ] || kill "$server"' EXIT

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# Archives as the two data sets have them, too large for one packet.
name=rgbd_dataset_freiburg3_walking_xyz bonn=rgbd_bonn_balloon
for sequence in $name $bonn; do
  mkdir -p "$work/made/$sequence/rgb"
  echo "1.0 rgb/1.0.png" > "$work/made/$sequence/rgb.txt"
  head -c 300000 /dev/urandom > "$work/made/$sequence/rgb/1.0.png"
done
mkdir -p "$work/files/freiburg3" "$work/files/freiburg1" "$work/other/$name"
tar -czf "$work/files/freiburg3/$name.tgz" -C "$work/made" $name
(cd "$work/made" && python3 -m zipfile -c "$work/files/$bonn.zip" $bonn)
tar -czf "$work/files/freiburg1/rgbd_dataset_freiburg1_xyz.tgz" -C "$work/made" $name  # not what its name says

# Serves files with ranges. The file `mode` says what goes wrong: cut N (every answer ends after N bytes), noranges.
cat > "$work/server.py" <<'PYTHON'
import http.server, os, re, sys
root = sys.argv[1]

class Handler(http.server.BaseHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def do_HEAD(self):
        self.do_GET()

    def do_GET(self):
        mode = open(root + '/mode').read().split()
        try:
            data = open(root + '/files' + self.path, 'rb').read()
        except OSError:
            self.send_error(404)
            return
        wanted = re.fullmatch(r'bytes=(\d+)-', self.headers.get('Range', ''))
        start = int(wanted[1]) if wanted and mode[0] != 'noranges' else 0
        open(root + '/log', 'a').write(f'{self.command} {start}\n')
        if start >= len(data):
            self.send_error(416)
            return
        self.send_response(206 if start else 200)
        if start:
            self.send_header('Content-Range', f'bytes {start}-{len(data) - 1}/{len(data)}')
        self.send_header('Content-Length', str(len(data) - start))
        self.end_headers()
        if self.command == 'GET':
            end = start + int(mode[1]) if mode[0] == 'cut' else len(data)
            self.wfile.write(data[start:end])

server = http.server.HTTPServer(('127.0.0.1', 0), Handler)
open(root + '/port.new', 'w').write(str(server.server_port))
os.rename(root + '/port.new', root + '/port')
server.serve_forever()
PYTHON
echo whole > "$work/mode"
python3 "$work/server.py" "$work" &
server=$!
for _ in {1..100}; do
  [ ! -e "$work/port" ] || break
  sleep 0.1
done
[ -e "$work/port" ] || fail "the server did not start"
BASE_URL=http://127.0.0.1:$(cat "$work/port")
export BASE_URL PAUSE=0 TRIES=3 OUT=$work/out no_proxy=127.0.0.1

# got ARGUMENT...: what the server has is there, and nothing else but sums.
got() {
  : > "$work/log"
  "$script" "$@" > "$work/said" 2>&1 || fail "$*: $(cat "$work/said")"
  diff -r "$work/made/$name" "$OUT/$name" > /dev/null || fail "$*: another content"
  [ -z "$(find "$OUT" -mindepth 1 -maxdepth 1 ! -name '*.sha256' ! -name 'rgbd_*[a-z]')" ] ||
    fail "$*: left $(ls -A "$OUT")"
}
# refused REASON ARGUMENT...: the reason is one line, and no folder and no helper is left.
refused() {
  local reason=$1
  shift
  : > "$work/log"
  ! "$script" "$@" > "$work/said" 2>&1 || fail "accepted: $*"
  tail -n 1 "$work/said" | grep -qF "$reason" || fail "$*: '$reason' is not said last: $(cat "$work/said")"
  [ -z "$(find "$OUT" -mindepth 1 -maxdepth 1 ! -name '*.sha256' ! -name '*.part' 2> /dev/null)" ] ||
    fail "$*: left $(ls -A "$OUT")"
}
part=$OUT/$name.tgz.part kept=$OUT/$name.tgz.sha256
archive=$work/files/freiburg3/$name.tgz
size=$(stat -c %s "$archive")

refused "unknown sequence 'fr3_running_xyz'" fr3_walking_xyz fr3_running_xyz
[ ! -e "$OUT" ] || fail "a wrong name is found after something was fetched"
refused "/freiburg1/rgbd_dataset_freiburg1_desk.tgz is not there (HTTP status 404)" fr1_desk
[ ! -e "$OUT/rgbd_dataset_freiburg1_desk.tgz.part" ] || fail "an empty part is left"
refused "has no rgbd_dataset_freiburg1_xyz/rgb.txt" freiburg1_xyz

got fr3_walking_xyz                                      # by its short name
[ "$(cut -d' ' -f1 "$kept")" = "$(sha256sum < "$archive" | cut -d' ' -f1)" ] || fail "the sum is not kept"
got $name                                                # there: nothing is asked
[ ! -s "$work/log" ] || fail "what is there was fetched again"
got bonn_balloon
diff -r "$work/made/$bonn" "$OUT/$bonn" > /dev/null || fail "$bonn: another content"

rm -r "${OUT:?}/$name" "${OUT:?}/$bonn"
echo "cut 120000" > "$work/mode"                         # three answers make it whole
got fr3_walking_xyz
[ "$(grep -c GET "$work/log")" = 3 ] && grep -q "GET 240000" "$work/log" || fail "not resumed: $(cat "$work/log")"
rm -r "${OUT:?}/$name"
echo "cut 50000" > "$work/mode"                          # three are not enough: the next call goes on
refused "broke off at 150000 of $size bytes, 3 times" fr3_walking_xyz
[ "$(stat -c %s "$part")" = 150000 ] || fail "the beginning is not kept"
echo whole > "$work/mode"
got fr3_walking_xyz
grep -q "GET 150000" "$work/log" || fail "fetched from the start: $(cat "$work/log")"
rm -r "${OUT:?}/$name"
head -c 1000 "$archive" > "$part"                        # a server that cannot go on
echo noranges > "$work/mode"
got fr3_walking_xyz
rm -r "${OUT:?}/$name"
echo whole > "$work/mode"
head -c 1000 /dev/urandom > "$part"                      # the beginning of another file
got fr3_walking_xyz
rm -r "${OUT:?}/$name"
cp "$archive" "$part"                                    # whole, but not unpacked yet
got fr3_walking_xyz
! grep -q GET "$work/log" || fail "a whole archive was fetched again"
rm -r "${OUT:?}/$name"

evil=$work/evil/$name                                    # archives that are more than images
mkdir -p "$work/evil"
# planted COMMAND...: the sequence with what COMMAND puts into its folder.
planted() {
  rm -rf "$evil" "$kept"
  cp -r "$work/made/$name" "$work/evil"
  (cd "$evil" && "$@")
  tar -czf "$archive" -C "$work/evil" $name
}
for command in "ln -s /etc/passwd depth.txt" "mkfifo depth.txt" "ln rgb.txt depth.txt"; do
  # shellcheck disable=SC2086
  planted $command
  refused "holds what is no plain file: " fr3_walking_xyz
  [ ! -e "$part" ] || fail "$command: the archive is kept"
done
rm -rf "$evil" "$kept"
ln -s /tmp "$evil"                                       # a link for the folder
tar -czf "$archive" -C "$work/evil" $name
refused "holds what is no plain file: " fr3_walking_xyz
rm "$evil"
planted sh -c 'cp /bin/true run && chmod 4777 run rgb'
"$script" fr3_walking_xyz > "$work/said" 2>&1 || fail "a setuid file: $(cat "$work/said")"
[ -z "$(find "$OUT/$name" -perm /7000)" ] || fail "setuid is kept"
rm -r "${OUT:?}/$name" "$kept"
tar -czf "$archive" -C "$work/made" $name
got fr3_walking_xyz
rm -r "${OUT:?}/$name"

mkdir "$work/bin"                                        # a disk that is full
printf '#!/bin/sh\necho Avail\necho 1000\n' > "$work/bin/df"
chmod +x "$work/bin/df"
PATH=$work/bin:$PATH refused "no space for $name" fr3_walking_xyz
ARCHIVE_SHA256=$(printf '0%.0s' {1..64}) refused "(ARCHIVE_SHA256)" fr3_walking_xyz
ARCHIVE_SHA256=0 refused "'0' is no SHA-256" fr3_walking_xyz
tar -czf "$archive" -C "$work/made" $name --mtime=2000-01-01   # replaced since the first download
refused "($kept)" fr3_walking_xyz
[ ! -e "$part" ] || fail "an archive with a wrong sum is kept"
rm "$kept"
printf 'XXXX' | dd of="$archive" bs=1 seek=200000 conv=notrunc 2> /dev/null
refused "$name.tgz is damaged" fr3_walking_xyz
[ ! -e "$kept" ] && [ ! -e "$part" ] || fail "a damaged archive is believed or kept"
printf 'XXXX' | dd of="$work/files/$bonn.zip" bs=1 seek=200000 conv=notrunc 2> /dev/null
refused "$bonn.zip is damaged" bonn_balloon
BASE_URL=http://127.0.0.1:1 refused "could not fetch http://127.0.0.1:1/freiburg3" fr3_walking_xyz
