#!/usr/bin/env python3
"""Light in etendue and in Mitsuba 3, in one run, taking turns.

    python3 benches/light_peers.py [--rounds N] [--output docs/measurements/benchmarks-light.md]
    python3 benches/light_peers.py --against ETENDUE [--rounds N] [--jobs JOB ...]

The second form times another build of the command in place of Mitsuba, and prints what it finds.

The jobs: a matte blob of a million triangles through a thin lens, 512 x 512 pixels of 64 samples,
under a point light and under a square lamp, by direct light, and under the lamp by paths of five
bounces; the scenes of `light_scenes.py`, 256 x 256 pixels of 64 samples; and a room through the traced
lenses of a double Gauss beside the same through a pinhole. Timed is
tracing alone, from a built structure to pixels, on the processor's clock, all threads together, which
other processes disturb less than they do the wall's: for etendue what a run of twice as many samples
takes beyond a plain one, for Mitsuba `render` of a loaded scene, once warmed up.

How noisy a picture is: the variance of each pixel over renders of different seeds, relative to the mean;
of the pixels the root mean square of the calmest 99 in 100, and the median. The edges of lamps that are seen
and sparkles, which are few, rule a plain mean square: it is not the same for two sets of seeds. Where the
noise differs, time times its square is the cost of one error.

The bound: `benchmarks light-rays` has the same picture rendered with a clock around the accelerator.
"""

import json
import os
import re
import resource
import shutil
import statistics
import subprocess
import tempfile
import textwrap
import time
from pathlib import Path

import light_scenes
import program

SIDE, SAMPLES = 512, 64
CAMERA = {"from": [0.7, 0.9, 2.6], "look_at": [0, 0, 0], "fov": 42.0, "focal_length": 50.0,
          "f_number": 2.8, "focus": 1.9}
COLOR = [0.8, 0.4, 0.3]
POINT = {"at": [1.0, 2.0, 1.5], "intensity": 8.0}
# A square of one metre, centred and turned towards the blob.
LAMP = {"at": [1.0, 2.0, 1.5], "radiance": 6.0, "side": 1.0}
JOBS = {
    "direct, point light": ("point", 1),
    "direct, area light": ("area", 1),
    "path, area light": ("area", 5),
}
# By its best sampler at a job Mitsuba is compared.
SAMPLERS = ["multijitter", "ldsampler"]
VARIANT = "llvm_ad_rgb"
# Of each job with a peer the goals: at the same samples, and at one error.
GOALS = {"direct, point light": (2.0, 3.0), "direct, area light": (2.0, 3.0),
         "path, area light": (1.2, 1.5)}
# Of all pixels the calmest, of which the noise is told.
CALMEST = 0.99
GOALS |= {job: goals for job, (_, *goals) in light_scenes.JOBS.items()}
LENS = "Cornell box, path of 5 bounces, through the double Gauss"
# The same with rays of all bands together, as at the design wavelength (`plan.dispersion`).
SHARED = f"{LENS}, without dispersion"
ALL = [*GOALS, LENS, SHARED]
LENS_GOAL = 1.6
# What the code does, by words in the symbols of a profile: the first that fits counts.
STAGES = {
    "accelerator": "libembree|libtbb|etendue_accel",
    "random numbers": "sobol|sampler::",
    "camera": "etendue_camera|etendue_optics",
    "sums of pixels": "etendue_render",
    "skies": "trace::sky|environment|GridDistribution|EnvironmentSampler",
    "lights": "trace::lamps|trace::choose|light_tree|light_sampler|etendue_tracer::lights",
    "rough, smooth and layered surfaces": "trace::facets|trace::single|etendue_tracer::bsdf",
    "textures": "texture|etendue_image|footprint|trace::varied|SurfacePoint",
    "steps of paths": "etendue_tracer|etendue_geometry::block",
}


def lamp_rows():
    """Where the lamp stands: rows of the matrix that turns +z of a square at the blob."""
    import numpy as np

    at = np.array(LAMP["at"])
    z = -at / np.linalg.norm(at)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, np.cross(z, x), z, at
    return matrix


def scene(job, model):
    """The job as a scene of etendue."""
    light, bounces = JOBS[job]
    objects = [{"file": model, "material": "clay"}]
    materials = {"clay": {"type": "matte", "color": COLOR}}
    lights = []
    if light == "point":
        lights.append({"type": "point", "at": POINT["at"], "intensity": [POINT["intensity"]] * 3})
    else:
        objects.append({"shape": "rectangle", "width": LAMP["side"], "height": LAMP["side"],
                        "material": "lamp", "transform": {"matrix": lamp_rows().tolist()}})
        materials["lamp"] = {"type": "emissive", "radiance": [LAMP["radiance"]] * 3}
    tracer = {"type": "direct"} if bounces == 1 else {"type": "path", "max_bounces": bounces}
    return {
        "etendue": 1,
        "camera": {
            "type": "thin_lens", "focal_length": CAMERA["focal_length"],
            "f_number": CAMERA["f_number"], "fov": CAMERA["fov"],
            "focus_distance": CAMERA["focus"],
            "pose": {"from": CAMERA["from"], "look_at": CAMERA["look_at"]},
            "sensor": {"resolution": [SIDE, SIDE]},
        },
        "tracer": tracer, "objects": objects, "materials": materials, "lights": lights,
        "render": {"samples": SAMPLES},
    }


def files_of(job, folder):
    """The job as a scene of etendue, whose models are written to a folder."""
    if job in JOBS:
        return scene(job, "blob.glb")
    scenes = light_scenes.Scenes(Path(folder))
    if job in light_scenes.JOBS:
        return light_scenes.JOBS[job][0](scenes)
    through = scenes.cornell(5)
    lens = json.loads((program.ROOT / "scenes/lenses/double-gauss.json").read_text())
    (Path(folder) / "lens.json").write_text(json.dumps(lens))
    if job == SHARED:
        through["plan"] = {"dispersion": False}
    camera = through["camera"]
    through["camera"] = {"type": "lens", "lens": "lens.json", "f_number": 2.8, "focus_distance": "4.4 m",
                         "sensor_height": "28 mm", "pose": camera["pose"], "sensor": camera["sensor"]}
    return through


class Mitsuba:
    """The same scene by Mitsuba's own parts."""

    def __init__(self, folder):
        import mitsuba

        mitsuba.set_variant(VARIANT)
        self.mitsuba, self.folder, self.scenes = mitsuba, folder, {}

    def load(self, job, sampler):
        if job in light_scenes.JOBS:
            loaded = light_scenes.mitsuba_scene(self.mitsuba, files_of(job, self.folder), self.folder, sampler)
        else:
            loaded = self.mitsuba.load_dict(self.blob(job, sampler))
        self.scenes[job, sampler] = loaded

    def blob(self, job, sampler):
        mi = self.mitsuba
        light, bounces = JOBS[job]
        frame = mi.ScalarTransform4f().look_at(CAMERA["from"], CAMERA["look_at"], [0, 1, 0])
        aperture = 1e-3 * CAMERA["focal_length"] / CAMERA["f_number"] / 2
        parts = {
            "type": "scene",
            # A depth of 2 is one surface; the emitter and the surface are sampled once each.
            "integrator": {"type": "path", "max_depth": bounces + 1},
            "sensor": {
                "type": "thinlens", "fov": CAMERA["fov"], "to_world": frame,
                "aperture_radius": aperture, "focus_distance": CAMERA["focus"],
                "sampler": {"type": sampler, "sample_count": SAMPLES},
                "film": {"type": "hdrfilm", "width": SIDE, "height": SIDE, "pixel_format": "rgb",
                         "rfilter": {"type": "box"}},
            },
            "blob": {"type": "ply", "filename": str(self.folder / "blob.ply"),
                     "face_normals": True,
                     "bsdf": {"type": "twosided", "inner": {
                         "type": "diffuse", "reflectance": {"type": "rgb", "value": COLOR}}}},
        }
        if light == "point":
            parts["light"] = {"type": "point", "position": POINT["at"],
                              "intensity": {"type": "rgb", "value": [POINT["intensity"]] * 3}}
        else:
            matrix = lamp_rows()
            matrix[:3, :2] *= LAMP["side"] / 2
            parts["light"] = {
                "type": "rectangle", "to_world": mi.ScalarTransform4f(matrix),
                "emitter": {"type": "area", "radiance": {
                    "type": "rgb", "value": [LAMP["radiance"]] * 3}}}
        return parts

    def trace(self, job, sampler, seed):
        import numpy as np

        return np.array(self.mitsuba.render(self.scenes[job, sampler], spp=SAMPLES, seed=seed))


def serve(peer, folder):
    """Answers with its seconds and the picture's file."""
    import numpy as np

    subject = Mitsuba(Path(folder))

    def answer(word, job, sampler, seed):
        if word == "load":
            subject.load(job, sampler)
            return 0, ""
        start = time.process_time()
        image = subject.trace(job, sampler, seed)
        seconds = time.process_time() - start
        name = str(Path(folder) / f"{peer}.npy")
        np.save(name, image)
        return seconds, name

    program.serve(answer)


class Etendue:
    """The `etendue` command, one process a run."""

    def __init__(self, folder, command=None):
        self.program, self.folder = command or program.built("etendue"), Path(folder)

    def trace(self, job, seed):
        import numpy as np

        path, report = self.folder / "scene.json", self.folder / "report.json"
        path.write_text(json.dumps(files_of(job, self.folder)))
        command = [self.program, "render", path, "-o", self.folder / "out", "--outputs", "npy",
                   "--quiet", "--report", report, "--seed", str(seed)]
        twice = self.run(command + ["--samples", str(2 * SAMPLES)])
        once = self.run(command)
        report = json.loads(report.read_text())
        return twice - once, np.load(self.folder / "out" / "picture.npy"), report

    @staticmethod
    def run(command):
        """Processor time of a command (s)."""
        clock = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        start = clock()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return clock() - start


def noises(pictures):
    """The relative standard error of a pixel, over the calmest and in the median; NaN of one picture."""
    import numpy as np

    if len(pictures) < 2:
        return [float("nan")] * 2
    variance = np.sort(np.var(pictures, axis=0, ddof=1).mean(axis=-1).ravel())
    calm = variance[:int(CALMEST * len(variance))]
    return [float(np.sqrt(v) / np.mean(pictures)) for v in (calm.mean(), np.median(variance))]


def bound(folder, job):
    """Processor seconds that the accelerator takes of the job, and of how many rays."""
    path = Path(folder) / "scene.json"
    path.write_text(json.dumps(files_of(job, folder)))
    command = [program.built("benchmarks"), "light-rays", path]
    runs = [json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            for _ in range(3)]
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


def profile(folder, job):
    """Shares of a render's processor time by what the code does, by `perf`; empty without it."""
    if not shutil.which("perf"):
        return {}
    path, data = Path(folder) / "scene.json", Path(folder) / "perf.data"
    path.write_text(json.dumps(files_of(job, folder)))
    render = [program.built("etendue"), "render", path, "-o", Path(folder) / "out", "--outputs", "npy", "--quiet",
              "--samples", str(2 * SAMPLES)]
    record = ["perf", "record", "-F", "1999", "-e", "cpu-clock", "-o", data, "--", *render]
    subprocess.run(record, check=True, capture_output=True)
    report = ["perf", "report", "-i", data, "--stdio", "--sort", "dso,symbol"]
    found = subprocess.run(report, check=True, capture_output=True, text=True).stdout
    shares = dict.fromkeys([*STAGES, "the rest"], 0.0)
    for share, symbol in re.findall(r"^ +([0-9.]+)% +(.*)$", found, re.MULTILINE):
        stages = (stage for stage, words in STAGES.items() if re.search(words, symbol))
        shares[next(stages, "the rest")] += float(share)
    return shares


def against(arguments, folder):
    """Two builds of etendue in turns: a line a job."""
    import numpy as np

    both = [Etendue(folder), Etendue(folder, arguments.against)]
    for job in arguments.jobs:
        seconds, means = [[], []], [[], []]
        for seed in range(arguments.rounds):
            for which, build in enumerate(both):
                taken, picture, _ = build.trace(job, seed)
                seconds[which].append(taken)
                means[which].append(float(np.mean(picture)))
        own, other = map(statistics.median, seconds)
        print(f"{job}: {own:.2f} s, the other {other:.2f} s, {other / own:.2f} times as long; "
              f"means {np.mean(means[0]):.5f}, {np.mean(means[1]):.5f}", flush=True)


def measure(arguments, folder):
    import numpy as np

    remarks, others = [], {}
    ok, words = program.install(["mitsuba"])
    if not ok:
        remarks.append(f"Mitsuba is left out: pip could not install it ({words}).")
    if ok:
        process = program.Peer(__file__, "mitsuba", folder)
        try:
            process.ask("load", arguments.jobs[0], SAMPLERS[0], 0)
            others = {f"Mitsuba {program.version('mitsuba')}, {VARIANT}, {sampler}": (process, sampler)
                      for sampler in SAMPLERS}
        except RuntimeError as error:
            remarks.append(f"Mitsuba's {VARIANT} is left out: {error}")
            process.end()
    ours = Etendue(folder)
    results = {}
    for job in arguments.jobs:
        peers = others if job in GOALS else {}
        for process, sampler in peers.values():
            process.ask("load", job, sampler, 0)
            # The first render compiles.
            process.ask("trace", job, sampler, 0)
        seconds, pictures = {}, {}
        for seed in range(arguments.rounds):
            taken, picture, report = ours.trace(job, seed)
            seconds.setdefault("etendue", []).append(taken)
            pictures.setdefault("etendue", []).append(picture)
            for title, (process, sampler) in peers.items():
                taken, name = process.ask("trace", job, sampler, seed)
                seconds.setdefault(title, []).append(taken)
                pictures.setdefault(title, []).append(np.load(name))
        results[job] = {
            "seconds": seconds,
            "noise": {title: noises(pair) for title, pair in pictures.items()},
            "mean": {title: float(np.mean(pair)) for title, pair in pictures.items()},
            "rays": report["rays"],
            "bound": bound(folder, job),
            "profile": profile(folder, job),
        }
        # After each job, so that a run that is stopped leaves what it has.
        arguments.output.write_text(page(results, remarks, arguments))
    if not shutil.which("perf"):
        remarks.append("`perf` is not installed, so there are no profiles.")
    for process in {process for process, _ in others.values()}:
        process.end()
    return results, remarks


def profiles(results):
    """What the time goes to, by job, and what is left for it where a goal is missed."""
    if not any(result["profile"] for result in results.values()):
        return []
    short = lambda job: job[0].upper() + job[1:]
    lines = ["", "## Where the time goes", "", "Shares of the processor time of whole renders of twice the samples, by "
             "`perf` (percent).", "", f"| job | {' | '.join([*STAGES, 'the rest'])} |",
             "|---" * (len(STAGES) + 2) + "|"]
    for job, result in results.items():
        if result["profile"]:
            lines.append(f"| {short(job)} | " + " | ".join(f"{share:.0f}" for share in result["profile"].values()) + " |")
    lines += ["", "## Why goals are missed", "", "Seconds at the same samples: what the goal leaves for all but the "
              "accelerator, what that takes, and the largest parts of it.", "",
              "| job | left by the goal | taken | most of it |", "|---|---|---|---|"]
    for job, (same, _) in GOALS.items():
        result = results.get(job)
        titles = [t for t in result["seconds"] if "Mitsuba" in t] if result else []
        if not titles or not result["profile"]:
            continue
        middle = {title: statistics.median(all) for title, all in result["seconds"].items()}
        best, own, robust = min(middle[t] for t in titles), middle["etendue"], result["bound"]["robust"]
        if best / own >= same:
            continue
        parts = sorted(list(result["profile"].items())[1:-1], key=lambda part: -part[1])[:3]
        largest = ", ".join(f"{stage} {share / 100 * own:.2f}" for stage, share in parts)
        left = best / same - robust
        left = f"{left:.2f}" if left > 0 else "nothing: the accelerator alone takes longer"
        lines.append(f"| {short(job)} | {left} | {own - robust:.2f} | {largest} |")
    return lines


def page(results, remarks, arguments):
    lines = [
        "# Light, against Mitsuba 3", "",
        "`make bench-light` measures this and writes this page: a matte blob of a million triangles "
        f"through a thin lens, {SIDE} × {SIDE} pixels of {SAMPLES} samples, and the rooms and balls of "
        f"`benches/light_scenes.py`, {light_scenes.SIDE} × {light_scenes.SIDE} pixels. Tracing alone, processor "
        f"seconds of all threads ({os.cpu_count()} cores), medians of {arguments.rounds} rounds in which the "
        "programs take turns, with the fastest and the slowest. *Noise* is the relative standard error of a pixel, "
        f"from as many seeds, over the calmest {CALMEST:.0%} of the pixels; *median* is that of the pixel in the "
        "middle; *cost* is time times noise squared against etendue's: how much longer the other takes to one "
        "error. etendue draws Sobol points and starts rays by their error bounds, in the precision that its plan "
        "chooses; Mitsuba draws numbers by two of its samplers, the best it has. Its thin lens does not dim towards "
        "the corners, etendue's does by cos⁴: hence the means.", "",
        "The bound is what the accelerator takes for the very rays that were traced, by a clock around each batch, "
        "with everything else for nothing: Embree in its robust mode, which etendue takes, and in its fast one; in "
        "scenes of 64 triangles and fewer etendue's own loop over all of them, which has no fast mode.", "",
        f"Measured at commit {commit()} on {machine()}. Figures of other days are of other processors: ratios "
        "alone are to be compared.", "",
    ]
    for job, result in results.items():
        middle = {title: statistics.median(all) for title, all in result["seconds"].items()}
        own = middle["etendue"]
        lines += [f"## {job[0].upper() + job[1:]}", "",
                  "| | seconds | noise | median | mean | etendue is faster by | cost at one noise | cost at one median |",
                  "|---|---|---|---|---|---|---|---|"]
        for title, all in result["seconds"].items():
            costs = [cost(result, title, which) for which in range(2)]
            errors = [f"{known(100 * error)} %" for error in result["noise"][title]]
            lines.append(
                f"| {title} | {middle[title]:.2f} ({min(all):.2f} to {max(all):.2f}) "
                f"| {errors[0]} | {errors[1]} | {result['mean'][title]:.4f} "
                f"| {middle[title] / own:.2f} | {known(costs[0])} | {known(costs[1])} |")
        limit = result["bound"]
        lines += ["", f"The accelerator: {limit['robust']:.2f} s of it ({limit['robust'] / own:.0%}), "
                  f"{limit['fast']:.2f} s in its fast mode, for {result['rays']} rays.", ""]
    lines += goals(results) + profiles(results) + [""] + [f"- {remark}" for remark in remarks]
    wrapped = [line if line.startswith(("|", "#")) else textwrap.fill(line, 120) for line in lines]
    return "\n".join(wrapped).rstrip() + "\n"


def commit():
    done = subprocess.run(["git", "-C", program.ROOT, "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    return done.stdout.strip() or "unknown"


def machine():
    """The processor by its name."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return f"an {line.partition(':')[2].strip()}"
    return "a processor without a name"


def cost(result, title, which):
    """How much longer than etendue a program takes to one error, of the calmest pixels (0) or the median (1)."""
    seconds, noise = result["seconds"], result["noise"]
    time = statistics.median(seconds[title]) / statistics.median(seconds["etendue"])
    # Both may be all but free of noise: a pixel in the middle under a point light.
    return time * (noise[title][which] / noise["etendue"][which]) ** 2 if noise["etendue"][which] else float("nan")


def known(number):
    """Two digits; a stroke where one round alone tells no noise."""
    return f"{number:.2f}" if number == number else "–"


def goals(results):
    """Which goals are met."""
    lines = ["## Goals", "", "Times faster than Mitsuba with the sampler that is its best at the job, at the same "
             "samples, and at one error: that of the calmest pixels and that of the median pixel, of which the lesser "
             "counts. *At most* is what it would be if nothing but the accelerator in its robust mode took time: where "
             "that is below the goal, nothing but a faster accelerator reaches it.", "",
             "| job | at the same samples | at most | goal | | at one noise | at one median | goal | |",
             "|---|---|---|---|---|---|---|---|---|"]
    middle = lambda result, title: statistics.median(result["seconds"][title])
    verdict = lambda value, goal: "met" if value >= goal else "**missed**"
    for job, (same, error) in GOALS.items():
        result = results.get(job)
        titles = [t for t in result["seconds"] if "Mitsuba" in t] if result else []
        if not titles:
            continue
        time = min(middle(result, t) / middle(result, "etendue") for t in titles)
        costs = [min(cost(result, t, which) for t in titles) for which in range(2)]
        most = min(middle(result, t) for t in titles) / result["bound"]["robust"]
        lines.append(f"| {job} | {time:.2f} | {most:.2f} | ≥ {same} | {verdict(time, same)} "
                     f"| {known(costs[0])} | {known(costs[1])} | ≥ {error} | {verdict(min(costs), error)} |")
    straight = results.get("Cornell box, path of 5 bounces")
    for job, manner in [(LENS, "each band by its own index"), (SHARED, "all bands as at the design wavelength")]:
        if job in results and straight:
            ratio = middle(results[job], "etendue") / middle(straight, "etendue")
            lines += ["", f"Through the double Gauss, {manner}, the room takes {ratio:.2f} times as long as through "
                      f"a pinhole (goal: at most {LENS_GOAL}): {'met' if ratio <= LENS_GOAL else '**missed**'}."]
    return lines


def main():
    parser = program.arguments(__doc__, "measurements/benchmarks-light.md", rounds=6)
    parser.add_argument("--jobs", nargs="+", choices=ALL, default=ALL)
    parser.add_argument("--against", type=Path, help="another build of etendue, in place of Mitsuba")
    arguments = parser.parse_args()
    program.enter("peers", ["numpy"])
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([program.built("benchmarks"), "models", folder, "--triangles", "1000000"], check=True)
        if arguments.against:
            return against(arguments, folder)
        text = page(*measure(arguments, folder), arguments)
    arguments.output.write_text(text)
    print(text)


if __name__ == "__main__":
    program.begin(main, serve)
