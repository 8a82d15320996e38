"""Scenes and pictures as large as most machines take, each rendered in a process of its own.

Writes what they took into docs/measurements/limits.md: the time of the whole process and its peak of memory.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import program
import section

MEBIBYTE = 1024


def run(*command):
    """Seconds on the clock and the peak of memory (MiB) of a command."""
    start = time.monotonic()
    child = subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    if os.waitstatus_to_exitcode(status) != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: failed")
    return time.monotonic() - start, usage.ru_maxrss / MEBIBYTE


def models(folder, triangles):
    """A blob of so many triangles as a GLB, with a scene of depth and normals."""
    run(program.built("benchmarks"), "models", folder, "--triangles", triangles, "--formats", "glb")
    return folder / "glb.json"


def ten_times(scene):
    """The same scene with ten copies of its object, side by side."""
    text = json.loads(scene.read_text())
    places = [{"translate": [3 * (k - 4.5), 0, 0]} for k in range(10)]
    text["objects"] = [text["objects"][0] | {"instances": places}]
    copy = scene.with_name("ten.json")
    copy.write_text(json.dumps(text))
    return copy


def jobs(folder):
    """What is rendered: its name, the scene, and more arguments."""
    ten = models(folder / "ten", 10_000_000)
    yield "10M triangles, one GLB; depth and normals, 1024 x 1024", ten, []
    yield "100M triangles as ten copies of it, the same layers", ten_times(ten), []
    thirty = models(folder / "thirty", 30_000_000)
    yield "30M triangles, one GLB; the same layers", thirty, []
    gauss = program.ROOT / "scenes" / "double-gauss.json"
    large = ["--set", "camera.sensor.resolution=[5472,3648]", "--samples", 4]
    yield "20 megapixels (5472 x 3648) through the double Gauss, 4 samples", gauss, large


def main():
    arguments = program.arguments(__doc__, "measurements/limits.md", rounds=1).parse_args()
    etendue = program.built("etendue")
    rows = ["| job | time (s) | peak of memory (MiB) |", "|---|---|---|"]
    with tempfile.TemporaryDirectory(dir=program.TARGET) as folder:
        folder = Path(folder)
        for name, scene, more in jobs(folder):
            render = [etendue, "render", scene, "-o", folder / "out", "--quiet", "--outputs", "exr"]
            took = [run(*render, *more) for _ in range(arguments.rounds)]
            seconds = section.spread([seconds for seconds, _ in took])
            peak = max(peak for _, peak in took)
            rows.append(f"| {name} | {seconds} | {peak:.0f} |")
            print(rows[-1], file=sys.stderr)
    about = f"{section.machine()}; {os.cpu_count()} processors; {arguments.rounds} rounds.\n\n"
    section.put(arguments.output, "sizes", about + "\n".join(rows))


if __name__ == "__main__":
    main()
