"""Renders a room in more bands and through a lens, and prints how many times as long that takes: through a pinhole in 8 and
31 bands beside red, green and blue, and through a double Gauss beside a pinhole with as many bands.

Both are rendered in turn, and the median of the processor time of all rounds is compared: with the paths of the scene
shared by the bands, and with each band traced by itself. The time is that of a render of many samples less that of one
of few, so that start and camera do not count. The tables go into docs/measurements/costs.md. `--command` names
another build than the release one, `--only` one of the two.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import tempfile
from pathlib import Path

import section

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "etendue"

# Numbers of bands, and how many times as long as a pinhole the lens may take.
GOALS = {3: 1.6, 8: 1.8, 31: 2.0}

# Numbers of bands, and how many times as long as red, green and blue they may take.
GOALS_OF_BANDS = {8: 1.2, 31: 1.6}


def quad(at, turn, material):
    return {"shape": "rectangle", "width": 2, "height": 2, "material": material,
            "transform": {"translate": at, "rotate": turn}}


def scene(lens, bands, samples, side):
    """Five walls of 2 m and a block, lit by a lamp, by paths of five bounces."""
    pose = {"from": [0, 1, 4.9], "look_at": [0, 1, 0]}
    camera = {"type": "pinhole", "fov": 36}
    if lens:
        parts = json.loads((ROOT / "scenes" / "lenses" / "double-gauss.json").read_text())
        camera = {"type": "lens", "lens": parts, "f_number": 2.8, "focus_distance": "4.4 m", "sensor_height": "28 mm"}
    sensor = {"resolution": [side, side]}
    if bands != 3:
        edges = [400 + 300 * k / bands for k in range(bands + 1)]
        sensor |= {"type": "multispectral", "noise": "none", "bands": edges}
    if bands != 3 and not lens:
        sensor |= {"pixel_pitch": "10 um"}
    return {
        "etendue": 1,
        "camera": camera | {"pose": pose, "sensor": sensor},
        "tracer": {"type": "path", "max_bounces": 5},
        "materials": {"white": {"type": "matte", "color": [0.73, 0.73, 0.73]},
                      "red": {"type": "matte", "color": [0.63, 0.06, 0.05]},
                      "green": {"type": "matte", "color": [0.14, 0.45, 0.09]},
                      "lamp": {"type": "emissive", "radiance": [17, 12, 7]}},
        "objects": [
            quad([0, 0, 0], [1, 0, 0, -90], "white"), quad([0, 2, 0], [1, 0, 0, 90], "white"),
            quad([0, 1, -1], [1, 0, 0, 0], "white"), quad([-1, 1, 0], [0, 1, 0, 90], "red"),
            quad([1, 1, 0], [0, 1, 0, -90], "green"),
            {"shape": "rectangle", "width": 0.5, "height": 0.5, "material": "lamp",
             "transform": {"translate": [0, 1.99, 0], "rotate": [1, 0, 0, 90]}},
            {"shape": "box", "size": [0.6, 1.2, 0.6], "material": "white",
             "transform": {"translate": [-0.3, 0.6, -0.3], "rotate": [0, 1, 0, 20]}}],
        "render": {"samples": samples},
    }


def seconds(command, spec, settings, folder):
    """Processor time of a render."""
    path = folder / "scene.json"
    path.write_text(json.dumps(spec))
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    words = [command, "render", path, "-o", folder / "out", "--outputs", "exr", "--quiet", *settings]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{spec['camera']['type']}: {done.stderr.strip()}")
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def net(arguments, lens, bands, settings, folder):
    """Processor time of the samples between the two renders."""
    few, many = (seconds(arguments.command, scene(lens, bands, samples, arguments.side), settings, folder)
                 for samples in arguments.samples)
    return many - few


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--side", type=int, default=128, help="pixels a side")
    parser.add_argument("--samples", type=int, nargs=2, default=[4, 68], help="those of the two renders")
    parser.add_argument("--command", type=Path, default=COMMAND)
    parser.add_argument("--only", choices=["bands", "lens"])
    arguments = parser.parse_args()
    about = (f"{section.machine()}; a room, paths of five bounces, {arguments.side} × {arguments.side} pixels, "
             f"{arguments.samples[1] - arguments.samples[0]} samples, the median of {arguments.rounds} rounds.")
    for part, measure in [("bands", of_bands), ("lens", of_lens)]:
        if arguments.only in (None, part):
            section.put(ROOT / "docs" / "measurements" / "costs.md", part, "\n".join([about, "", *measure(arguments)]))


def of_bands(arguments):
    """The table of bands beside red, green and blue."""
    times = {bands: [] for bands in (3, *GOALS_OF_BANDS)}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(arguments.rounds):
            for bands, found in times.items():
                found.append(net(arguments, False, bands, [], Path(folder)))
    middle = {bands: statistics.median(found) for bands, found in times.items()}
    lines = ["| bands | times red, green and blue | goal | |", "|---|---|---|---|"]
    for bands, goal in GOALS_OF_BANDS.items():
        ratio = middle[bands] / middle[3]
        lines.append(f"| {bands} | {ratio:.2f} | {goal} | {'met' if ratio <= goal else '**missed**'} |")
        print(lines[-1], times, flush=True)
    return lines


def of_lens(arguments):
    """The table of a lens beside a pinhole."""
    apart = ["--set", "plan.shared_paths=false"]
    ways = {"pinhole": (False, []), "shared": (True, []), "apart": (True, apart)}
    lines = ["| bands | paths shared, times a pinhole | goal | | each band by itself |", "|---|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for bands, goal in GOALS.items():
            times = {way: [] for way in ways}
            for _ in range(arguments.rounds):
                for way, (lens, settings) in ways.items():
                    times[way].append(net(arguments, lens, bands, settings, folder))
            middle = {way: statistics.median(found) for way, found in times.items()}
            shared, by_itself = (middle[way] / middle["pinhole"] for way in ("shared", "apart"))
            verdict = "met" if shared <= goal else "**missed**"
            lines.append(f"| {bands} | {shared:.2f} | {goal} | {verdict} | {by_itself:.2f} |")
            print(lines[-1], times, flush=True)
    return lines


if __name__ == "__main__":
    main()
