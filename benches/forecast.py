"""Renders the example scenes and prints the time that was forecast beside the time that it took.

Each scene is planned and rendered by the built command, in a folder of its own that goes when it is done;
the machine is calibrated before the first. A scene is rendered with its own samples and with others, so that
what is forecast holds for any number. Copies of a mesh, up to a million, have a table of their own. Both go into
docs/measurements/sampling.md.
"""

import argparse
import json
import os
import subprocess
import tempfile
from pathlib import Path

import memory
import section

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "etendue"

# Factors beyond which a forecast has missed.
GOAL = 1.5

# Copies of a sphere, on the accelerators.
COPIES = [10_000, 100_000, 1_000_000]
ACCELERATORS = ["embree", "bvh"]


def run(*command):
    done = subprocess.run([str(COMMAND), *map(str, command)], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout


def jobs(scenes):
    """The scenes, and what is set of each: its own samples, or others."""
    for scene in scenes:
        value = json.loads(scene.read_text())
        samples = value.get("render", {}).get("samples", 1)
        counts = [None] if value.get("tracer") is None else [None, 8]
        for count in counts:
            if count is None or (isinstance(samples, int) and samples != count):
                yield scene, samples if count is None else count, count


def row(scene, count, folder):
    """The forecast and the truth of a render, by stage (s)."""
    more = [] if count is None else ["--samples", count]
    forecast = json.loads(run("check", scene, "--json", *more))["time"]
    report = folder / "report.json"
    run("render", scene, "-o", folder / "out", "--report", report, "--quiet", *more)
    took = json.loads(report.read_text())["seconds"]
    return forecast, took


def factor(forecast, took):
    return max(forecast, took) / max(min(forecast, took), 1e-9)


def of_copies():
    """The table of copies, loading, building and all; and whether a forecast has missed."""
    lines = ["| copies | accelerator | build, forecast (s) | took (s) | factor | all, forecast (s) | took (s) | factor |",
             "|---|---|---|---|---|---|---|---|"]
    factors = []
    for count in COPIES:
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            camera = {"type": "pinhole", "sensor": {"resolution": [640, 480]}}
            common = {"etendue": 1, "camera": camera, "layers": ["depth"], **memory.copies(folder, count)}
            for accelerator in ACCELERATORS:
                scene = folder / "scene.json"
                scene.write_text(json.dumps(common | {"render": {"accel": accelerator}}))
                forecast, took = row(scene, None, folder)
                build, whole = factor(forecast["build"], took["build"]), factor(forecast["total"], took["total"])
                factors.append(whole)
                lines.append(f"| {count} | `{accelerator}` | {forecast['build']:.3f} | {took['build']:.3f} | {build:.2f} | "
                             f"{forecast['total']:.2f} | {took['total']:.2f} | {whole:.2f} |")
                print(lines[-1], flush=True)
    within = sum(value <= GOAL for value in factors)
    text = f"{section.machine()}; {os.cpu_count()} processors. {within} of {len(factors)} are within a factor {GOAL} in all."
    return text + "\n\n" + "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "measurements" / "sampling.md")
    parser.add_argument("--copies-only", action="store_true", help="copies alone, without the example scenes")
    parser.add_argument("scenes", nargs="*", type=Path)
    arguments = parser.parse_args()
    examples = ROOT / "scenes"
    scenes = arguments.scenes or sorted([*examples.glob("*.json"), *examples.glob("paper/*.json")])
    lines = [
        "| scene | samples | trace, forecast (s) | took (s) | factor | all, forecast (s) | took (s) | factor |",
        "|---|---|---|---|---|---|---|---|",
    ]
    factors, missed = [], []
    with tempfile.TemporaryDirectory() as cache:
        os.environ["XDG_CACHE_HOME"] = cache
        run("plan", scenes[0])
        section.put(arguments.output, "copies", of_copies())
        if arguments.copies_only:
            return
        for scene, samples, count in jobs(scenes):
            with tempfile.TemporaryDirectory() as folder:
                forecast, took = row(scene, count, Path(folder))
            trace = factor(forecast["trace"], took["render"])
            whole = factor(forecast["total"], took["total"])
            factors.append(whole)
            name = scene.relative_to(examples) if scene.is_relative_to(examples) else scene
            words = samples if isinstance(samples, int) else "until noise"
            if whole > GOAL:
                missed.append(f"`{name}` ({words} samples) by {whole:.2f}")
            line = (f"| `{name}` | {words} | {forecast['trace']:.2f} | {took['render']:.2f} | {trace:.2f} | "
                    f"{forecast['total']:.2f} | {took['total']:.2f} | {whole:.2f} |")
            print(line, flush=True)
            lines.append(line)
    within = sum(value <= GOAL for value in factors)
    text = (f"{section.machine()}; {os.cpu_count()} processors. {within} of {len(factors)} forecasts are within a "
            f"factor {GOAL} of the time that the render took in all")
    text += f"; missed: {', '.join(missed)}." if missed else "."
    section.put(arguments.output, "forecasts", text + "\n\n" + "\n".join(lines))


if __name__ == "__main__":
    main()
