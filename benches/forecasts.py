"""Renders the example scenes and others, and holds what was forecast of them against what they took: `forecasts.py time`,
`forecasts.py memory`. Each scene is planned or checked and rendered by the built command, in a folder of its own that goes
when it is done.
"""

import argparse
import inspect
import json
import os
import struct
import subprocess
import tempfile
from pathlib import Path

import program
import section

MEASUREMENTS = program.ROOT / "docs" / "measurements"
EXAMPLES = program.ROOT / "scenes"

# Factors beyond which a forecast has missed.
GOAL = 1.5

# Copies of a sphere, on the accelerators.
COPIES = [10_000, 100_000, 1_000_000]
ACCELERATORS = ["embree", "bvh"]

MIB = 2**20


def run(command, *arguments):
    done = subprocess.run([str(command), *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, arguments))}: {done.stderr.strip()}")
    return done.stdout


def name_of(scene):
    return scene.relative_to(EXAMPLES) if scene.is_relative_to(EXAMPLES) else scene


def all_examples():
    return sorted([*EXAMPLES.glob("*.json"), *EXAMPLES.glob("paper/*.json")])


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


def jobs(scenes):
    """The scenes, and what is set of each: its own samples, or others."""
    for scene in scenes:
        value = json.loads(scene.read_text())
        samples = value.get("render", {}).get("samples", 1)
        counts = [None] if value.get("tracer") is None else [None, 8]
        for count in counts:
            if count is None or (isinstance(samples, int) and samples != count):
                yield scene, samples if count is None else count, count


def timed(command, scene, count, folder):
    """The forecast and the truth of a render, by its parts (s)."""
    more = [] if count is None else ["--samples", count]
    forecast = json.loads(run(command, "check", scene, "--json", *more))["time"]
    report = folder / "report.json"
    run(command, "render", scene, "-o", folder / "out", "--report", report, "--quiet", *more)
    took = json.loads(report.read_text())["seconds"]
    return forecast, took


def factor(forecast, took):
    return max(forecast, took) / max(min(forecast, took), 1e-9)


def time_of_copies(command):
    """The table of copies, loading, building and all; and whether a forecast has missed."""
    lines = ["| copies | accelerator | build, forecast (s) | took (s) | factor | all, forecast (s) | took (s) | factor |",
             "|---|---|---|---|---|---|---|---|"]
    factors = []
    for count in COPIES:
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            camera = {"type": "pinhole", "sensor": {"resolution": [640, 480]}}
            common = {"etendue": 1, "camera": camera, "layers": ["depth"], **copies(folder, count)}
            for accelerator in ACCELERATORS:
                scene = folder / "scene.json"
                scene.write_text(json.dumps(common | {"render": {"accel": accelerator}}))
                forecast, took = timed(command, scene, None, folder)
                build, whole = factor(forecast["build"], took["build"]), factor(forecast["total"], took["total"])
                factors.append(whole)
                lines.append(f"| {count} | `{accelerator}` | {forecast['build']:.3f} | {took['build']:.3f} | {build:.2f} | "
                             f"{forecast['total']:.2f} | {took['total']:.2f} | {whole:.2f} |")
                print(lines[-1], flush=True)
    within = sum(value <= GOAL for value in factors)
    text = f"{section.machine()}; {os.cpu_count()} processors. {within} of {len(factors)} are within a factor {GOAL} in all."
    return text + "\n\n" + "\n".join(lines)


def of_time(arguments):
    """Renders the example scenes and prints the time that was forecast beside the time that it took.

    The machine is calibrated before the first. A scene is rendered with its own samples and with others, so that what is
    forecast holds for any number. Copies of a mesh, up to a million, have a table of their own.
    """
    command = arguments.command
    scenes = arguments.scenes or all_examples()
    lines = [
        "| scene | samples | trace, forecast (s) | took (s) | factor | all, forecast (s) | took (s) | factor |",
        "|---|---|---|---|---|---|---|---|",
    ]
    factors, missed = [], []
    with tempfile.TemporaryDirectory() as cache:
        os.environ["XDG_CACHE_HOME"] = cache
        run(command, "plan", scenes[0])
        section.put(arguments.output, "copies", time_of_copies(command))
        if arguments.copies_only:
            return
        for scene, samples, count in jobs(scenes):
            with tempfile.TemporaryDirectory() as folder:
                forecast, took = timed(command, scene, count, Path(folder))
            trace = factor(forecast["trace"], took["render"])
            whole = factor(forecast["total"], took["total"])
            factors.append(whole)
            words = samples if isinstance(samples, int) else "until noise"
            if whole > GOAL:
                missed.append(f"`{name_of(scene)}` ({words} samples) by {whole:.2f}")
            line = (f"| `{name_of(scene)}` | {words} | {forecast['trace']:.2f} | {took['render']:.2f} | {trace:.2f} | "
                    f"{forecast['total']:.2f} | {took['total']:.2f} | {whole:.2f} |")
            print(line, flush=True)
            lines.append(line)
    within = sum(value <= GOAL for value in factors)
    text = (f"{section.machine()}; {os.cpu_count()} processors. {within} of {len(factors)} forecasts are within a "
            f"factor {GOAL} of the time that the render took in all")
    text += f"; missed: {', '.join(missed)}." if missed else "."
    section.put(arguments.output, "forecasts", text + "\n\n" + "\n".join(lines))


def takes_samples(scene):
    """True if `--samples` may stand in for the scene's own: there is light, and samples do not go on to an error."""
    value = json.loads(scene.read_text())
    return value.get("tracer") is not None and not isinstance(value.get("render", {}).get("samples"), dict)


def made(folder):
    """Scenes that are made here, by name: what each of the parts of a forecast is the most of."""
    camera = {"type": "pinhole", "sensor": {"resolution": [64, 48]}}
    common = {"etendue": 1, "camera": camera, "layers": ["depth"]}
    for count in COPIES:
        yield f"{count} copies", {**common, **copies(folder, count)}
    for triangles in [100_000, 1_000_000, 4_000_000]:
        objects = [{"shape": "blob", "triangles": triangles}]
        yield f"a shape of {triangles} triangles", {**common, "objects": objects}
    large = {"type": "pinhole", "sensor": {"resolution": [2000, 1500]}}
    scene = {**common, "camera": large, "objects": [{"shape": "sphere"}], "layers": ["depth", "normal", "ids"]}
    yield "a picture of 3 million pixels", scene
    small = {"type": "orbit", "count": 100}
    yield "100 frames", {**common, "objects": [{"shape": "blob", "triangles": 100_000}], "frames": small}


def held_by(command, scene, folder, more):
    """The forecast (total, and what stays in files) and the most that was held (bytes)."""
    forecast = json.loads(run(command, "check", scene, "--json", *more))["memory"]
    report = folder / "report.json"
    run(command, "render", scene, "-o", folder / "out", "--report", report, "--quiet", *more)
    value = json.loads(report.read_text())
    # Of many frames there is a report each.
    reports = value if isinstance(value, list) else [value]
    return forecast, max(report["peak_memory_bytes"] for report in reports)


def factor_of_range(forecast, held):
    """How far what was held is from the range of the forecast."""
    low, high = forecast["total"], forecast["total"] + forecast["mapped"]
    if low <= held <= high:
        return 1.0
    return max(low / held, held / high)


def of_memory(arguments):
    """Renders the example scenes and others, and prints the memory that was forecast beside the most that was held.

    What is held is the process's greatest resident set (VmHWM), program and libraries included, as the report has it;
    mapped files count as far as they are resident, so a forecast is right from its total to its total with them.
    """
    rows = []

    def add(name, scene, folder, more=()):
        forecast, held = held_by(arguments.command, scene, folder, more)
        off = factor_of_range(forecast, held)
        row = f"| {name} | {forecast['total'] / MIB:.0f} | {forecast['mapped'] / MIB:.0f} | {held / MIB:.0f} | {off:.2f} |"
        print(row, flush=True)
        rows.append((name, off, row))

    for scene in [] if arguments.made_only else arguments.scenes or all_examples():
        more = ["--samples", arguments.samples] if arguments.samples and takes_samples(scene) else []
        with tempfile.TemporaryDirectory() as folder:
            add(f"`{name_of(scene)}`", scene, Path(folder), more)
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


def main():
    parser = argparse.ArgumentParser(description=" ".join(__doc__.split()))
    tables = parser.add_subparsers(metavar="TABLE", required=True)

    def add(name, measure, page):
        one = tables.add_parser(name, help=measure.__doc__.splitlines()[0], description=inspect.cleandoc(measure.__doc__),
                                formatter_class=argparse.RawDescriptionHelpFormatter)
        one.add_argument("--output", type=Path, default=MEASUREMENTS / page, help="the page to write")
        one.add_argument("--command", type=Path, default=program.TARGET / "release" / "etendue",
                         help="the command to measure")
        one.add_argument("scenes", nargs="*", type=Path, help="instead of the example scenes")
        one.set_defaults(measure=measure)
        return one

    one = add("time", of_time, "sampling.md")
    one.add_argument("--copies-only", action="store_true", help="copies alone, without the example scenes")
    one = add("memory", of_memory, "limits.md")
    one.add_argument("--samples", type=int, help="of the example scenes with light and a count of samples, instead of their own")
    one.add_argument("--made-only", action="store_true", help="without the example scenes")
    one.add_argument("--print-only", action="store_true", help="write no page")
    arguments = parser.parse_args()
    arguments.measure(arguments)


if __name__ == "__main__":
    main()
