"""Renders 96 pixels behind aspheres that are walls within their clear aperture, and prints what setting the camera up takes.

A stop in front, an asphere of one term, and a spherical surface: rays that are aimed at such a lens cross the asphere
many times or not at all, so that nearly every ray by which its pupil is measured is searched for. Processor time of the
whole process with one thread, the least of some rounds. The table goes into docs/measurements/limits.md. `--command` names another
build than the release one.
"""

import argparse
import json
import os
import resource
import subprocess
import tempfile
from pathlib import Path

import section

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "etendue"

# Seconds of processor time that no such camera may take.
GOAL = 2.0

# The power of the distance from the axis, and its coefficients (in mm); one of each is a wall at the rim of 8 mm, the
# other one within it.
TERMS = [
    (4, [1.0, 1e-3]),
    (8, [1e-3, 1e-6]),
    (16, [1e-10, 1e-14]),
    (30, [1e-15, 1e-22]),
    (30, [1e-26, -1e-22]),
]


def scene(order, coefficient):
    lens = {
        "elements": [
            {"type": "aperture", "shape": "circular", "radius": 4, "thickness": 2, "stop": True},
            {
                "type": "surface",
                "radius": 40,
                "thickness": 5,
                "glass": "N-BK7",
                "semi_diameter": 8,
                "aspheric": {str(order): coefficient},
            },
            {"type": "surface", "radius": -60, "semi_diameter": 8},
        ]
    }
    camera = {
        "type": "lens",
        "lens": lens,
        "focus_distance": "3 m",
        "sensor_height": "10 mm",
        "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [12, 8]},
    }
    objects = [{"shape": "sphere", "triangles": 1000}]
    return {"etendue": 1, "camera": camera, "tracer": {"type": "facing"}, "objects": objects, "render": {"samples": 1}}


def seconds(command, path, folder):
    """Processor time of a render (s)."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    arguments = [command, "render", path, "-o", folder / "out", "--quiet", "--threads", 1]
    done = subprocess.run([str(part) for part in arguments], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 2):
        raise SystemExit(done.stderr.strip())
    outcome = "a picture" if done.returncode == 0 else "refused: no light passes"
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, outcome


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "measurements" / "limits.md")
    parser.add_argument("--command", type=Path, default=COMMAND)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--print-only", action="store_true", help="write no page")
    arguments = parser.parse_args()
    rows, worst = [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        path = folder / "scene.json"
        for order, coefficients in TERMS:
            for coefficient in coefficients:
                path.write_text(json.dumps(scene(order, coefficient)))
                taken = [seconds(arguments.command, path, folder) for _ in range(arguments.rounds)]
                least, outcome = min(taken)
                worst = max(worst, least)
                row = f"| {order} | {coefficient:g} | {least:.2f} | {outcome} |"
                print(row, flush=True)
                rows.append(row)
    if arguments.print_only:
        return
    verdict = "which all meet" if worst <= GOAL else f"missed: {worst:.2f} s at worst"
    text = f"{section.machine()}; one thread, the least of {arguments.rounds} rounds. The goal is {GOAL:g} s, {verdict}."
    head = ["| power | coefficient (mm) | processor time (s) | what comes of it |", "|---|---|---|---|"]
    section.put(arguments.output, "aspheres", text + "\n\n" + "\n".join([*head, *rows]))


if __name__ == "__main__":
    main()
