"""The page of `light_peers.py`: its tables, which goals are met, and why the others are not."""

import math
import os
import statistics
import textwrap

import light_scenes
from section import spread

# Of all pixels the calmest, of which the noise is told.
CALMEST = 0.99
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
# The two errors that noise is told by.
MEASURES = ["over the calmest pixels", "in the median pixel"]


def page(results, remarks, rounds, about):
    lines = introduction(rounds, about)
    for job, result in results.items():
        lines += table(job, result)
    lines += goals(results) + profiles(results) + reasons(results) + means(results)
    lines += [""] + [f"- {remark}" for remark in remarks]
    return wrapped(lines)


def wrapped(lines):
    """A page of lines, of which those of tables and headings stay whole."""
    fill = lambda line: textwrap.fill(line, 120, subsequent_indent="  " if line.startswith("- ") else "")
    return "\n".join(line if line.startswith(("|", "#")) else fill(line) for line in lines).rstrip() + "\n"


def introduction(rounds, about):
    return [
        "# Light, against Mitsuba 3", "",
        "`make bench-light` measures this and writes this page: the jobs of `benches/light_scenes.py`, "
        f"{light_scenes.SAMPLES} samples a pixel, a matte blob of a million triangles through a thin lens with "
        f"{light_scenes.BLOB_SIDE} × {light_scenes.BLOB_SIDE} pixels, the others with {light_scenes.SIDE} × "
        f"{light_scenes.SIDE}; and `facing`, 1024 × 1024 pixels of {light_scenes.FACING_SAMPLES} samples, for which "
        "Mitsuba finds depth and normals, and `flat`. Tracing alone, processor "
        f"seconds of all threads ({os.cpu_count()} cores), medians of {rounds} rounds in which the "
        "programs take turns, with the fastest and the slowest. *Noise* is the relative standard error of a pixel, "
        f"from as many seeds, over the calmest {CALMEST:.0%} of the pixels; *median* is that of the pixel in the "
        "middle; *cost* is time times noise squared against etendue's: how much longer the other takes to one "
        "error. etendue draws Sobol points and starts rays by their error bounds, in the precision that its plan "
        "chooses; Mitsuba draws numbers by two of its samplers, the best it has. Their pictures "
        "[agree](agreement.md).", "",
        "The bound is what the accelerator takes for the very rays that were traced, by a clock around each batch, "
        "with everything else for nothing: Embree in its robust mode, which etendue takes, and in its fast one; in "
        "scenes of 64 triangles and fewer etendue's own loop over all of them, which has no fast mode.", "",
        f"Measured on {about}. Figures of other days are of other processors: ratios alone are to be compared.", "",
    ]


def capital(text):
    """With its first letter large, where that is one."""
    return text[:1].upper() + text[1:]


def seconds(result, title="etendue"):
    return statistics.median(result["seconds"][title])


def others(results, job):
    """The titles of Mitsuba at a job, none where it was not measured."""
    return [title for title in results[job]["seconds"] if title != "etendue"] if job in results else []


def best(result):
    """The seconds of Mitsuba's faster sampler."""
    return min(seconds(result, title) for title in result["seconds"] if title != "etendue")


def cost(result, title, which):
    """How much longer than etendue a program takes to one error by one of the measures."""
    noise = result["noise"]
    time = seconds(result, title) / seconds(result)
    # Both may be all but free of noise: a pixel in the middle under a point light.
    return time * (noise[title][which] / noise["etendue"][which]) ** 2 if noise["etendue"][which] else float("nan")


def costs(result):
    """By each measure the cost with that sampler of Mitsuba's which is the best by it."""
    titles = [title for title in result["seconds"] if title != "etendue"]
    return [min(cost(result, title, which) for title in titles) for which in range(2)]


def known(number):
    """Two digits; a stroke where one round alone tells no noise."""
    return f"{number:.2f}" if number == number else "–"


def table(job, result):
    """What a job takes by each program."""
    columns = ["seconds", *(["noise", "median", "mean"] if "noise" in result else []), "etendue is faster by",
               *(["cost at one noise", "cost at one median"] if "noise" in result else [])]
    lines = [f"## {capital(job)}", "", f"| | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    for title, all in result["seconds"].items():
        cells = [title, spread(all, 2)]
        if "noise" in result:
            cells += [f"{known(100 * error)} %" for error in result["noise"][title]]
            cells.append(f"{result['mean'][title]:.4f}")
        cells.append(f"{seconds(result, title) / seconds(result):.2f}")
        if "noise" in result:
            cells += [known(cost(result, title, which)) for which in range(2)]
        lines.append(f"| {' | '.join(cells)} |")
    limit = result["bound"]
    return lines + ["", f"The accelerator: {limit['robust']:.2f} s of it ({limit['robust'] / seconds(result):.0%}), "
                    f"{limit['fast']:.2f} s in its fast mode, for {result['rays']} rays.", ""]


def verdict(is_met):
    return "met" if is_met else "**missed**"


def goals(results):
    """Which goals are met."""
    rows = goals_against_mitsuba(results)
    beside = [f"| {job} | {beside} | {ratio:.2f} | ≤ {goal} | {verdict(ratio <= goal)} |"
              for job, beside, goal, ratio in ratios(results)]
    if beside:
        beside = ["", "| job | beside | times as long | goal | |", "|---|---|---|---|---|", *beside]
    return ["## Goals", *rows, *beside] if rows or beside else []


def goals_against_mitsuba(results):
    rows = []
    for job, (_, same, error) in light_scenes.JOBS.items():
        if not others(results, job):
            continue
        result = results[job]
        time, most = best(result) / seconds(result), best(result) / result["bound"]["robust"]
        row = f"| {job} | {time:.2f} | {most:.2f} | ≥ {same} | {verdict(time >= same)} "
        if error:
            found = costs(result)
            row += f"| {known(found[0])} | {known(found[1])} | ≥ {error} | {verdict(min(found) >= error)} |"
        rows.append(row if error else f"{row}| – | – | – | |")
    about = ("Times faster than Mitsuba with the sampler that is its best at the job, at the same samples, and at one "
             "error: that of the calmest pixels and that of the median pixel, of which the lesser counts. *At most* is "
             "what it would be if nothing but the accelerator in its robust mode took time: where that is below the "
             "goal, nothing but a faster accelerator reaches it.")
    head = ["| job | at the same samples | at most | goal | | at one noise | at one median | goal | |",
            "|---|---|---|---|---|---|---|---|---|"]
    return ["", about, "", *head, *rows] if rows else []


def ratios(results):
    """Of the jobs that are held beside others: the job, that other, the goal, and how many times as long it takes."""
    return [(job, beside, goal, seconds(results[job]) / seconds(results[beside]))
            for job, (_, beside, goal) in light_scenes.ALONE.items() if job in results and beside in results]


def goals_alone(results):
    lines = [f"| {job} | {beside} | {ratio:.2f} | ≤ {goal} | {verdict(ratio <= goal)} |"
             for job, beside, goal, ratio in ratios(results)]
    head = ["", "| job | beside | times as long | goal | |", "|---|---|---|---|---|"]
    return head + lines if lines else []


def profiles(results):
    """What the time goes to, by job."""
    rows = {job: result["profile"] for job, result in results.items() if result["profile"]}
    if not rows:
        return []
    lines = ["", "## Where the time goes", "", "Shares of the processor time of whole renders of twice the samples, by "
             "`perf` (percent).", "", f"| job | {' | '.join([*STAGES, 'the rest'])} |",
             "|---" * (len(STAGES) + 2) + "|"]
    return lines + [f"| {capital(job)} | " + " | ".join(f"{share:.0f}" for share in shares.values()) + " |"
                    for job, shares in rows.items()]


def reasons(results):
    """A sentence on each goal that is missed."""
    rows = []
    for job, (_, same, error) in light_scenes.JOBS.items():
        if not others(results, job):
            continue
        result = results[job]
        if best(result) / seconds(result) < same:
            rows.append(f"| {capital(job)} | same samples | {why_slow(result, same)} |")
        if error and not min(costs(result)) >= error:
            rows.append(f"| {capital(job)} | one error | {why_noisy(result, error)} |")
    rows += [f"| {capital(job)} | beside a pinhole | {why_longer(results[job], results[beside], goal)} |"
             for job, beside, goal, ratio in ratios(results) if ratio > goal]
    if not rows:
        return []
    return ["", "## Why goals are missed", "", "| job | goal | reason |", "|---|---|---|", *rows]


def why_slow(result, same):
    """Why the goal at the same samples is missed."""
    allowed, robust, own = best(result) / same, result["bound"]["robust"], seconds(result)
    if robust >= allowed:
        return f"The accelerator alone takes {robust:.2f} s, and the goal allows {allowed:.2f} s."
    parts = taken(result, ["accelerator", "the rest"])
    return (f"Own code takes {own - robust:.2f} s, and the goal leaves {allowed - robust:.2f} s"
            + (f"; the largest parts are {listed(parts)}." if parts else "."))


def why_noisy(result, error):
    """Why the goal at one error is missed: the noise that would do at this speed."""
    titles = [title for title in result["seconds"] if title != "etendue"]
    found = {(title, which): cost(result, title, which) for title in titles for which in range(2)}
    if any(math.isnan(value) for value in found.values()):
        return "One round tells no noise."
    title, which = min(found, key=found.get)
    noise = result["noise"]["etendue"][which] / result["noise"][title][which]
    time = seconds(result, title) / seconds(result)
    return (f"Noise at equal samples is {noise:.2f} times that of Mitsuba's {title.rpartition(', ')[2]} "
            f"{MEASURES[which]}; at {time:.2f} times its speed the goal asks for {math.sqrt(time / error):.2f} times.")


def why_longer(result, beside, goal):
    """Why a job takes more times as long as another than it may: what takes more time."""
    more, allowed = seconds(result) - seconds(beside), (goal - 1) * seconds(beside)
    before, after = taken(beside, ["the rest"]), taken(result, ["the rest"])
    parts = {stage: value - before.get(stage, 0.0) for stage, value in after.items()}
    return (f"It takes {more:.2f} s more, and the goal allows {allowed:.2f} s"
            + (f"; the largest parts are {listed(parts)}." if parts else "."))


def taken(result, without):
    """Seconds by what the code does, some of it left out, of the profile's shares; empty where there is none."""
    return {stage: share / 100 * seconds(result) for stage, share in result["profile"].items()
            if stage not in without}


def listed(parts):
    """The three largest parts."""
    largest = sorted(parts.items(), key=lambda part: -part[1])[:3]
    return ", ".join(f"{stage} {value:.2f} s" for stage, value in largest if value >= 0.005)


def means(results):
    """Why the means of some jobs differ."""
    why = {
        "Through the thin lens": (
            ["direct, point light", "direct, area light", "path, area light"],
            "etendue's light falls off towards the corners by cos⁴, as behind a real aperture; that of Mitsuba's "
            "`thinlens` does not."),
        "Glossy balls": (
            [light_scenes.BALLS],
            "etendue's rough metal returns the light that meets several facets, and turns white at grazing incidence; "
            "Mitsuba's `roughconductor` loses that light, and has one colour from all sides "
            "([materials](../explanation/light.md#metals))."),
        "The textured surface": (
            [light_scenes.ASSET],
            "beneath its gloss etendue's `gltf` is matte and gets what the gloss leaves on the way in and out; "
            "Mitsuba's `principled` gets all of the light there."),
    }
    lines = [f"- {name}: {reason}" for name, (jobs, reason) in why.items()
             if any(others(results, job) for job in jobs)]
    return ["", "## Why means differ", "", *lines] if lines else []
