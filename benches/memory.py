"""Renders the example scenes and others, and prints the memory that was forecast beside the most that was held.

Each scene is checked and rendered by the built command in a folder of its own that goes when it is done. What is
held is the process's greatest resident set (VmHWM), program and libraries included, as the report has it; mapped
files count as far as they are resident, so a forecast is right from its total to its total with them. The table
goes into docs/measurements/limits.md. `--command` names another build than the release one.
"""

import argparse
import json
import os
import struct
import subprocess
import tempfile
from pathlib import Path

import section

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "etendue"

# Factors beyond which a forecast has missed.
GOAL = 1.5

MIB = 2**20


def run(command, *arguments):
    done = subprocess.run([str(command), *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def copies(folder, count):
    """`count` copies of a sphere on a grid, their places in an NPY file."""
    side = round(count ** (1 / 2))
    body = bytearray()
    for i in range(count):
        x, y = i % side, i // side
        body += struct.pack("<12d", 1, 0, 0, 3 * x, 0, 1, 0, 3 * y, 0, 0, 1, 0)
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({count}, 3, 4), }}"
    header += " " * (63 - (10 + len(header)) % 64) + "\n"
    place = folder / "places.npy"
    place.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode() + body)
    return {"objects": [{"shape": "sphere", "triangles": 80, "instances": "places.npy"}]}


def takes_samples(scene):
    """Whether `--samples` may stand in for the scene's own: there is light, and samples do not go on to an error."""
    told = json.loads(scene.read_text())
    return told.get("tracer") is not None and not isinstance(told.get("render", {}).get("samples"), dict)


def made(folder):
    """Scenes that are made here, by name: what each of the parts of a forecast is the most of."""
    camera = {"type": "pinhole", "sensor": {"resolution": [64, 48]}}
    common = {"etendue": 1, "camera": camera, "layers": ["depth"]}
    for count in [10_000, 100_000, 1_000_000]:
        yield f"{count} copies", {**common, **copies(folder, count)}
    for triangles in [100_000, 1_000_000, 4_000_000]:
        objects = [{"shape": "blob", "triangles": triangles}]
        yield f"a shape of {triangles} triangles", {**common, "objects": objects}
    large = {"type": "pinhole", "sensor": {"resolution": [2000, 1500]}}
    scene = {**common, "camera": large, "objects": [{"shape": "sphere"}], "layers": ["depth", "normal", "ids"]}
    yield "a picture of 3 million pixels", scene
    small = {"type": "orbit", "count": 100}
    yield "100 frames", {**common, "objects": [{"shape": "blob", "triangles": 100_000}], "frames": small}


def measured(command, scene, folder, more):
    """The forecast (total, and what stays in files) and the most that was held (bytes)."""
    forecast = json.loads(run(command, "check", scene, "--json", *more))["memory"]
    report = folder / "report.json"
    run(command, "render", scene, "-o", folder / "out", "--report", report, "--quiet", *more)
    told = json.loads(report.read_text())
    # Of many frames there is a report each.
    reports = told if isinstance(told, list) else [told]
    return forecast, max(report["peak_memory_bytes"] for report in reports)


def factor(forecast, held):
    """How far what was held is from the range of the forecast."""
    low, high = forecast["total"], forecast["total"] + forecast["mapped"]
    if low <= held <= high:
        return 1.0
    return max(low / held, held / high)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "measurements" / "limits.md")
    parser.add_argument("--command", type=Path, default=COMMAND)
    parser.add_argument("--samples", type=int, help="of the example scenes with light and a count of samples, instead of their own")
    parser.add_argument("--made-only", action="store_true", help="without the example scenes")
    parser.add_argument("--print-only", action="store_true", help="write no page")
    parser.add_argument("scenes", nargs="*", type=Path)
    arguments = parser.parse_args()
    examples = ROOT / "scenes"
    scenes = arguments.scenes or sorted([*examples.glob("*.json"), *examples.glob("paper/*.json")])
    if arguments.made_only:
        scenes = []
    rows = []

    def add(name, scene, folder, more=()):
        forecast, held = measured(arguments.command, scene, folder, more)
        off = factor(forecast, held)
        row = f"| {name} | {forecast['total'] / MIB:.0f} | {forecast['mapped'] / MIB:.0f} | {held / MIB:.0f} | {off:.2f} |"
        print(row, flush=True)
        rows.append((name, off, row))

    for scene in scenes:
        more = ["--samples", arguments.samples] if arguments.samples and takes_samples(scene) else []
        with tempfile.TemporaryDirectory() as folder:
            add(f"`{scene.relative_to(examples) if scene.is_relative_to(examples) else scene}`", scene, Path(folder), more)
    if not arguments.scenes:
        with tempfile.TemporaryDirectory() as folder:
            for name, value in made(Path(folder)):
                scene = Path(folder) / "scene.json"
                scene.write_text(json.dumps(value))
                add(name, scene, Path(folder))
    missed = [f"{name} by {off:.2f}" for name, off, _ in rows if off > GOAL]
    samples = f"; `--samples {arguments.samples}`" if arguments.samples else ""
    text = f"{section.machine()}{samples}. {len(rows) - len(missed)} of {len(rows)} forecasts are within a factor {GOAL} of the most that was held"
    text += f"; missed: {', '.join(missed)}." if missed else "."
    head = ["| scene | forecast (MiB) | in mapped files (MiB) | held (MiB) | factor |", "|---|---|---|---|---|"]
    if arguments.print_only:
        print(text)
        return
    section.put(arguments.output, "memory", text + "\n\n" + "\n".join([*head, *(row for *_, row in rows)]))


if __name__ == "__main__":
    main()
