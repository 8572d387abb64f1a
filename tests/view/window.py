#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""What `dynslam run --view` has on the screen, and that the run does not care.

  window.py PROGRAM WORK

Starts Xvfb, runs PROGRAM on a short rendered sequence with --view, reads the screen from Xvfb's frame buffer and
compares it with the sequence's own images and masks. Exits with 77 where there is no Xvfb. Screenshots that were
judged stay in WORK as PPM.
"""
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import time
import zlib

PROGRAM, WORK = sys.argv[1], pathlib.Path(sys.argv[2])
WIDTH, HEIGHT = 480, 360  # from 480 pixels on a view shows images as they are
PAGE = b"\x12\x16\x1c"  # what is around the pictures
SEMANTIC = (0xef, 0x7b, 0xd8)
RESULTS = ("trajectory.txt", "trajectory_live.txt", "keyframes.txt", "map.sot")


def fail(text):
    sys.exit(f"window.py: {text}")


def png_rows(path, rows):
    """The first rows of an 8-bit PNG, and its bytes per pixel."""
    data = path.read_bytes()
    width, height, depth, kind, _, _, interlaced = struct.unpack(">IIBBBBB", data[16:29])
    if depth != 8 or interlaced:
        fail(f"{path} is a PNG of another kind")
    pixel = {0: 1, 2: 3}[kind]
    packed, at = b"", 8
    while at < len(data):
        size, = struct.unpack(">I", data[at:at + 4])
        if data[at + 4:at + 8] == b"IDAT":
            packed += data[at + 8:at + 8 + size]
        at += size + 12
    raw, stride = zlib.decompress(packed), width * pixel
    result, above = [], bytearray(stride)
    for v in range(min(rows, height)):
        method, line = raw[v * (stride + 1)], bytearray(raw[v * (stride + 1) + 1:(v + 1) * (stride + 1)])
        for i in range(stride):
            left = line[i - pixel] if i >= pixel else 0
            up, corner = above[i], above[i - pixel] if i >= pixel else 0
            if method == 1:
                line[i] = (line[i] + left) & 255
            elif method == 2:
                line[i] = (line[i] + up) & 255
            elif method == 3:
                line[i] = (line[i] + (left + up) // 2) & 255
            elif method == 4:
                p = left + up - corner
                a, b, c = abs(p - left), abs(p - up), abs(p - corner)
                line[i] = (line[i] + (left if a <= b and a <= c else up if b <= c else corner)) & 255
        result.append(bytes(line))
        above = line
    return result, pixel


class Screen:
    """An X server without a screen, whose frame buffer is a file in XWD format."""

    def __init__(self):
        (WORK / "screen").mkdir()
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24", "-nolisten", "tcp",
             "-fbdir", str(WORK / "screen")], pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as said:
            self.display = ":" + said.readline().strip()
        if self.display == ":":
            fail("Xvfb did not start")

    def shot(self):
        """Pixels as rows of R, G, B; the width; a row's bytes."""
        data = (WORK / "screen" / "Xvfb_screen0").read_bytes()
        head = struct.unpack(">25I", data[:100])
        if head[11] != 32:
            fail("the screen has no 32 bits per pixel")
        begin, line = head[0] + 12 * head[19], head[12]
        pixels = data[begin:begin + line * head[5]]
        rgb = bytearray(len(pixels) // 4 * 3)
        rgb[0::3], rgb[1::3], rgb[2::3] = pixels[2::4], pixels[1::4], pixels[0::4]
        return bytes(rgb), line // 4 * 3

    def end(self):
        self.server.terminate()
        self.server.wait()


def environment(display):
    others = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return others | {"DISPLAY": display, "QT_QPA_PLATFORM": "xcb"} if display else others


def start(name, *arguments, display=None):
    return subprocess.Popen([PROGRAM, "run", str(WORK / "office"), "--out", str(WORK / name), *arguments],
                            env=environment(display), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def finish(process):
    said, _ = process.communicate(timeout=100)
    if process.returncode != 0:
        fail(f"the run ended with {process.returncode}: {said}")


def watched(screen, name, *arguments):
    """Runs with --view. @return what was on the screen meanwhile, each once"""
    process, shots = start(name, "--view", *arguments, display=screen.display), []
    while process.poll() is None:
        shot = screen.shot()
        if not shots or shots[-1] != shot:
            shots.append(shot)
        time.sleep(0.02)
    finish(process)
    return shots


def same_results(one, other):
    for file in RESULTS:
        if (WORK / one / file).read_bytes() != (WORK / other / file).read_bytes():
            fail(f"{file} of {one} differs from that of {other}")


def place_of(shot, frame):
    """Where the top of a frame is on the screen, by a piece of it; -1: nowhere."""
    pixels, stride = shot
    for v, u in ((20, 40), (20, 300), (40, 170)):
        at = pixels.find(frame[v][3 * u:3 * (u + 40)])
        while at >= 0 and at % 3 != 0:
            at = pixels.find(frame[v][3 * u:3 * (u + 40)], at + 1)
        if at >= 0 and at % stride >= 3 * u and at >= v * stride:
            return at - v * stride - 3 * u
    return -1


def equal_share(shot, place, frame):
    pixels, stride = shot
    equal = 0
    for v, line in enumerate(frame):
        shown = pixels[place + v * stride:place + v * stride + len(line)]
        equal += sum(shown[i:i + 3] == line[i:i + 3] for i in range(0, len(line), 3))
    return equal / (len(frame) * WIDTH)


def keep(shot, name):
    pixels, stride = shot
    (WORK / name).write_bytes(b"P6 %d %d 255\n" % (stride // 3, len(pixels) // stride) + pixels)


def check_frames(shots, frames):
    """Frames are shown unchanged, one after the other."""
    seen = []
    for shot in shots:
        for i, frame in enumerate(frames):
            place = place_of(shot, frame)
            # A picture that is just being replaced is half of the next one.
            if place >= 0 and equal_share(shot, place, frame) == 1:
                seen.append(i)
                keep(shot, "frames.ppm")
    if len(set(seen)) < 3 or seen != sorted(seen):
        fail(f"of {len(frames)} frames {len(set(seen))} were seen on {len(shots)} screens, in the order {seen}")
    return len(set(seen))


def check_masks(shots, frames, files):
    """People are tinted in the colour of semantic masks, everything else is as it was."""
    best = (0, 0)
    for shot in shots[::-1]:
        for i, frame in enumerate(frames):
            place = place_of(shot, frame)
            if place < 0 or equal_share(shot, place, frame) < 0.5:
                continue
            colour, _ = png_rows(files[i], HEIGHT)
            label, _ = png_rows(WORK / "office" / "label" / files[i].name, HEIGHT)
            tinted = plain = people = 0
            pixels, stride = shot
            for v in range(1, HEIGHT):
                for u in range(WIDTH):
                    was, at = colour[v][3 * u:3 * u + 3], place + v * stride + 3 * u
                    now = pixels[at:at + 3]
                    if label[v][u] == 1:
                        people += 1
                        tinted += all(abs(0.55 * a + 0.45 * b - c) < 2 for a, b, c in zip(was, SEMANTIC, now))
                    else:
                        plain += was == now
            others = WIDTH * (HEIGHT - 1) - people
            best = max(best, (tinted / max(people, 1), plain / others))
            # A network's masks, and those of files, are used with what their keeper makes of them.
            if people > 5000 and tinted > 0.8 * people and plain > 0.9 * others:
                keep(shot, "masks.ppm")
                return
    fail(f"masks are not tinted: at best {best[0]:.2f} of a person, {best[1]:.2f} of the rest unchanged")


def main():
    if shutil.which("Xvfb") is None:
        print("SKIPPED: no Xvfb")
        sys.exit(77)
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    subprocess.run([PROGRAM, "synth", str(WORK / "office"), "--frames", "40", "--path", "xyz", "--walkers", "2",
                    "--size", f"{WIDTH}x{HEIGHT}"], check=True, stdout=subprocess.DEVNULL)
    files = sorted((WORK / "office" / "rgb").iterdir())
    frames = [png_rows(file, 50)[0] for file in files]
    semantic = ("--dynamics", "semantic", "--masks", str(WORK / "office" / "label"))
    finish(start("plain_none", "--dynamics", "none"))
    finish(start("plain_semantic", *semantic))
    screen = Screen()
    try:
        seen = check_frames(watched(screen, "none", "--dynamics", "none"), frames)
        same_results("none", "plain_none")
        check_masks(watched(screen, "semantic", *semantic), frames, files)
        same_results("semantic", "plain_semantic")
        # A display that goes away takes the window with it, and nothing else.
        run = start("gone", "--view", *semantic, display=screen.display)
        while run.poll() is None and screen.shot()[0].count(8 * PAGE) < 500:
            time.sleep(0.01)
        if run.poll() is not None:
            fail("the run ended before anything was seen")
        screen.end()
        finish(run)
        same_results("gone", "plain_semantic")
    finally:
        screen.end()
    print(f"{seen} of {len(frames)} frames seen as they are, people tinted, results the same")


main()
