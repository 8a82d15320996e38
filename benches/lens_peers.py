#!/usr/bin/env python3
"""Takes the same rays through the double Gauss with etendue and with optiland's numpy backend, one
thread each, and writes the section of docs/measurements/lenses.md on it.

    python3 benches/lens_peers.py [--rounds N] [--output docs/measurements/lenses.md]
"""

import json
import statistics
import subprocess
import sys
import time

import program
from section import machine, put, spread

LENS = program.ROOT / "scenes" / "lenses" / "double-gauss.json"
# Where optiland is at its best: its figures fall with smaller and with greater batches.
RAYS = 100_000


def optiland_rounds(lens, count):
    """Nanoseconds a ray, and the height at which the middle of the beam leaves."""
    import numpy as np
    from optiland.materials import IdealMaterial
    from optiland.optic import Optic
    from optiland.rays import RealRays

    optic = Optic()
    optic.add_surface(index=0, thickness=np.inf)
    elements = lens["elements"]
    for index, element in enumerate(elements, 1):
        glass = element.get("glass", {}).get("n", 1.0) if element["type"] == "surface" else 1.0
        optic.add_surface(
            index=index, radius=element.get("radius", np.inf),
            thickness=element.get("thickness", 0.0), material=IdealMaterial(glass),
            is_stop=element.get("stop", False),
        )
    optic.add_surface(index=len(elements) + 1)
    optic.set_aperture("EPD", 20)
    optic.set_field_type("angle")
    optic.add_field(y=0)
    optic.add_wavelength(0.58756, is_primary=True)
    place = np.arange(RAYS) + 0.5
    r, turn = 10 * np.sqrt(place / RAYS), 2.399963229728653 * place
    slope = 0.02 / np.hypot(1, 0.02)
    ones, zeros = np.ones(RAYS), np.zeros(RAYS)
    rounds = []
    # The first round compiles, and does not count.
    for _ in range(count + 1):
        rays = RealRays(
            r * np.cos(turn), r * np.sin(turn), -10 * ones, zeros, slope * ones,
            np.sqrt(1 - slope**2) * ones, ones, 0.58756 * ones,
        )
        start = time.thread_time()
        optic.surface_group.trace(rays)
        rounds.append((time.thread_time() - start) * 1e9 / RAYS)
    if not np.isfinite(rays.x).all():
        raise SystemExit("optiland lost rays: the comparison is void")
    return rounds[1:]


def main():
    arguments = program.arguments(__doc__, "measurements/lenses.md", rounds=9).parse_args()
    # One thread against one thread.
    program.enter("lens-peers", ["optiland==0.6.3"], OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
    lens = json.loads(LENS.read_text())
    out = subprocess.run(
        [program.built("examples/trace_lens"), LENS, str(arguments.rounds)], check=True,
        capture_output=True, text=True,
    )
    ours = json.loads(out.stdout)
    ns, surfaces = ours["ns"], ours["surfaces"]
    median = {name: statistics.median(rounds) for name, rounds in ns.items()}
    rows = [
        ("in batches, widest registers", ns["widest"]),
        ("in batches, four lanes (AVX2)", ns["four"]),
        ("in batches, as compiled (SSE2)", ns["baseline"]),
        ("ray by ray, the same arithmetic", ns["singly"]),
    ]
    try:
        rows.append(("optiland 0.6.3, numpy (conics compiled by numba)", optiland_rounds(lens, arguments.rounds)))
    except ImportError as error:
        print(f"optiland is left out: {error}", file=sys.stderr)
    best = median["widest"]
    text = [
        f"`make bench-lens` writes this section. {lens['name']}: {surfaces} spheres and a stop; all",
        "checks on, f64, one thread; rays 1° off the axis, all of which pass. etendue takes 512 rays",
        f"at a time, optiland {RAYS}. Processor time of the thread; medians of {arguments.rounds} rounds, with",
        "the least and the greatest.",
        f"Machine: {machine()}.",
        "",
        "| | ns a ray | million rays/s | times etendue's |",
        "|---|---|---|---|",
    ]
    for name, rounds in rows:
        middle = statistics.median(rounds)
        text.append(f"| {name} | {spread(rounds)} | {1e3 / middle:.2f} | {middle / best:.2f} |")
    goals = [("million rays/s", 1e3 / best, 20.0)]
    goals.append(("ray by ray over batches on AVX2", median["singly"] / median["four"], 4.0))
    if len(rows) > 4:
        goals.append(("optiland over etendue", statistics.median(rows[4][1]) / best, 20.0))
    text += ["", "| goal | at least | measured | |", "|---|---|---|---|"]
    for name, value, least in goals:
        text.append(
            f"| {name} | {least:.0f} | {value:.1f} | {'met' if value >= least else '**missed**'} |"
        )
    share = median["roots"] / best
    text += [
        "",
        f"The bound: a sphere takes two square roots and a division. {2 * surfaces} roots and "
        f"{surfaces} divisions in the same blocks and",
        f"registers, and nothing else, take {spread(ns['roots'])} ns a ray, {100 * share:.0f} % of "
        f"the whole; filling a batch takes {median['copy']:.1f} ns.",
        "The rest is multiplications, additions and comparisons. A block of 32 rays goes through all",
        "elements before the next one begins, so rays stay in the nearest cache.",
    ]
    put(arguments.output, "bench-lens", "\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()
