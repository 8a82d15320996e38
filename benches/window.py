#!/usr/bin/env python3
"""The window, as a hand and an eye meet it: a real one on a screen in memory.

    python3 benches/window.py [--rounds N] [--output docs/measurements/costs.md] [SCENE...]

Xvfb keeps its screen in a file, so that a row of pixels of the picture costs nothing to read. For every scene:

* the time from the start of the process to its first pixels, of `--rounds` processes after one that warms the
  cache of files;
* pictures a second during five seconds in which the mouse turns the camera, 120 times a second;
* the time from a click of the wheel to the first pixels of the nearer picture, nine times, each from rest;
* processor time at rest, over five seconds.

All of it is drawn by Mesa on the processor, which the window shares with its own renders. Without scenes they
are the million triangles of first-light.json and, where ETENDUE_ASSETS names
the reference data, a textured avocado.
"""

import ctypes
import mmap
import os
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import program
from section import machine, put, spread

SIZE = (1360, 860)
# The middle of the canvas between the panels, and where the pointer stands while rows above it are read.
MIDDLE = (640, 400)
POINTER = (640, 620)
PATIENCE = 60.0
CLICKS = 9
# Moves of the mouse a second.
MOVES = 120


class Hand:
    """A mouse, by X's own extension for tests."""

    def __init__(self, display):
        self.x, self.tests = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self.x.XOpenDisplay.restype = ctypes.c_void_p
        self.display = ctypes.c_void_p(self.x.XOpenDisplay(display.encode()))

    def move(self, x, y):
        self.tests.XTestFakeMotionEvent(self.display, -1, x, y, ctypes.c_ulong(0))
        self.x.XFlush(self.display)

    def button(self, number, is_down):
        self.tests.XTestFakeButtonEvent(self.display, number, is_down, ctypes.c_ulong(0))
        self.x.XFlush(self.display)


class Screen:
    """Xvfb, and its pixels."""

    def __init__(self, folder):
        number, told = os.pipe()
        self.process = subprocess.Popen(
            ["Xvfb", "-displayfd", str(told), "-fbdir", folder, "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24",
             "+extension", "GLX", "-nolisten", "tcp"], pass_fds=[told], stderr=subprocess.DEVNULL)
        os.close(told)
        with os.fdopen(number) as words:
            self.name = ":" + words.readline().strip()
        with open(Path(folder) / "Xvfb_screen0", "rb") as file:
            self.pixels = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        # The header of an XWD file: its own length, the bytes of a row, and the number of colours after it.
        header = struct.unpack(">25I", self.pixels[:100])
        self.begin, self.stride = header[0] + 12 * header[19], header[12]
        self.hand = Hand(self.name)

    def row(self, y):
        """Two hundred pixels of the picture's middle, `y` pixels below it."""
        start = self.begin + (MIDDLE[1] + y) * self.stride + 4 * (MIDDLE[0] - 100)
        return self.pixels[start:start + 800]

    def has_picture(self):
        """Whether no colour fills half of the middle of the canvas."""
        colors = Counter(bytes(row[x:x + 3]) for y in range(-60, 61, 10) for row in [self.row(y)]
                         for x in range(0, 800, 16))
        return colors.most_common(1)[0][1] < sum(colors.values()) / 2


class Window:
    """A process that shows a scene."""

    def __init__(self, screen, scene):
        self.screen = screen
        self.environment = os.environ | {"DISPLAY": screen.name, "LIBGL_ALWAYS_SOFTWARE": "1",
                                         "WINIT_X11_SCALE_FACTOR": "1"}
        self.environment.pop("WAYLAND_DISPLAY", None)
        start = time.perf_counter()
        self.process = subprocess.Popen([program.built("etendue"), "view", str(scene)], env=self.environment)
        self.wait(screen.has_picture, 0.001)
        self.first = time.perf_counter() - start

    def wait(self, is_so, pause):
        start = time.perf_counter()
        while not is_so():
            if self.process.poll() is not None or time.perf_counter() - start > PATIENCE:
                raise SystemExit("the window shows no picture")
            time.sleep(pause)

    def rest(self):
        """Waits until the picture has been the same, and the processor idle, for a second."""
        last = (None, self.spent())

        def is_still():
            nonlocal last
            time.sleep(1.0)
            before, last = last, (self.screen.row(0), self.spent())
            return last[0] == before[0] and last[1] - before[1] < 0.05

        self.wait(is_still, 0.0)

    def spent(self):
        """Processor time so far (s)."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def turn(self, seconds):
        """Pictures a second while the mouse turns the camera."""
        hand = self.screen.hand
        hand.move(*POINTER)
        time.sleep(0.5)
        hand.button(1, True)
        start, moves, shown, last = time.perf_counter(), 0, 0, self.screen.row(0)
        while (now := time.perf_counter() - start) < seconds:
            if now * MOVES > moves:
                moves += 1
                # There and back, two pixels at a time.
                hand.move(POINTER[0] + 2 * abs(moves % 120 - 60), POINTER[1])
            row = self.screen.row(0)
            shown += row != last
            last = row
            time.sleep(0.001)
        hand.button(1, False)
        return shown / seconds

    def delays(self):
        """Times from a click of the wheel to new pixels (ms)."""
        hand = self.screen.hand
        hand.move(*POINTER)
        delays = []
        for i in range(CLICKS):
            self.rest()
            before, start = self.screen.row(0), time.perf_counter()
            wheel = 4 if i % 2 == 0 else 5
            hand.button(wheel, True)
            hand.button(wheel, False)
            self.wait(lambda: self.screen.row(0) != before, 0.0005)
            delays.append(1e3 * (time.perf_counter() - start))
        return delays

    def idle(self, seconds):
        self.rest()
        before = self.spent()
        time.sleep(seconds)
        return self.spent() - before

    def close(self):
        self.process.terminate()
        self.process.wait(timeout=PATIENCE)


def measure(screen, scene, rounds):
    """A row of the table."""
    first = []
    for number in range(rounds + 1):
        window = Window(screen, scene)
        # The first process reads files that may not be in memory.
        first += [window.first] if number > 0 else []
        if number < rounds:
            window.close()
            time.sleep(0.3)
    window.rest()
    rates = [window.turn(5.0) for _ in range(3)]
    delays = window.delays()
    idle = window.idle(5.0)
    window.close()
    row = (f"| {Path(scene).name} | {spread(first, 2)} s | {spread(rates, 0)} | {spread(delays, 0)} ms | "
            f"{1e3 * idle:.0f} ms |")
    print(row, flush=True)
    return row


def scenes():
    assets = os.environ.get("ETENDUE_ASSETS")
    return [program.ROOT / "scenes/first-light.json"] + ([Path(assets) / "data/gltf/Avocado/Avocado.gltf"] if assets else [])


def main():
    parser = program.arguments(__doc__, "measurements/costs.md", rounds=5)
    parser.add_argument("scenes", nargs="*", type=Path, help="what to look at")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        screen = Screen(folder)
        try:
            rows = [measure(screen, scene, arguments.rounds) for scene in arguments.scenes or scenes()]
        finally:
            screen.process.terminate()
            screen.process.wait()
    text = "\n".join([
        f"Measured on {machine()}, {os.cpu_count()} processors; medians, with the least and the greatest.", "",
        "| | first pixels after | pictures a second while turned | from the wheel to new pixels | "
        "processor time of 5 s at rest |", "|---|---|---|---|---|",
        "| goal | 1.5 s | 20 | 100 ms | 0 |", *rows])
    put(arguments.output, "window", text)
    print(text)


if __name__ == "__main__":
    sys.exit(main())
