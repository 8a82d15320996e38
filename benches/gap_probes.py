"""Measures what it takes to find the thinnest gap that light goes through, beside reading the scene.

`etendue plan` of a body of glass of a million triangles, from a GLB and as a shape that is made, with
`plan.light_precision` `auto`, which looks for the distances between surfaces, and `double`, which does not: the
difference is the probes', structure to probe through included, and `double` is what reading takes. Processor time,
the least of some rounds. The table goes into docs/measurements/costs.md. `--command` and `--benchmarks` name other builds than the
release ones.
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
BUILT = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"


def seconds(*command):
    """Processor time of a command (s)."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise SystemExit(done.stderr.strip())
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def scenes(folder, benchmarks, triangles):
    """Scene files by name."""
    camera = {"type": "pinhole", "pose": {"from": [0, 0, 4], "look_at": [0, 0, 0]}, "sensor": {"resolution": [16, 16]}}
    common = {"etendue": 1, "camera": camera, "tracer": {"type": "path"}, "render": {"samples": 1}}
    common["materials"] = {"glass": {"type": "dielectric"}}
    seconds(benchmarks, "models", folder, "--triangles", triangles, "--formats", "glb")
    model = next(folder.glob("*.glb"))
    for name, one in [("a GLB", {"file": model.name}), ("a shape", {"shape": "blob", "triangles": triangles})]:
        path = folder / "scene.json"
        path.write_text(json.dumps({**common, "objects": [{**one, "material": "glass"}]}))
        yield name, path


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "measurements" / "costs.md")
    parser.add_argument("--command", type=Path, default=BUILT / "etendue")
    parser.add_argument("--benchmarks", type=Path, default=BUILT / "benchmarks")
    parser.add_argument("--triangles", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--print-only", action="store_true", help="write no page")
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, path in scenes(Path(folder), arguments.benchmarks, arguments.triangles):

            def least(precision):
                plan = [arguments.command, "plan", path, "--set", f"plan.light_precision={precision}"]
                return min(seconds(*plan) for _ in range(arguments.rounds))

            with_probes, without = least("auto"), least("double")
            probes = with_probes - without
            row = f"| {name} | {without:.2f} | {probes:.2f} | {probes / without:.2f} |"
            print(row, flush=True)
            rows.append(row)
    head = [
        f"| {arguments.triangles:,} triangles | reading (s) | gaps (s) | over reading |",
        "|---|---|---|---|",
    ]
    if not arguments.print_only:
        text = f"{section.machine()}; the least of {arguments.rounds} rounds, processor time."
        section.put(arguments.output, "gaps", text + "\n\n" + "\n".join([*head, *rows]))


if __name__ == "__main__":
    main()
