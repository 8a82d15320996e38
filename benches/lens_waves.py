#!/usr/bin/env python3
"""Compares lenses in waves with optiland: optical path differences on the same rays, and modulation.

    python3 benches/lens_waves.py [LENS ...]

The lenses are those of scenes/lenses, at stops that their fields pass whole. Indices are those of
etendue, so that glass catalogues are no part of it. Path differences are those of optiland's paths
along the rays of etendue's fans, against the same sphere, after piston and tilt; the modulation is that
of its FFTMTF. It fails when one of them is farther off than the tolerance.
"""

import argparse
import json
import subprocess
import sys

import program

LENSES = program.ROOT / "scenes" / "lenses"
# The f-number, and the fields (degrees). Optiland's beam fills the paraxial entrance pupil on the axis, of which
# the real image of the stop is another size behind strong front groups: its pupil is made as wide as the
# real ray that meets the rim of our stop.
CASES = {
    "achromat": (4.5, [0, 0.5, 1]),
    "cooke-triplet": (8, [0, 5, 10]),
    "double-gauss": (5.6, [0, 4, 8]),
    "singlet": (10, [0, 1, 2]),
    "telephoto": (8, [0, 2, 4]),
    "asphere": (4, [0, 1, 2]),
}
NM = 587.56
WAVES = 1e-3
MODULATION = 5e-3
CELLS = 192


def ours(name, f_number, fields):
    """The report on a lens."""
    words = [
        etendue(), "lens", LENSES / f"{name}.json", "--json", "--waves", "--f-number", f_number,
        "--fields", ",".join(map(str, fields)), "--wavelengths", NM, "--quiet",
    ]
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout), json.loads((LENSES / f"{name}.json").read_text())


def etendue():
    for build in ["release", "debug"]:
        path = program.TARGET / build / "etendue"
        if path.exists():
            return path
    raise SystemExit("no etendue below target/: make lens-waves builds it")


def optic_of(report, written):
    """The lens as optiland has it."""
    import numpy as np
    from optiland.materials import IdealMaterial
    from optiland.optic import Optic

    optic = Optic()
    optic.add_surface(index=0, thickness=np.inf)
    for index, (row, element) in enumerate(zip(report["elements"], written["elements"]), 1):
        shape = {}
        aspheric = {int(power): value for power, value in element.get("aspheric", {}).items()}
        if aspheric:
            powers = range(2, max(aspheric) + 2, 2)
            shape["surface_type"] = "even_asphere"
            shape["coefficients"] = [aspheric.get(power, 0.0) for power in powers]
        optic.add_surface(
            index=index, radius=row["radius"] or np.inf, thickness=row["thickness"],
            conic=element.get("conic", 0.0), material=IdealMaterial(row["index"]),
            is_stop=index - 1 == report["stop"], **shape,
        )
    optic.add_surface(index=len(report["elements"]) + 1)
    optic.set_aperture("EPD", report["paraxial"]["entrance_pupil"]["diameter"])
    optic.set_field_type("angle")
    for field in report["waves"]["fields"]:
        optic.add_field(y=field["field"])
    optic.add_wavelength(NM * 1e-3, is_primary=True)
    fill_stop(optic, report)
    return optic


def fill_stop(optic, report):
    """Widens the entrance pupil until the marginal ray on the axis meets the rim of the stop."""
    stop = report["stop"]
    rim = report["elements"][stop]["semi_diameter"]
    diameter = report["paraxial"]["entrance_pupil"]["diameter"]
    for _ in range(8):
        optic.trace_generic(0, 0, 0, 1, NM * 1e-3)
        height = abs(float(optic.surface_group.y[stop + 1][0]))
        diameter *= rim / height
        optic.set_aperture("EPD", diameter)


def paths(optic, field):
    """Optiland's waves ahead of the sphere for the rays of our fans, and ours."""
    import numpy as np
    from optiland.rays import RealRays

    fans = field["fans"][0]
    origin, direction = np.array(fans["origin"]), np.array(fans["direction"])
    across = {"tangential": np.cross(direction, [1.0, 0, 0]), "sagittal": np.array([1.0, 0, 0])}
    starts, waves = [origin], [0.0]
    for name, along in across.items():
        for ray in fans[name]:
            starts.append(origin + along * ray["pupil"] * fans["half_pupil"])
            waves.append(ray["waves"])
    starts = np.array(starts)
    ones = np.ones(len(starts))
    rays = RealRays(*starts.T, *(component * ones for component in direction), ones, NM * 1e-3 * ones)
    optic.surface_group.trace(rays)
    places = np.stack([rays.x, rays.y, rays.z], axis=1)
    directions = np.stack([rays.L, rays.M, rays.N], axis=1)
    # From the image plane back to the sphere, of a radius that is positive behind the pupil.
    way = places - np.array(field["sphere"]["centre"])
    b = np.einsum("ij,ij->i", way, directions)
    radius = field["sphere"]["radius"]
    half = np.copysign(np.sqrt(radius**2 - (np.einsum("ij,ij->i", way, way) - b * b)), radius)
    lengths = rays.opd - b - half
    return (lengths[0] - lengths) / (NM * 1e-6), np.array(waves), starts


def without_tilt(waves, places):
    import numpy as np

    columns = np.column_stack([np.ones(len(waves)), places - places.mean(axis=0)])
    return waves - columns @ np.linalg.lstsq(columns, waves, rcond=None)[0]


def compare(name):
    """The greatest differences in waves and in modulation by field."""
    import numpy as np
    from optiland.mtf import FFTMTF

    f_number, fields = CASES[name]
    report, written = ours(name, f_number, fields)
    optic = optic_of(report, written)
    optic.ray_tracer.set_aiming("iterative")
    for index, field in enumerate(report["waves"]["fields"]):
        theirs, waves, starts = paths(optic, field)
        off = np.abs(without_tilt(theirs - waves, starts)).max()
        mtf = FFTMTF(optic, fields=[(0.0, field["field"] / max(max(fields), 1e-9))],
                     num_rays=CELLS, grid_size=4 * CELLS)
        theirs = [np.asarray(values) for values in mtf.mtf[0]]
        axes = [np.asarray(mtf.freq_tang[0]), np.asarray(mtf.freq_sag[0])]
        worst = 0.0
        for row in field["mtf"]:
            for key, values, axis in zip(["tangential", "sagittal"], theirs, axes):
                if row["frequency"] < axis[-1]:
                    there = np.interp(row["frequency"], axis, values)
                    worst = max(worst, abs(there - row[key]))
        yield field["name"], field["rms"], off, worst


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("lenses", nargs="*", default=list(CASES), help="names in scenes/lenses")
    names = parser.parse_args().lenses
    program.enter("lens-peers", ["optiland==0.6.3"])
    failed = False
    print(f"{'lens':16}{'field':>8}{'RMS':>12}{'OPD off':>12}{'MTF off':>12}")
    for name in names:
        for field, rms, off, worst in compare(name):
            bad = off > WAVES or worst > MODULATION
            failed |= bad
            print(f"{name:16}{field:>8}{rms:12.4f}{off:12.2e}{worst:12.2e}{'  !' if bad else ''}")
    return failed


if __name__ == "__main__":
    sys.exit(main())
