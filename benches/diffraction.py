"""Renders with and without diffraction in turn, and prints what waves cost beside rays; times a lens' report in waves.

A picture's time is the processor time of a whole command, without data files. Of each pair the ratio is taken, and of five
pairs the median. The table goes into docs/measurements/costs.md. `--command` names another build than the release one.
"""

import argparse
import os
import resource
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import section

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "etendue"

# How much longer a picture may take, and how long a report (s).
GOAL, REPORT = 1.5, 2.0

# What is rendered: a scene, its samples, and what it shows.
PICTURES = [
    ("slanted-edge.json", 72, "one depth, 240 × 180 pixels, double Gauss at f/2.8"),
    ("gallery/starburst.json", None, "lamps at three depths, ideal lens with six blades"),
    ("gallery/coded-aperture-stopped.json", None, "many depths, a mask in the stop"),
]


def seconds(arguments):
    """Processor time and wall time (s) of a command."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run(arguments, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return used, time.monotonic() - begin


def main():
    parser = argparse.ArgumentParser(description=" ".join(__doc__.split("\n\n")[0].split()))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--command", type=Path, default=COMMAND)
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "measurements" / "costs.md")
    parser.add_argument("--only", help="a part of the names of the scenes that are rendered")
    options = parser.parse_args()
    rows, missed = [], False
    with tempfile.TemporaryDirectory() as folder:
        for name, samples, what in PICTURES:
            if options.only and options.only not in name:
                continue
            pairs = []
            for _ in range(options.rounds):
                pair = []
                for is_on in ("true", "false"):
                    more = [f"--set=render.samples={samples}"] if samples else []
                    words = ["render", str(ROOT / "scenes" / name), "-o", folder, "--outputs", "png", "--quiet"]
                    pair.append(seconds([str(options.command), *words, f"--set=camera.diffraction={is_on}", *more])[0])
                pairs.append(pair)
            on, off = ([pair[k] for pair in pairs] for k in (0, 1))
            ratio = statistics.median(a / b for a, b in pairs)
            missed |= ratio > GOAL
            verdict = "met" if ratio <= GOAL else "**missed**"
            rows.append(f"| `{name}` ({what}) | {section.spread(on)} | {section.spread(off)} | {ratio:.2f} | {verdict} |")
            print(rows[-1])
        times = []
        for _ in range(options.rounds):
            lens = str(ROOT / "scenes" / "lenses" / "double-gauss.json")
            times.append(seconds([str(options.command), "lens", lens, "--report", f"{folder}/report.html", "--quiet"]))
    used, wall = zip(*times)
    verdict = "met" if statistics.median(wall) <= REPORT else "**missed**"
    text = [
        f"`make bench-diffraction` writes this section: processor time (s), medians of {options.rounds} with the least and",
        f"the greatest; the ratio is the median of the pairs'. At most {GOAL} is the goal. {options.command.parent.name.capitalize()} build.",
        f"{section.machine()}.",
        "",
        "| scene | with waves | with rays | ratio | |",
        "|---|---|---|---|---|",
        *rows,
        "",
        "`etendue lens scenes/lenses/double-gauss.json --report` (f/2, four fields, three wavelengths) takes "
        f"{section.spread(wall, 2)} s, {section.spread(used, 2)} s of processors; {REPORT:g} s is the goal: {verdict}.",
    ]
    section.put(options.page, "diffraction", "\n".join(text))
    print("\n".join(text[-2:]))
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())
