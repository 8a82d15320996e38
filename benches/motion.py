"""Renders a room with a shutter, with a camera that moves, with moving copies and with a mesh that changes its shape, and prints
how many times as long a sample takes as in the same room standing still.

All are rendered in turn, and the median of the ratios of all rounds counts. The time is the processor time of a render of many
samples less that of one of few, so that start, models and structures do not count. A second table has what motion costs
the caster of rays alone, beside Embree's own motion blur of the same things on the same rays (`benches/src/bin/motion.rs`). Both
go into docs/measurements/costs.md. `--command` names another build than the release one; the program `motion` is looked for beside it.
"""

import argparse
import json
import math
import os
import resource
import statistics
import struct
import subprocess
import tempfile
from pathlib import Path

import section

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "etendue"

# Cells a side of the mesh that changes its shape.
CELLS = 60

# What is compared: its name, what it is compared with, and how many times as long it may take, where that is a goal.
COMPARED = [("a shutter, nothing moves", "still", 1.01), ("the camera moves", "still", 1.15),
            ("12 copies move", "12 copies stand", None), ("a morph of 7200 triangles plays", "it stands in its moment", None)]


def model(folder):
    """A sheet whose one morph target makes a wave of it, within a tenth of a second."""
    count = CELLS + 1
    places = [(x / CELLS - 0.5, y / CELLS - 0.5) for y in range(count) for x in range(count)]
    positions = [(0.8 * x, 0.8 * y, 0.0) for x, y in places]
    moves = [(0.0, 0.0, 0.2 * math.sin(9 * x) * math.cos(7 * y)) for x, y in places]
    indices = []
    for y in range(CELLS):
        for x in range(CELLS):
            a = y * count + x
            indices += [a, a + 1, a + count, a + count, a + 1, a + count + 1]
    parts = [struct.pack(f"<{3 * len(positions)}f", *sum(positions, ())), struct.pack(f"<{3 * len(moves)}f", *sum(moves, ())),
             struct.pack(f"<{len(indices)}I", *indices), struct.pack("<2f", 0, 0.1), struct.pack("<2f", 0, 1)]
    kinds = [(5126, "VEC3", len(positions)), (5126, "VEC3", len(moves)), (5125, "SCALAR", len(indices)),
             (5126, "SCALAR", 2), (5126, "SCALAR", 2)]
    starts = [sum(map(len, parts[:k])) for k in range(len(parts))]
    document = {
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 2, "targets": [{"POSITION": 1}]}]}],
        "animations": [{"samplers": [{"input": 3, "output": 4}],
                        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}],
        "accessors": [{"bufferView": k, "componentType": kind, "type": shape, "count": n}
                      for k, (kind, shape, n) in enumerate(kinds)],
        "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": len(part)} for start, part in zip(starts, parts)],
        "buffers": [{"byteLength": sum(map(len, parts)), "uri": "sheet.bin"}]}
    (folder / "sheet.bin").write_bytes(b"".join(parts))
    (folder / "sheet.gltf").write_text(json.dumps(document))


def quad(at, turn, material):
    return {"shape": "rectangle", "width": 2, "height": 2, "material": material, "transform": {"translate": at, "rotate": turn}}


def scenes(side):
    """Five walls of 2 m lit by a lamp, by paths of five bounces, and what stands or moves in it."""
    camera = {"type": "pinhole", "fov": 36, "pose": {"from": [0, 1, 4.9], "look_at": [0, 1, 0]}, "sensor": {"resolution": [side, side]}}
    shutter = {"shutter": {"exposure": "10 ms"}}
    walls = [quad([0, 0, 0], [1, 0, 0, -90], "white"), quad([0, 2, 0], [1, 0, 0, 90], "white"),
             quad([0, 1, -1], [1, 0, 0, 0], "white"), quad([-1, 1, 0], [0, 1, 0, 90], "red"),
             quad([1, 1, 0], [0, 1, 0, -90], "green"),
             {"shape": "rectangle", "width": 0.5, "height": 0.5, "material": "lamp",
              "transform": {"translate": [0, 1.99, 0], "rotate": [1, 0, 0, 90]}}]
    block = {"shape": "box", "size": [0.6, 1.2, 0.6], "material": "white",
             "transform": {"translate": [-0.3, 0.6, -0.3], "rotate": [0, 1, 0, 20]}}
    places = [{"translate": [-0.75 + 0.5 * (k % 4), 0.3 + 0.6 * (k // 4), -0.2]} for k in range(12)]
    copies = {"shape": "sphere", "radius": 0.2, "material": "white", "instances": places}
    spin = {"motion": {"type": "velocity", "velocity": [5, 0, 0]}}
    sheet = {"file": "sheet.gltf", "material": "white", "animation": {"time": 0.02}, "transform": {"translate": [0, 1, 0]}}
    playing = sheet | {"animation": {"time": 0.02, "plays": True}}
    moving = {"motion": {"type": "velocity", "velocity": [1, 0, 0], "angular_velocity": [0, 20, 0]}}

    def scene(camera, objects):
        return {"etendue": 1, "camera": camera, "tracer": {"type": "path", "max_bounces": 5}, "objects": walls + objects,
                "materials": {"white": {"type": "matte", "color": [0.73, 0.73, 0.73]},
                              "red": {"type": "matte", "color": [0.63, 0.06, 0.05]},
                              "green": {"type": "matte", "color": [0.14, 0.45, 0.09]},
                              "lamp": {"type": "emissive", "radiance": [17, 12, 7]}}}

    return {"still": scene(camera, [block]), "a shutter, nothing moves": scene(camera | shutter, [block]),
            "the camera moves": scene(camera | shutter | moving, [block]),
            "12 copies stand": scene(camera | shutter, [copies]), "12 copies move": scene(camera | shutter, [copies | spin]),
            "it stands in its moment": scene(camera | shutter, [sheet]),
            "a morph of 7200 triangles plays": scene(camera | shutter, [playing])}


# What is compared with Embree's own motion blur: how many times as long as Embree's ratio ours may be.
NEAR = 1.1


def caster(command, all_scenes, rounds, folder):
    """Rows of what motion costs the caster of rays, and Embree's own motion blur."""
    lines = ["| moves | rays | ours | Embree's own | ours over Embree's | goal |", "|---|---|---|---|---|---|"]
    for name, beside, _ in COMPARED[2:]:
        paths = [folder / "still.json", folder / "moving.json"]
        for path, key in zip(paths, [beside, name]):
            path.write_text(json.dumps(all_scenes[key]))
        words = [command.parent / "motion", rounds, *paths]
        done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(done.stderr.strip())
        for line in done.stdout.splitlines():
            rays, ours, theirs = json.loads(line)
            ratios = [a / b for a, b in zip(ours, theirs)]
            verdict = f"{NEAR}, {'met' if statistics.median(ratios) <= NEAR else '**missed**'}"
            lines.append(f"| {name} | {rays} | {section.spread(ours, 2)} | {section.spread(theirs, 2)} | "
                         f"{section.spread(ratios, 2)} | {verdict} |")
            print(lines[-1], flush=True)
    return lines


def seconds(command, spec, samples, folder):
    """Processor time of a render."""
    path = folder / "scene.json"
    path.write_text(json.dumps(spec | {"render": {"samples": samples}}))
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    words = [command, "render", path, "-o", folder / "out", "--outputs", "exr", "--quiet"]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(done.stderr.strip())
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def main():
    parser = argparse.ArgumentParser(description=" ".join(__doc__.split("\n\n")[0].split()))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--side", type=int, default=128, help="pixels a side")
    parser.add_argument("--samples", type=int, nargs=2, default=[4, 68], help="those of the two renders")
    parser.add_argument("--command", type=Path, default=COMMAND)
    arguments = parser.parse_args()
    all_scenes = scenes(arguments.side)
    times = {name: [] for name in all_scenes}
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        model(folder)
        for _ in range(arguments.rounds):
            for name, spec in all_scenes.items():
                few, many = (seconds(arguments.command, spec, samples, folder) for samples in arguments.samples)
                times[name].append(many - few)
    words = f"--rounds {arguments.rounds} --side {arguments.side} --samples {arguments.samples[0]} {arguments.samples[1]}"
    lines = [f"`make bench-time ARGS=\"{words}\"`: {section.machine()}; a room, paths of five bounces, "
             f"{arguments.side} × {arguments.side} pixels, {arguments.samples[1] - arguments.samples[0]} samples; median of the rounds, "
             "with the least and the greatest.", "",
             "| | beside | times as long a sample | goal |", "|---|---|---|---|"]
    for name, beside, goal in COMPARED:
        ratios = [a / b for a, b in zip(times[name], times[beside])]
        verdict = "" if goal is None else f"{goal}, {'met' if statistics.median(ratios) <= goal else '**missed**'}"
        lines.append(f"| {name} | {beside} | {section.spread(ratios, 2)} | {verdict} |")
        print(lines[-1], flush=True)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        model(folder)
        lines += ["", "What motion costs the caster of rays alone, and Embree's own motion blur of the same things on the same rays, each beside "
                  "its own time where all stands still:", ""]
        lines += caster(arguments.command, all_scenes, arguments.rounds, folder)
    section.put(ROOT / "docs" / "measurements" / "costs.md", "motion", "\n".join(lines))


if __name__ == "__main__":
    main()
