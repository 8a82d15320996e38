"""What one feature costs, by commands of a built etendue: `costs.py TABLE` measures it, and puts its table into a page of
docs/measurements. `costs.py TABLE --help` has its options.

Times are processor times of whole processes. What counts of a picture's samples alone is the time of a render of many
less that of one of few, so that start, models, structures and camera do not.
"""

import argparse
import inspect
import json
import resource
import statistics
import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import cost_scenes
import program
import section

MEASUREMENTS = program.ROOT / "docs" / "measurements"
BUILT = program.TARGET / "release"


class Spent(NamedTuple):
    """What a command took (s): processor time of the program, that of the system for it, and time on the clock."""

    user: float
    system: float
    clock: float

    @property
    def processor(self):
        return self.user + self.system


def run(*words, accepted=(0,)):
    """What a command took, its exit code, which is one of those that are accepted, and what it printed."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    clock = time.monotonic() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in accepted:
        raise SystemExit(f"{' '.join(map(str, words))}: {done.stderr.strip()}")
    spent = Spent(after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime, clock)
    return spent, done.returncode, done.stdout


def written(folder, spec):
    """The path of a scene, as a file."""
    path = folder / "scene.json"
    path.write_text(json.dumps(spec))
    return path


def verdict(value, goal):
    return "met" if value <= goal else "**missed**"


def shown(row):
    """A row of a table, printed as soon as it is measured."""
    print(row, flush=True)
    return row


def samples_time(arguments, spec, settings, folder):
    """Processor time (s) of the samples between the two renders of a scene."""
    times = []
    for samples in arguments.samples:
        path = written(folder, spec | {"render": {"samples": samples}})
        words = ["render", path, "-o", folder / "out", "--outputs", "exr", "--quiet", *settings]
        times.append(run(arguments.command, *words)[0].user)
    few, many = times
    return many - few


# Seconds of processor time that no camera with such an asphere may take.
ASPHERE_GOAL = 2.0
# The power of the distance from the axis, and its coefficients (in mm); one of each is a wall at the rim of 8 mm, the
# other one within it.
TERMS = [
    (4, [1.0, 1e-3]),
    (8, [1e-3, 1e-6]),
    (16, [1e-10, 1e-14]),
    (30, [1e-15, 1e-22]),
    (30, [1e-26, -1e-22]),
]


def aspheres(arguments, folder):
    """What setting a camera up takes behind aspheres that are walls within their clear aperture: 96 pixels, one thread.

    A stop in front, an asphere of one term, and a spherical surface: rays that are aimed at such a lens cross the asphere
    many times or not at all, so that nearly every ray by which its pupil is measured is searched for.
    """
    rows, worst = [], 0.0
    for order, coefficient in [(order, each) for order, coefficients in TERMS for each in coefficients]:
        path = written(folder, cost_scenes.asphere(order, coefficient))
        taken = []
        for _ in range(arguments.rounds):
            words = ["render", path, "-o", folder / "out", "--quiet", "--threads", 1]
            spent, code, _ = run(arguments.command, *words, accepted=(0, 2))
            taken.append((spent.processor, "a picture" if code == 0 else "refused: no light passes"))
        least, outcome = min(taken)
        worst = max(worst, least)
        rows.append(shown(f"| {order} | {coefficient:g} | {least:.2f} | {outcome} |"))
    reached = "which all meet" if worst <= ASPHERE_GOAL else f"missed: {worst:.2f} s at worst"
    text = f"{section.machine()}; one thread, the least of {arguments.rounds} rounds. The goal is {ASPHERE_GOAL:g} s, {reached}."
    head = ["| power | coefficient (mm) | processor time (s) | what comes of it |", "|---|---|---|---|"]
    yield "aspheres", [text, "", *head, *rows]


# How much more a ray that survives a mask may cost than through the open stop.
MASK_GOAL = 1.5
# Samples a pixel of the two renders whose difference counts.
FEW, MANY = 16, 144


def masks(arguments, folder):
    """What a ray costs that survives a mask of small openings in or behind a double Gauss, over one through the open stop.

    The processor time is that of the samples between two renders, over the rays that leave the lens towards the scene
    (`rays` of the report); each is the least of some rounds.
    """
    rows = []

    def add(name, mask, is_behind):
        path = written(folder, cost_scenes.masked(mask, is_behind))
        each, share = cost_of_ray(arguments, path, folder)
        ratio = each / rows[0][1] if rows else 1.0
        rows.append((name, each, ratio, shown(f"| {name} | {100 * share:.1f} | {each:.2f} | {ratio:.2f} |")))

    add("the open stop", None, False)
    for name, values in cost_scenes.masks():
        cost_scenes.png(folder / "mask.png", values)
        add(f"{name}, in the stop", "mask.png", False)
    cost_scenes.png(folder / "mask.png", dict(cost_scenes.masks())["12 pixels of 256 × 256"])
    add("12 pixels of 256 × 256, 2 mm behind the lens", "mask.png", True)
    missed = [f"{name} by {ratio / MASK_GOAL:.2f}" for name, _, ratio, _ in rows if ratio > MASK_GOAL]
    text = (f"{section.machine()}; one thread, the least of {arguments.rounds} rounds. The goal is at most {MASK_GOAL} "
            "times the open stop's")
    text += f"; missed: {', '.join(missed)}." if missed else ", which all meet."
    head = ["| opening | rays that get through (%) | time a ray that does (µs) | over the open stop's |", "|---|---|---|---|"]
    yield "masks", [text, "", *head, *(row for *_, row in rows)]


def cost_of_ray(arguments, path, folder):
    """Processor time a surviving ray (µs), and the share that survives."""

    def rendered(samples):
        report = folder / "report.json"
        words = ["render", path, "-o", folder / "out", "--report", report, "--quiet", "--threads", 1, "--samples", samples]
        spent, _, _ = run(arguments.command, *words)
        counts = json.loads(report.read_text())
        return spent.user, counts["rays"], counts["lens_rays"]

    few = [rendered(FEW) for _ in range(arguments.rounds)]
    many = [rendered(MANY) for _ in range(arguments.rounds)]
    seconds = min(spent for spent, *_ in many) - min(spent for spent, *_ in few)
    survive, aimed = (many[0][i] - few[0][i] for i in (1, 2))
    return 1e6 * seconds / survive, survive / aimed


# How much longer a picture with diffraction may take, and how long a report (s).
DIFFRACTION_GOAL, REPORT_GOAL = 1.5, 2.0
# What is rendered: a scene, its samples, and what it shows.
PICTURES = [
    ("slanted-edge.json", 72, "one depth, 240 × 180 pixels, double Gauss at f/2.8"),
    ("gallery/starburst.json", None, "lamps at three depths, ideal lens with six blades"),
    ("gallery/coded-aperture-stopped.json", None, "many depths, a mask in the stop"),
]


def diffraction(arguments, folder):
    """What waves in the picture cost over rays, and how long a lens' report in waves takes.

    A picture's time is the processor time of a whole command, without data files. Of each pair the ratio is taken, and of
    five pairs the median. The exit code is 1 where the goal is missed.
    """
    rows, missed = [], False
    for name, samples, what in PICTURES:
        if arguments.only and arguments.only not in name:
            continue
        times = {"true": [], "false": []}
        for _ in range(arguments.rounds):
            for is_on, found in times.items():
                more = [f"--set=render.samples={samples}"] if samples else []
                words = ["render", program.ROOT / "scenes" / name, "-o", folder, "--outputs", "png", "--quiet"]
                found.append(run(arguments.command, *words, f"--set=camera.diffraction={is_on}", *more)[0].processor)
        on, off = times.values()
        ratio = statistics.median(a / b for a, b in zip(on, off))
        missed |= ratio > DIFFRACTION_GOAL
        rows.append(shown(f"| `{name}` ({what}) | {section.spread(on)} | {section.spread(off)} | {ratio:.2f} | "
                          f"{verdict(ratio, DIFFRACTION_GOAL)} |"))
    words = ["lens", cost_scenes.LENSES / "double-gauss.json", "--report", folder / "report.html", "--quiet"]
    reports = [run(arguments.command, *words)[0] for _ in range(arguments.rounds)]
    used, clock = [one.processor for one in reports], [one.clock for one in reports]
    yield "diffraction", [
        f"`make bench-diffraction` writes this section: processor time (s), medians of {arguments.rounds} with the least and",
        f"the greatest; the ratio is the median of the pairs'. At most {DIFFRACTION_GOAL} is the goal. "
        f"{arguments.command.parent.name.capitalize()} build.",
        f"{section.machine()}.",
        "",
        "| scene | with waves | with rays | ratio | |",
        "|---|---|---|---|---|",
        *rows,
        "",
        shown("`etendue lens scenes/lenses/double-gauss.json --report` (f/2, four fields, three wavelengths) takes "
              f"{section.spread(clock, 2)} s, {section.spread(used, 2)} s of processors; {REPORT_GOAL:g} s is the goal: "
              f"{verdict(statistics.median(clock), REPORT_GOAL)}."),
    ]
    return missed


# Numbers of bands, and how many times as long as a pinhole the lens may take.
LENS_GOALS = {3: 1.6, 8: 1.8, 31: 2.0}
# Numbers of bands, and how many times as long as red, green and blue they may take.
BANDS_GOALS = {8: 1.2, 31: 1.6}


def bands(arguments, folder):
    """How many times as long a room takes in more bands, and through a lens: through a pinhole in 8 and 31 bands against
    red, green and blue, and through a double Gauss against a pinhole with as many bands.

    Both are rendered in turn, and the median of the processor time of all rounds is compared: with the paths of the scene
    shared by the bands, and with each band traced by itself.
    """
    about = (f"{section.machine()}; a room, paths of five bounces, {arguments.side} × {arguments.side} pixels, "
             f"{arguments.samples[1] - arguments.samples[0]} samples, the median of {arguments.rounds} rounds.")
    for part, measure in [("bands", of_bands), ("lens", of_lens)]:
        if arguments.only in (None, part):
            yield part, [about, "", *measure(arguments, folder)]


def of_bands(arguments, folder):
    """The table of bands against red, green and blue."""
    times = {count: [] for count in (3, *BANDS_GOALS)}
    for _ in range(arguments.rounds):
        for count, found in times.items():
            found.append(samples_time(arguments, cost_scenes.banded(False, count, arguments.side), [], folder))
    middle = {count: statistics.median(found) for count, found in times.items()}
    lines = ["| bands | times red, green and blue | goal | |", "|---|---|---|---|"]
    for count, goal in BANDS_GOALS.items():
        ratio = middle[count] / middle[3]
        lines.append(shown(f"| {count} | {ratio:.2f} | {goal} | {verdict(ratio, goal)} |"))
    return lines


def of_lens(arguments, folder):
    """The table of a lens against a pinhole."""
    apart = ["--set", "plan.shared_paths=false"]
    ways = {"pinhole": (False, []), "shared": (True, []), "apart": (True, apart)}
    lines = ["| bands | paths shared, times a pinhole | goal | | each band by itself |", "|---|---|---|---|---|"]
    for count, goal in LENS_GOALS.items():
        times = {way: [] for way in ways}
        for _ in range(arguments.rounds):
            for way, (lens, settings) in ways.items():
                spec = cost_scenes.banded(lens, count, arguments.side)
                times[way].append(samples_time(arguments, spec, settings, folder))
        middle = {way: statistics.median(found) for way, found in times.items()}
        shared, by_itself = (middle[way] / middle["pinhole"] for way in ("shared", "apart"))
        lines.append(shown(f"| {count} | {shared:.2f} | {goal} | {verdict(shared, goal)} | {by_itself:.2f} |"))
    return lines


# What is compared: its name, what it is compared with, and how many times as long it may take, where that is a goal.
COMPARED = [("a shutter, nothing moves", "still", 1.01), ("the camera moves", "still", 1.15),
            ("12 copies move", "12 copies stand", None), ("a morph of 7200 triangles plays", "it stands in its moment", None)]
# How many times as long as Embree's ratio ours may be.
EMBREE_GOAL = 1.1


def motion(arguments, folder):
    """How many times as long a sample takes in a room with a shutter, with a camera that moves, with moving copies and with
    a mesh that changes its shape, as in the same room standing still.

    All are rendered in turn, and the median of the ratios of all rounds counts. A second table has what motion costs the
    caster of rays alone, and Embree's own motion blur of the same things on the same rays (`benches/src/bin/motion.rs`);
    the program `motion` is looked for in the folder of the command.
    """
    scenes = cost_scenes.moving(arguments.side)
    times = {name: [] for name in scenes}
    cost_scenes.sheet(folder)
    for _ in range(arguments.rounds):
        for name, spec in scenes.items():
            times[name].append(samples_time(arguments, spec, [], folder))
    few, many = arguments.samples
    lines = [f"`make bench-time ARGS=\"--rounds {arguments.rounds} --side {arguments.side} --samples {few} {many}\"`: "
             f"{section.machine()}; a room, paths of five bounces, {arguments.side} × {arguments.side} pixels, "
             f"{many - few} samples; median of the rounds, with the least and the greatest.", "",
             "| | beside | times as long a sample | goal |", "|---|---|---|---|"]
    for name, reference, goal in COMPARED:
        ratios = [a / b for a, b in zip(times[name], times[reference])]
        reached = "" if goal is None else f"{goal}, {verdict(statistics.median(ratios), goal)}"
        lines.append(shown(f"| {name} | {reference} | {section.spread(ratios, 2)} | {reached} |"))
    lines += ["", "What motion costs the caster of rays alone, and Embree's own motion blur of the same things on the same "
              "rays, each beside its own time where all stands still:", "", *of_caster(arguments, scenes, folder)]
    yield "motion", lines


def of_caster(arguments, scenes, folder):
    """The table of what motion costs the caster of rays, and Embree's own motion blur."""
    lines = ["| moves | rays | ours | Embree's own | ours over Embree's | goal |", "|---|---|---|---|---|---|"]
    for name, reference, _ in COMPARED[2:]:
        paths = [folder / "still.json", folder / "moving.json"]
        for path, key in zip(paths, [reference, name]):
            path.write_text(json.dumps(scenes[key]))
        _, _, output = run(arguments.command.parent / "motion", arguments.rounds, *paths)
        for line in output.splitlines():
            rays, ours, theirs = json.loads(line)
            ratios = [a / b for a, b in zip(ours, theirs)]
            reached = f"{EMBREE_GOAL}, {verdict(statistics.median(ratios), EMBREE_GOAL)}"
            lines.append(shown(f"| {name} | {rays} | {section.spread(ours, 2)} | {section.spread(theirs, 2)} | "
                               f"{section.spread(ratios, 2)} | {reached} |"))
    return lines


def gaps(arguments, folder):
    """What it takes to find the thinnest gap that light goes through, over reading the scene.

    `etendue plan` of a body of glass of a million triangles, from a GLB and as a shape that is made, with
    `plan.light_precision` `auto`, which looks for the distances between surfaces, and `double`, which does not: the
    difference is the probes', structure to probe through included, and `double` is what reading takes. Processor time,
    the least of some rounds.
    """
    run(arguments.benchmarks, "models", folder, "--triangles", arguments.triangles, "--formats", "glb")
    model = next(folder.glob("*.glb"))
    bodies = [("a GLB", {"file": model.name}), ("a shape", {"shape": "blob", "triangles": arguments.triangles})]
    rows = []
    for name, body in bodies:
        path = written(folder, cost_scenes.glass(body))

        def least(precision):
            plan = [arguments.command, "plan", path, "--set", f"plan.light_precision={precision}"]
            return min(run(*plan)[0].processor for _ in range(arguments.rounds))

        with_probes, without = least("auto"), least("double")
        probes = with_probes - without
        rows.append(shown(f"| {name} | {without:.2f} | {probes:.2f} | {probes / without:.2f} |"))
    text = f"{section.machine()}; the least of {arguments.rounds} rounds, processor time."
    head = [f"| {arguments.triangles:,} triangles | reading (s) | gaps (s) | over reading |", "|---|---|---|---|"]
    yield "gaps", [text, "", *head, *rows]


def parsed():
    """The words of the command line, among them what measures the table."""
    parser = argparse.ArgumentParser(description=" ".join(__doc__.split("\n\n")[0].split()))
    tables = parser.add_subparsers(dest="table", metavar="TABLE", required=True)

    def add(name, measure, page, rounds):
        about = " ".join(measure.__doc__.split("\n\n")[0].split())
        one = tables.add_parser(name, help=about, description=inspect.cleandoc(measure.__doc__),
                                formatter_class=argparse.RawDescriptionHelpFormatter)
        one.add_argument("--command", type=Path, default=BUILT / "etendue", help="the command to measure")
        one.add_argument("--rounds", type=int, default=rounds, help="times that each is measured")
        one.add_argument("--output", type=Path, default=MEASUREMENTS / page, help="the page to write")
        one.add_argument("--print-only", action="store_true", help="write no page")
        one.set_defaults(measure=measure)
        return one

    def add_samples(one):
        one.add_argument("--side", type=int, default=128, help="pixels a side")
        one.add_argument("--samples", type=int, nargs=2, default=[4, 68], help="those of the two renders")

    add("aspheres", aspheres, "limits.md", 3)
    add("masks", masks, "costs.md", 3)
    one = add("diffraction", diffraction, "costs.md", 5)
    one.add_argument("--only", help="a part of the names of the scenes that are rendered")
    one = add("bands", bands, "costs.md", 5)
    one.add_argument("--only", choices=["bands", "lens"], help="one of the two")
    add_samples(one)
    add_samples(add("time", motion, "costs.md", 5))
    one = add("gaps", gaps, "costs.md", 5)
    one.add_argument("--benchmarks", type=Path, default=BUILT / "benchmarks", help="the program that makes models")
    one.add_argument("--triangles", type=int, default=1_000_000)
    return parser.parse_args()


def main():
    arguments = parsed()
    with tempfile.TemporaryDirectory() as folder:
        missed = write_sections(arguments, Path(folder))
    return 1 if missed else 0


def write_sections(arguments, folder):
    """Puts each section into the page as soon as it is measured; True if what is measured says that it missed its goal."""
    sections = arguments.measure(arguments, folder)
    while True:
        try:
            name, lines = next(sections)
        except StopIteration as end:
            return end.value
        if arguments.print_only:
            print("\n".join(lines))
        else:
            section.put(arguments.output, name, "\n".join(lines))


if __name__ == "__main__":
    raise SystemExit(main())
