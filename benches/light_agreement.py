#!/usr/bin/env python3
"""Pictures of light by etendue, in single and in double precision, and by Mitsuba 3, compared.

    python3 benches/light_agreement.py [--scenes SCENE ...] [--seeds N] [--output docs/measurements/agreement.md]

Exit code: 0 all agree, 1 one does not, 2 Mitsuba cannot be had.

Each scene of `agreement_scenes.py` is rendered with several seeds. Compared are the mean of the picture and the means
of 8 x 8 blocks, in red, green and blue. A standard error is the larger of two: by what the seeds make of a block, and
by what they make of its pixels, which are independent of one another; the first is of few numbers, the second would
miss what is common to pixels.

The difference may be four standard errors, which one of 16 000 numbers exceeds by chance, and 0.3 % of the light:
normals between corners of triangles, texels and light in images are interpolated, and sums are rounded, by each program
in its own way. A block may differ by a ten-thousandth of the picture's mean besides: that is the light of a dozen of its
rays, and where no more are lit, standard errors say nothing.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import agreement_scenes
import light_page
import light_scenes
import program
from light_mitsuba import Translator
from section import machine

SIDE, CELLS = 128, 8
SIGMAS, SHARE, OF_PICTURE = 4.0, 0.003, 1e-4
PRECISIONS = ["single", "double"]
# Mitsuba's variants, the first that can be had.
VARIANTS = ["llvm_ad_rgb", "scalar_rgb"]
# Its numbers are independent of one another.
SAMPLER = "independent"


def prepared(case, folder, samples):
    """The scene as both render it: a pinhole, whose light does not fall off, and images as they are, unfiltered."""
    scene = case.make(agreement_scenes.Small(folder))
    camera = scene["camera"]
    scene["camera"] = {"type": "pinhole", "fov": camera["fov"], "pose": camera["pose"],
                       "sensor": {"resolution": [SIDE, SIDE]}}
    scene["render"] = {"samples": samples}
    scene["plan"] = {"texture_filter": False}
    return scene


def serve(variant, folder):
    """Renders a scene by Mitsuba with so many seeds, and answers with the file of the pictures."""
    import mitsuba
    import numpy as np

    mitsuba.set_variant(variant)
    cases = agreement_scenes.cases()

    def answer(name, samples, seeds):
        if not name:
            return ""
        case = cases[name]
        scene = prepared(case, folder, samples)
        loaded = mitsuba.load_dict(Translator(mitsuba, scene, folder).parts(SAMPLER, case.passes))
        pictures = [np.array(mitsuba.render(loaded, spp=samples, seed=seed)) for seed in range(seeds)]
        path = str(Path(folder) / "mitsuba.npy")
        np.save(path, pictures)
        return path

    program.serve(answer)


def start(folder):
    """Mitsuba in the first variant that can be had: its title and its process."""
    installed, words = program.install(["mitsuba"])
    for variant in VARIANTS if installed else []:
        process = program.Peer(__file__, variant, folder)
        try:
            process.ask("", 0, 0)
            return f"Mitsuba {program.version('mitsuba')}, {variant}", process
        except RuntimeError as error:
            words = str(error)
            process.end()
    print(f"Mitsuba cannot be had: {words}", file=sys.stderr)
    sys.exit(2)


def rendered(scene, precision, seeds, folder):
    """Pictures by etendue."""
    import numpy as np

    folder = Path(folder)
    path = folder / "scene.json"
    path.write_text(json.dumps(scene | {"plan": scene["plan"] | {"light_precision": precision}}))
    pictures = []
    for seed in range(seeds):
        done = subprocess.run([program.built("etendue"), "render", path, "-o", folder / "out", "--outputs", "npy",
                               "--quiet", "--seed", str(seed)], capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(done.stderr.strip())
        pictures.append(np.load(folder / "out" / "picture.npy"))
    return np.array(pictures)


def blocks(pictures, cells):
    """Means of `cells` × `cells` blocks of each picture."""
    count, height, width, bands = pictures.shape
    shape = (count, cells, height // cells, cells, width // cells, bands)
    return pictures.reshape(shape).mean(axis=(2, 4))


def estimate(pictures, cells):
    """Means of blocks over all seeds, and their standard errors."""
    import numpy as np

    seeds, height, width, _ = pictures.shape
    means = blocks(pictures, cells)
    of_blocks = means.var(axis=0, ddof=1) / seeds
    of_pixels = blocks(pictures.var(axis=0, ddof=1)[None], cells)[0] * cells**2 / (height * width * seeds)
    return means.mean(axis=0), np.sqrt(np.maximum(of_blocks, of_pixels))


@dataclass
class Difference:
    """Of a block, or of a whole picture, in one band."""

    share: float
    error: float
    # Over what is allowed.
    excess: float


def largest(ours, theirs, cells, expected):
    """The difference of blocks that is the largest beside what is allowed."""
    import numpy as np

    (own, own_error), (other, other_error) = estimate(ours, cells), estimate(theirs, cells)
    other, other_error = other * (1 + expected), other_error * (1 + expected)
    difference, error = own - other, np.hypot(own_error, other_error)
    # Where both are black there is nothing to divide by.
    allowed = np.maximum(SIGMAS * error + SHARE * np.abs(other) + OF_PICTURE * other.mean(), 1e-12)
    at = np.unravel_index(np.argmax(np.abs(difference) / allowed), allowed.shape)
    scale = max(abs(float(other[at])), 1e-12)
    return Difference(float(difference[at]) / scale, float(error[at]) / scale,
                      float(abs(difference[at]) / allowed[at]))


def compare(ours, theirs, expected):
    """The numbers of a row, of pictures by precision."""
    import numpy as np

    theirs = theirs.astype(np.float64)
    row = {"means": [], "whole": [], "worst": []}
    for pictures in ours:
        pictures = pictures.astype(np.float64)
        row["means"].append(float(pictures.mean()))
        row["whole"].append(largest(pictures, theirs, 1, expected))
        row["worst"].append(largest(pictures, theirs, CELLS, expected))
    return row | {"other": float(theirs.mean())}


def is_compared(case):
    return not case.differs or case.expected != 0.0


def agrees(row):
    return all(difference.excess <= 1.0 for difference in row["whole"] + row["worst"])


def verdict(case, row):
    if not is_compared(case):
        return "differs by design"
    return "agrees" if agrees(row) else "**differs**"


def table_row(name, case, row):
    """A line of the page: the larger of both precisions' differences."""
    whole, worst = (max(row[key], key=lambda difference: difference.excess) for key in ("whole", "worst"))
    means = " | ".join(f"{mean:.5f}" for mean in [*row["means"], row["other"]])
    percent = lambda share: f"{100 * share:.2f}"
    return (f"| {light_page.capital(name)} | {means} | {percent(whole.share)} | {percent(whole.error)} "
            f"| {percent(worst.share)} ± {percent(worst.error)} | {verdict(case, row)} |")


def page(rows, title, arguments, about):
    lines = [
        "# Light, as Mitsuba 3 sees it", "",
        f"`make agreement` renders these scenes by etendue and by {title}, and writes this page: {SIDE} × {SIDE} "
        f"pixels, {arguments.samples} samples, {arguments.seeds} seeds each. *Difference* is etendue's mean less "
        "Mitsuba's in the band and the precision in which they are the farthest apart, less what is known of the "
        f"models, with its standard error; *worst block* is that of the {CELLS} × {CELLS} blocks of the picture, with "
        "its own. All are in percent.", "",
        f"They agree where no difference exceeds {SIGMAS:.0f} standard errors and, added to them, "
        f"{100 * SHARE:.1f} % of the light: that much is left to normals between the corners of triangles, to texels "
        "and light in images, which each program interpolates in its own way, and to roundings; and in blocks a "
        "ten-thousandth of the picture's mean, the light of a dozen of their rays. All cameras are pinholes, and "
        "textures are not filtered.", "",
        f"Measured on {about}.", "",
        "| scene | single | double | Mitsuba | difference | standard error | worst block | |", "|---" * 8 + "|",
        *[table_row(name, case, row) for name, (case, row) in rows.items()], "",
        *[f"- {light_page.capital(name)}: {case.differs}." for name, (case, _) in rows.items() if case.differs],
        *[f"- {light_page.capital(job)} is left out: {why}." for job, why in light_scenes.left_out().items()],
    ]
    return light_page.wrapped(lines)


def measure(arguments, cases, folder):
    """The rows by name; the page is written after each, so that a run that is stopped leaves what it has."""
    import numpy as np

    about, (title, process), rows = machine(), start(folder), {}
    for name in arguments.scenes:
        case = cases[name]
        scene = prepared(case, folder, arguments.samples)
        ours = [rendered(scene, precision, arguments.seeds, folder) for precision in PRECISIONS]
        theirs = np.load(process.ask(name, arguments.samples, arguments.seeds))
        rows[name] = case, compare(ours, theirs, case.expected)
        print(table_row(name, *rows[name]), flush=True)
        arguments.output.write_text(page(rows, title, arguments, about))
    process.end()
    return rows


def options(scenes):
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=scenes, default=scenes, metavar="SCENE")
    parser.add_argument("--seeds", type=int, default=8, help="pictures of each scene, at least 2")
    parser.add_argument("--samples", type=int, default=64, help="of each pixel of a picture")
    parser.add_argument("--output", type=Path, default=program.ROOT / "docs/measurements/agreement.md",
                        help="the page to write")
    return parser.parse_args()


def main():
    # Before the cases, of which some numbers take numpy.
    program.enter("peers", ["numpy"])
    cases = agreement_scenes.cases()
    arguments = options(list(cases))
    with tempfile.TemporaryDirectory() as folder:
        models = [program.built("benchmarks"), "models", folder, "--triangles", "100000", "--formats", "glb,ply"]
        subprocess.run(models, check=True)
        rows = measure(arguments, cases, folder)
    apart = [name for name, (case, row) in rows.items() if is_compared(case) and not agrees(row)]
    print(f"{len(rows)} scenes; {', '.join(apart) or 'none'} disagree")
    sys.exit(1 if apart else 0)


if __name__ == "__main__":
    program.begin(main, serve)
