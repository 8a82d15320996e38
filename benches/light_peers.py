#!/usr/bin/env python3
"""Light in etendue and in Mitsuba 3, in one run, taking turns.

    python3 benches/light_peers.py [--rounds N] [--output docs/measurements/benchmarks-light.md]
    python3 benches/light_peers.py --against ETENDUE [--rounds N] [--jobs JOB ...]

The second form times another build of the command in place of Mitsuba, and prints what it finds.

The jobs are those of `light_scenes.py`: a matte blob of a million triangles through a thin lens; rooms, balls and many
lights; a room through the traced lenses of a double Gauss beside the same through a pinhole, in red, green and blue and
in 31 bands; `facing`, for which Mitsuba finds depth and normals, and `flat`. Timed is tracing alone, from a built
structure to pixels, on the processor's clock, all threads together, which other processes disturb less than they do the
wall's: for etendue what a run of twice as many samples takes beyond a plain one, for Mitsuba `render` of a loaded
scene, once warmed up.

How noisy a picture is: the variance of each pixel over renders of different seeds, relative to the mean;
of the pixels the root mean square of the calmest 99 in 100, and the median. The edges of lamps that are seen
and sparkles, which are few, rule a plain mean square: it is not the same for two sets of seeds. Where the
noise differs, time times its square is the cost of one error.

The bound: `benchmarks light-rays` has the same picture rendered with a clock around the accelerator.
"""

import json
import re
import resource
import shutil
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import light_page
import light_scenes
import program
from light_mitsuba import Translator
from section import machine

# By its best sampler at a job Mitsuba is compared.
SAMPLERS = ["multijitter", "ldsampler"]
VARIANT = "llvm_ad_rgb"
ALL = [*light_scenes.JOBS, *light_scenes.ALONE]


class Mitsuba:
    """The same scenes by Mitsuba."""

    def __init__(self, folder):
        import mitsuba

        mitsuba.set_variant(VARIANT)
        self.mitsuba, self.folder, self.loaded = mitsuba, folder, {}

    def load(self, job, sampler):
        scene = light_scenes.scene_of(job, self.folder)
        parts = Translator(self.mitsuba, scene, self.folder).parts(sampler)
        self.loaded[job, sampler] = self.mitsuba.load_dict(parts), scene["render"]["samples"]

    def trace(self, job, sampler, seed):
        import numpy as np

        scene, samples = self.loaded[job, sampler]
        return np.array(self.mitsuba.render(scene, spp=samples, seed=seed))


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
        """Processor seconds of tracing, the picture, and the report."""
        import numpy as np

        scene = light_scenes.scene_of(job, self.folder)
        path, out, report = (self.folder / name for name in ("scene.json", "out", "report.json"))
        path.write_text(json.dumps(scene))
        shutil.rmtree(out, ignore_errors=True)
        command = [self.program, "render", path, "-o", out, "--outputs", "npy", "--quiet", "--report", report,
                   "--seed", str(seed)]
        twice = self.run([*command, "--samples", str(2 * scene["render"]["samples"])])
        once = self.run(command)
        # A sensor of bands has no colours.
        picture = next(out / name for name in ("spectrum.npy", "picture.npy") if (out / name).exists())
        return twice - once, np.load(picture), json.loads(report.read_text())

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
    calm = variance[:int(light_page.CALMEST * len(variance))]
    return [float(np.sqrt(v) / np.mean(pictures)) for v in (calm.mean(), np.median(variance))]


def bound(folder, job):
    """Processor seconds that the accelerator takes of the job, and of how many rays."""
    path = Path(folder) / "scene.json"
    path.write_text(json.dumps(light_scenes.scene_of(job, folder)))
    command = [program.built("benchmarks"), "light-rays", path]
    runs = [json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
            for _ in range(3)]
    return {key: statistics.median(run[key] for run in runs) for key in runs[0]}


def profile(folder, job):
    """Shares of a render's processor time by what the code does, by `perf`; empty without it."""
    if not shutil.which("perf"):
        return {}
    scene = light_scenes.scene_of(job, folder)
    path, data = Path(folder) / "scene.json", Path(folder) / "perf.data"
    path.write_text(json.dumps(scene))
    render = [program.built("etendue"), "render", path, "-o", Path(folder) / "out", "--outputs", "npy", "--quiet",
              "--samples", str(2 * scene["render"]["samples"])]
    record = ["perf", "record", "-F", "1999", "-e", "cpu-clock", "-o", data, "--", *render]
    subprocess.run(record, check=True, capture_output=True)
    report = ["perf", "report", "-i", data, "--stdio", "--sort", "dso,symbol"]
    found = subprocess.run(report, check=True, capture_output=True, text=True).stdout
    shares = dict.fromkeys([*light_page.STAGES, "the rest"], 0.0)
    for share, symbol in re.findall(r"^ +([0-9.]+)% +(.*)$", found, re.MULTILINE):
        stages = (stage for stage, words in light_page.STAGES.items() if re.search(words, symbol))
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


def peers(folder, job):
    """Mitsuba by its samplers: of each title the process and the sampler; and a remark where it cannot be had."""
    ok, words = program.install(["mitsuba"])
    if not ok:
        return {}, [f"Mitsuba is left out: pip could not install it ({words})."]
    process = program.Peer(__file__, "mitsuba", folder)
    try:
        process.ask("load", job, SAMPLERS[0], 0)
    except RuntimeError as error:
        process.end()
        return {}, [f"Mitsuba's {VARIANT} is left out: {error}"]
    version = program.version("mitsuba")
    return {f"Mitsuba {version}, {VARIANT}, {sampler}": (process, sampler) for sampler in SAMPLERS}, []


def compare(arguments, folder, job, others):
    """What a job takes by each program, in turns."""
    import numpy as np

    ours, seconds, pictures = Etendue(folder), {}, {}
    for process, sampler in others.values():
        process.ask("load", job, sampler, 0)
        # The first render compiles.
        process.ask("trace", job, sampler, 0)
    for seed in range(arguments.rounds):
        taken, picture, report = ours.trace(job, seed)
        seconds.setdefault("etendue", []).append(taken)
        pictures.setdefault("etendue", []).append(picture)
        for title, (process, sampler) in others.items():
            taken, name = process.ask("trace", job, sampler, seed)
            seconds.setdefault(title, []).append(taken)
            pictures.setdefault(title, []).append(np.load(name))
    result = {"seconds": seconds, "rays": report["rays"], "bound": bound(folder, job), "profile": profile(folder, job)}
    # Depth, normals and colours are no light.
    if job in (light_scenes.FACING, light_scenes.FLAT):
        return result
    return result | {"noise": {title: noises(some) for title, some in pictures.items()},
                     "mean": {title: float(np.mean(some)) for title, some in pictures.items()}}


def measure(arguments, folder):
    """Measures the jobs, and writes the page after each, so that a run that is stopped leaves what it has."""
    about = machine()
    compared = [job for job in arguments.jobs if job in light_scenes.JOBS]
    others, remarks = peers(folder, compared[0]) if compared else ({}, [])
    remarks += [f"{job} is left out: {why}." for job, why in light_scenes.left_out().items()]
    if not shutil.which("perf"):
        remarks.append("`perf` is not installed, so there are no profiles.")
    results = {}
    for job in arguments.jobs:
        results[job] = compare(arguments, folder, job, others if job in compared else {})
        arguments.output.write_text(light_page.page(results, remarks, arguments.rounds, about))
    for process in {process for process, _ in others.values()}:
        process.end()


def main():
    parser = program.arguments(__doc__, "measurements/benchmarks-light.md", rounds=6)
    here = [job for job in ALL if job not in light_scenes.left_out()]
    parser.add_argument("--jobs", nargs="+", choices=here, default=here)
    parser.add_argument("--against", type=Path, help="another build of etendue, in place of Mitsuba")
    arguments = parser.parse_args()
    program.enter("peers", ["numpy"])
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([program.built("benchmarks"), "models", folder, "--triangles", "1000000"], check=True)
        if arguments.against:
            return against(arguments, folder)
        measure(arguments, folder)
    print(arguments.output.read_text())


if __name__ == "__main__":
    program.begin(main, serve)
