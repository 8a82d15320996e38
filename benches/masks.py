"""Renders through a double Gauss with masks of small openings, and prints what a surviving ray costs beside the open stop.

A mask takes the place of the stop, or stands behind the lens. The processor time is that of a render of many samples
less that of one of few, so that setting up the camera does not count, over the rays that leave the lens towards the
scene (`rays` of the report); each is the least of some rounds. The table goes into docs/measurements/costs.md. `--command` names
another build than the release one.
"""

import argparse
import json
import os
import random
import resource
import struct
import subprocess
import tempfile
import zlib
from pathlib import Path

import section

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "etendue"

# How much more a surviving ray may cost than through the open stop.
GOAL = 1.5

# Samples a pixel of the two renders whose difference counts.
FEW, MANY = 16, 144

# Half the stop's width and what stands behind the lens, in mm.
STOP, BEHIND = 8.55, 9.0


def png(path, rows):
    """A grey PNG of 8 bits."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">2I5B", len(rows[0]), len(rows), 8, 0, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b""))


def masks():
    """Masks by name: rows of grey values."""
    choose = random.Random(1)

    def of(side, is_open):
        return [[255 if is_open(x, y) else 0 for x in range(side)] for y in range(side)]

    def holes(side, count):
        # Away from the corners, which no stop leaves open.
        places = set()
        while len(places) < count:
            x, y = choose.randrange(side), choose.randrange(side)
            if (x - side / 2) ** 2 + (y - side / 2) ** 2 < (0.35 * side) ** 2:
                places.add((x, y))
        return of(side, lambda x, y: (x, y) in places)

    cells = [[choose.random() < 0.5 for _ in range(13)] for _ in range(13)]
    yield "a coded mask of 13 × 13 cells", of(13, lambda x, y: cells[y][x])
    yield "a ring of a twentieth of the width", of(
        256, lambda x, y: 0.36 < ((x - 127.5) ** 2 + (y - 127.5) ** 2) ** 0.5 / 256 < 0.41
    )
    yield "12 pixels of 256 × 256", holes(256, 12)
    yield "3 pixels of 256 × 256", holes(256, 3)
    yield "1 pixel of 256 × 256", holes(256, 1)
    yield "1 pixel of 1024 × 1024", holes(1024, 1)


def scene(folder, mask, is_behind):
    """A ball through the lens, with or without a mask, in the stop or behind."""
    lens = json.loads((ROOT / "scenes" / "lenses" / "double-gauss.json").read_text())
    if mask is not None:
        half = BEHIND if is_behind else STOP
        element = {"type": "aperture", "shape": "image", "file": mask, "width": 2 * half}
        stop = next(i for i, e in enumerate(lens["elements"]) if e.get("stop"))
        if is_behind:
            lens["elements"][-1]["thickness"] = 2
            lens["elements"].append(element)
        else:
            lens["elements"][stop] = {**element, "thickness": lens["elements"][stop]["thickness"], "stop": True}
    camera = {
        "type": "lens",
        "lens": lens,
        "focus_distance": "1.6 m",
        "sensor_height": "24 mm",
        "pose": {"from": [0, 0.5, 1.9], "look_at": [0, 0.3, 0]},
        "sensor": {"resolution": [96, 64]},
    }
    path = folder / "scene.json"
    objects = [{"shape": "sphere", "triangles": 1000}]
    path.write_text(json.dumps({"etendue": 1, "camera": camera, "tracer": {"type": "facing"}, "objects": objects}))
    return path


def rendered(command, path, folder, samples):
    """Processor time (s), rays that left the lens, and those that were aimed at it."""
    report = folder / "report.json"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    arguments = ["render", path, "-o", folder / "out", "--report", report, "--quiet"]
    arguments += ["--threads", 1, "--samples", samples]
    done = subprocess.run([str(command), *map(str, arguments)], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise SystemExit(done.stderr.strip())
    told = json.loads(report.read_text())
    return after.ru_utime - before.ru_utime, told["rays"], told["lens_rays"]


def cost(command, path, folder, rounds):
    """Processor time a surviving ray (µs), and the share that survives."""
    few = [rendered(command, path, folder, FEW) for _ in range(rounds)]
    many = [rendered(command, path, folder, MANY) for _ in range(rounds)]
    seconds = min(time for time, *_ in many) - min(time for time, *_ in few)
    survive, aimed = (many[0][i] - few[0][i] for i in (1, 2))
    return 1e6 * seconds / survive, survive / aimed


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "measurements" / "costs.md")
    parser.add_argument("--command", type=Path, default=COMMAND)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--print-only", action="store_true", help="write no page")
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)

        def add(name, mask, is_behind):
            path = scene(folder, mask, is_behind)
            each, share = cost(arguments.command, path, folder, arguments.rounds)
            ratio = each / rows[0][1] if rows else 1.0
            row = f"| {name} | {100 * share:.1f} | {each:.2f} | {ratio:.2f} |"
            print(row, flush=True)
            rows.append((name, each, ratio, row))

        add("the open stop", None, False)
        for name, values in masks():
            png(folder / "mask.png", values)
            add(f"{name}, in the stop", "mask.png", False)
        png(folder / "mask.png", dict(masks())["12 pixels of 256 × 256"])
        add("12 pixels of 256 × 256, 2 mm behind the lens", "mask.png", True)
    missed = [f"{name} by {ratio / GOAL:.2f}" for name, _, ratio, _ in rows if ratio > GOAL]
    text = f"{section.machine()}; one thread, the least of {arguments.rounds} rounds. The goal is at most {GOAL} times the open stop's"
    text += f"; missed: {', '.join(missed)}." if missed else ", which all meet."
    head = ["| opening | rays that get through (%) | time a ray that does (µs) | over the open stop's |", "|---|---|---|---|"]
    if arguments.print_only:
        print(text)
        return
    section.put(arguments.output, "masks", text + "\n\n" + "\n".join([*head, *(row for *_, row in rows)]))


if __name__ == "__main__":
    main()
