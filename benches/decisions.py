"""What each decision of the plan saves that a scene can overrule: as planned, against the fuller model; and what
somebody who knows the scene saves by hand beside what the plan takes by itself.

Both are rendered by the built command in turn, and the median of what the whole process takes is compared; so
are the pictures. Writes two tables into docs/measurements/sampling.md.
"""

import json
import os
import resource
import statistics
import subprocess
import tempfile
from pathlib import Path

import overrides
import program
import section

SCENES = program.ROOT / "scenes"
# A model with images, made here so that the table needs nothing else.
TEXTURED = {
    "etendue": 1,
    "camera": {"type": "pinhole", "sensor": {"resolution": [640, 480]},
               "pose": {"from": [0, 1, 3], "look_at": [0, 0, 0]}},
    "tracer": {"type": "flat"},
    "objects": [{"shape": "rectangle", "width": 40, "height": 40, "material": "stripes",
                 "transform": {"translate": [0, -1, 0], "rotate": [1, 0, 0, -90]}},
                {"shape": "sphere", "material": "stripes"}],
    "materials": {"stripes": {"type": "matte", "color": {"image": "stripes.png"}}},
}


def jobs(folder):
    """What is decided, the scene, what is set of it for both, and what overrules the decision."""
    textured = folder / "textured.json"
    textured.write_text(json.dumps(TEXTURED))
    (folder / "stripes.png").write_bytes((SCENES / "stripes.png").read_bytes())
    small = ["camera.sensor.resolution=[240,180]", "render.samples=64"]
    yield "hits of light in f32", SCENES / "paper" / "fig3.json", small, "plan.light_precision=double"
    yield "a quick build", SCENES / "first-light.json", [], "plan.build_quality=high"
    yield "hits of data in f64", SCENES / "first-light.json", [], "plan.refine=false"
    data = ["tracer=null", 'layers=["depth"]']
    yield "no images for depth alone", textured, data, "plan.textures=true"


def rendered(etendue, scene, settings, folder):
    """Seconds of a render in all, and its first array."""
    report, out = folder / "report.json", folder / "out"
    command = [etendue, "render", scene, "-o", out, "--outputs", "npy", "--report", report, "--quiet"]
    for setting in settings:
        command += ["--set", setting]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{scene}: {done.stderr.strip()}")
    arrays = sorted(out.glob("*.npy"), key=lambda path: (path.name != "picture.npy", path.name))
    import numpy as np
    return json.loads(report.read_text())["seconds"]["total"], np.load(arrays[0])


def difference(a, b):
    """The root mean square difference of two arrays, over the mean of one, where both are finite."""
    import numpy as np
    both = np.isfinite(a) & np.isfinite(b)
    mean = np.abs(a[both]).mean()
    return float(np.sqrt(np.mean((a[both] - b[both]) ** 2)) / mean) if mean > 0 else 0.0


def processor_time(etendue, scene, settings, folder):
    """Processor time of a render in all (s), of all threads."""
    path = folder / "overridden.json"
    path.write_text(json.dumps(scene))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [etendue, "render", path, "-o", folder / "out", "--outputs", "npy", "--quiet", *settings]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"{scene}: {done.stderr.strip()}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def overridden(etendue, rounds, folder):
    """The table of what the plan takes by itself beside what is overridden by hand."""
    lines = ["| what there is to save | kind | in full (s) | as the plan takes it (s) | by hand (s) | by hand saves | the plan saves | "
             "of by hand |", "|---|---|---|---|---|---|---|---|"]
    for what, exact, scene, by_hand, in_full in overrides.cases(folder, SCENES):
        # Exact savings are taken without a key, others within a tolerance.
        ways = {"full": (scene | (in_full or {}), []),
                "plan": (scene, [] if exact else ["--tolerance", overrides.TOLERANCE]),
                "hand": (scene | by_hand, [])}
        times = {way: [] for way in ways}
        for _ in range(rounds):
            for way, (spec, settings) in ways.items():
                times[way].append(processor_time(etendue, spec, settings, folder))
        full, plan, hand = (statistics.median(times[way]) for way in ("full", "plan", "hand"))
        kind = "exact" if exact else "within a tolerance"
        lines.append(f"| {what} | {kind} | {full:.2f} | {plan:.2f} | {hand:.2f} | {full / hand:.1f} times | "
                     f"{full / plan:.1f} times | {plan / hand:.2f} of its time |")
        print(lines[-1], flush=True)
    return "\n".join(lines)


def main():
    parser = program.arguments(__doc__, "measurements/sampling.md", rounds=5)
    parser.add_argument("--binary", help="the command to measure; that of the release build when absent")
    arguments = parser.parse_args()
    program.enter("decision-peers", ["numpy"])
    # Before the page is changed, which would count as a change of what was measured.
    machine = section.machine()
    etendue = arguments.binary or program.built("etendue")
    lines = ["| decided | scene | overruled by | as planned (s) | overruled (s) | overruled takes | pictures differ by |",
             "|---|---|---|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        for what, scene, both, overruled in jobs(folder):
            times, pictures = ([], []), {}
            for turn in range(arguments.rounds):
                for way in (0, 1) if turn % 2 == 0 else (1, 0):
                    settings = both + [overruled] * way
                    seconds, pictures[way] = rendered(etendue, scene, settings, folder)
                    times[way].append(seconds)
            ratio = statistics.median(times[1]) / statistics.median(times[0])
            name = scene.relative_to(SCENES) if scene.is_relative_to(SCENES) else "a floor and a ball with an image"
            name = f"`{name}`" if scene.is_relative_to(SCENES) else name
            lines.append(f"| {what} | {name} | `{overruled}` | {section.spread(times[0], 2)} | "
                         f"{section.spread(times[1], 2)} | {ratio:.2f} times as long | "
                         f"{difference(pictures[0], pictures[1]):.1e} |")
            print(lines[-1], flush=True)
    text = (f"{machine}; {os.cpu_count()} processors; medians of {arguments.rounds} turns, with the least and "
            "the greatest; of everything from the scene's text to the files.")
    section.put(arguments.output, "decisions", text + "\n\n" + "\n".join(lines))
    with tempfile.TemporaryDirectory() as folder:
        table = overridden(etendue, arguments.rounds, Path(folder))
    text = (f"{machine}; {os.cpu_count()} processors; processor time of the whole program, medians of "
            f"{arguments.rounds} turns; the tolerance is {overrides.TOLERANCE}.")
    section.put(arguments.output, "overrides", text + "\n\n" + table)


if __name__ == "__main__":
    main()
