"""Second opinions of other programs, which tests of lenses hold ours to: optiland 0.6.3 and tmm 0.2.0 (S. Byrnes), from PyPI.

    python3 -m venv out/optiland && out/optiland/bin/pip install optiland==0.6.3 tmm==0.2.0
    out/optiland/bin/python scripts/lens_opinions.py rays crates/optics/tests/optics/optiland
    out/optiland/bin/python scripts/lens_opinions.py coatings crates/optics/tests/data/coatings.json

`rays` writes `../schmidt-cassegrain-spots.json`, focal length and spots of a published telescope, and a file a lens of all shapes
that both programs have: the lens as optiland saves it, and rays by where they start (mm, z from the first vertex), their
direction, and where they end on the image, in the coordinates of the whole lens. `crates/optics/tests/optics/second_opinion.rs` reads
the lenses and holds the rays to 1e-10 mm. `coatings` writes transmittance and reflectance of coatings."""

import json
import math
import sys
import warnings
from pathlib import Path

import numpy as np
from optiland.coordinate_system import CoordinateSystem
from optiland.materials import IdealMaterial, Material
from optiland.optic import Optic
from optiland.phase.linear_grating import LinearGratingPhaseProfile
from optiland.phase.radial import RadialPhaseProfile
from optiland.physical_apertures import RadialAperture
from optiland.rays import RealRays

warnings.simplefilter("ignore", DeprecationWarning)
GLASS = 1.5168
# Newton's method of optiland ends at this length (mm).
TIGHT = {"tol": 1e-14, "max_iter": 200}


def lens(front, back=None, image=60.0, **system):
    """A lens of 5 mm of glass: `front` and `back` are what its surfaces have beside their places."""
    optic = Optic(system.get("name"))
    add = optic.surfaces.add
    add(index=0, thickness=np.inf)
    add(index=1, thickness=5.0, material=IdealMaterial(GLASS), is_stop=True, **front)
    add(index=2, thickness=image, **(back or {"radius": -60.0}))
    add(index=3)
    return finished(optic)


def finished(optic, pupil=16.0):
    optic.set_aperture("EPD", pupil)
    optic.fields.set_type("angle")
    optic.fields.add(y=0)
    optic.wavelengths.add(0.55, is_primary=True)
    return optic


def cassegrain():
    optic = Optic("Cassegrain, 200 mm f/10")
    add = optic.surfaces.add
    add(index=0, thickness=np.inf)
    add(index=1, radius=-1200.0, conic=-1.0, thickness=-450.0, material="mirror", is_stop=True,
        aperture=RadialAperture(r_max=100.0, r_min=20.0))
    add(index=2, radius=-400.0, conic=-2.777777777777778, thickness=600.0, material="mirror")
    add(index=3)
    return finished(optic, 200.0)


def placed(turns, shift, back=(0.0, 0.0, 0.0)):
    """A singlet whose front is turned about x and y and shifted."""
    optic = Optic("tilted and decentred")
    add = optic.surfaces.add
    add(index=0, x=0.0, y=0.0, z=-np.inf)
    add(index=1, x=0.0, y=0.0, z=0.0, radius=80.0, material=IdealMaterial(GLASS), is_stop=True)
    add(index=2, x=shift[0], y=shift[1], z=5.0, rx=turns[0], ry=turns[1], radius=-60.0, conic=-0.4)
    add(index=3, x=back[0], y=back[1], z=60.0, rx=back[2])
    return finished(optic)


def folded():
    optic = Optic("lens and flat mirror at 45 degrees")
    add = optic.surfaces.add
    add(index=0, x=0.0, y=0.0, z=-np.inf)
    add(index=1, x=0.0, y=0.0, z=0.0, radius=80.0, material=IdealMaterial(GLASS), is_stop=True)
    add(index=2, x=0.0, y=0.0, z=5.0, radius=-60.0)
    add(index=3, x=0.0, y=0.0, z=35.0, rx=np.pi / 4, material="mirror")
    add(index=4, x=0.0, y=30.0, z=35.0, rx=np.pi / 2 * 3)
    return finished(optic)


def published_telescope():
    """OpticStudio's sample "Schmidt-Cassegrain spider obscuration", in inches as ROBAST's tutorial has it (A. Okumura et
    al., Astropart. Phys. 76, 38 (2016)), in mm."""
    inch = 25.4
    optic = Optic("Schmidt-Cassegrain")
    add = optic.surfaces.add
    add(index=0, thickness=np.inf)
    add(index=1, thickness=0.65 * inch, material=Material("N-BK7", "schott"))
    add(index=2, radius=-inch / 8.721454939626e-5, thickness=72 * inch, is_stop=True, surface_type="even_asphere",
        coefficients=[0.0, 3.68090959e-7 / inch**3, 2.73643352e-11 / inch**5, 3.20036892e-14 / inch**7], **TIGHT)
    add(index=3, radius=-inch / 1.049567394559e-2, conic=0.077235, thickness=-30.86635 * inch, material="mirror")
    add(index=4, radius=-inch / 2.01270013787e-2, thickness=50.6706488 * inch, material="mirror")
    add(index=5)
    return finished(optic, 24 * inch)


def spots_of_telescope():
    """Focal length and bundles by field (degrees) and wavelength (nm): 12 rays at each of 5 heights, from a plane
    before the lens, and the root mean square of where they end from their mean."""
    optic, spots = published_telescope(), []
    turns = 2 * np.pi * np.arange(12) / 12
    radii = np.array([125.0, 170.0, 215.0, 260.0, 300.0])
    x, y = (np.outer(radii, part).ravel() for part in (np.cos(turns), np.sin(turns)))
    for field in (0.0, 0.1):
        for wavelength in (486.1, 587.6, 656.33):
            m = np.full_like(x, np.sin(np.radians(field)))
            z = np.full_like(x, -10.0)
            rays = RealRays(x, y - 10 * m, z, 0 * m, m, np.sqrt(1 - m**2), np.ones_like(x), np.full_like(x, 1e-3 * wavelength))
            optic.surfaces.trace(rays)
            across = np.hypot(rays.x - rays.x.mean(), rays.y - rays.y.mean())
            spots.append({"field": field, "wavelength": wavelength, "centroid": float(rays.y.mean()),
                          "rms": float(np.sqrt((across**2).mean()))})
    return {"efl": float(optic.paraxial.f2()), "spots": spots}


LENSES = {
    "cassegrain": cassegrain(),
    "conic": lens({"radius": 50.0, "conic": -0.7}),
    "even_asphere": lens({"radius": 50.0, "conic": -0.7, "surface_type": "even_asphere",
                          "coefficients": [1e-4, -2e-6, 3e-9], **TIGHT}),
    "odd_asphere": lens({"radius": 50.0, "conic": 0.2, "surface_type": "odd_asphere",
                         "coefficients": [0.0, 1e-4, -2e-5, 1e-6, 0.0, -3e-9], **TIGHT}),
    "toroid": lens({"radius_x": 70.0, "radius_y": 45.0, "conic": -0.3, "surface_type": "toroidal",
                    "toroidal_coeffs_poly_y": [0.0, 2e-6, -1e-9], **TIGHT}),
    "cylinder": lens({"radius_x": np.inf, "radius_y": 45.0, "surface_type": "toroidal", **TIGHT}),
    "zernike_fringe": lens({"radius": 50.0, "conic": -0.2, "surface_type": "zernike", "norm_radius": 12.0,
                            "zernike_type": "fringe",
                            "coefficients": [0, 1e-3, -2e-3, 3e-3, 4e-3, -5e-3, 2e-3, 1e-3, 3e-3, 1e-3, -1e-3],
                            **TIGHT}),
    "zernike_noll": lens({"radius": 50.0, "surface_type": "zernike", "norm_radius": 12.0, "zernike_type": "noll",
                          "coefficients": [0, 1e-3, -2e-3, 3e-3, 4e-3, -5e-3, 2e-3, 1e-3, 3e-3, 1e-3, -1e-3],
                          **TIGHT}),
    "chebyshev": lens({"radius": 50.0, "conic": 0.1, "surface_type": "chebyshev", "norm_x": 15.0, "norm_y": 14.0,
                       "coefficients": [[0, 2e-3, 1e-3], [3e-3, -1e-3, 2e-3], [4e-3, 1e-3, -2e-3]], **TIGHT}),
    "polynomial": lens({"radius": 50.0, "conic": 0.1, "surface_type": "polynomial",
                        "coefficients": [[0, 1e-3, 1e-4], [2e-3, -1e-4, 1e-5], [3e-4, 2e-5, -1e-6]], **TIGHT}),
    "radial_phase": lens({"radius": 50.0, "phase_profile": RadialPhaseProfile([-20.0, 0.03])}),
    "linear_grating": lens({"radius": np.inf, "phase_profile": LinearGratingPhaseProfile(0.02, np.pi / 3, 1)}),
    "tilted": placed((0.05, -0.08), (0.7, -0.4)),
    "tilted_image": placed((0.0, 0.03), (0.0, 0.5), (0.3, -0.2, 0.1)),
    "folded": folded(),
}


def rays_of(name):
    """Places and directions that all pass."""
    reach = 80.0 if name == "cassegrain" else 7.0
    steps = np.array([-0.9, -0.35, 0.3, 0.8])
    x, y = (reach * a.ravel() for a in np.meshgrid(steps, steps))
    slope = 1e-3 if name == "cassegrain" else 0.04
    l, m = slope * 0.7 * np.ones_like(x), -slope * np.ones_like(x)
    return x, y, np.full_like(x, -10.0), l, m, np.sqrt(1 - l**2 - m**2)


def rays(folder):
    """Writes the lenses and their rays."""
    folder = Path(folder)
    (folder / "../schmidt-cassegrain-spots.json").write_text(json.dumps(spots_of_telescope(), indent=1) + "\n")
    for name, optic in LENSES.items():
        x, y, z, l, m, n = rays_of(name)
        start = list(zip(x.tolist(), y.tolist(), z.tolist(), l.tolist(), m.tolist(), n.tolist()))
        traced = RealRays(x, y, z, l, m, n, np.ones_like(x), 0.55 * np.ones_like(x))
        optic.surfaces.trace(traced)
        if not np.isfinite(traced.x).all():
            raise SystemExit(f"{name}: optiland lost rays")
        saved = {"optic": optic.to_dict(), "rays": [
            {"origin": s[:3], "direction": s[3:], "end": end}
            for s, *end in zip(start, traced.x.tolist(), traced.y.tolist(), traced.z.tolist())
        ]}
        as_list = lambda value: value.tolist() if hasattr(value, "tolist") else value.item()
        (folder / f"{name}.json").write_text(json.dumps(saved, default=as_list) + "\n")
        print(name, len(start))


# Index and extinction before, of each layer with its thickness (nm), and behind.
STACKS = [
    ([1.0, 0.0], [], [1.5168, 0.0]),
    ([1.0, 0.0], [[1.38, 0.0, 99.64]], [1.5168, 0.0]),
    ([1.0, 0.0], [[1.38, 0.0, 99.64], [2.1, 0.0, 130.9], [1.62, 0.0, 84.9]], [1.5168, 0.0]),
    ([1.5168, 0.0], [[2.35, 0.0, 58.5], [1.46, 0.0, 94.2], [2.35, 0.0, 58.5], [1.46, 0.0, 94.2]], [1.0, 0.0]),
    ([1.0, 0.0], [[1.46, 0.0, 94.0]], [0.958, 6.69]),
    ([1.0, 0.0], [[2.35, 0.0, 58.5], [1.46, 0.0, 94.2], [2.35, 0.0, 58.5], [1.46, 0.0, 94.2]], [0.05, 3.6]),
    ([1.0, 0.0], [[1.7, 0.02, 350.0], [2.0, 0.1, 40.0]], [1.5168, 0.0]),
]


def coatings(path):
    """Writes what stacks reflect and let through, by angle and wavelength."""
    from tmm import coh_tmm

    rows = []
    for before, layers, behind in STACKS:
        for wavelength in [430.0, 550.0, 700.0]:
            for angle in [0.0, 15.0, 40.0, 75.0]:
                n = [complex(*before), *[complex(a, b) for a, b, _ in layers], complex(*behind)]
                d = [math.inf, *[d for _, _, d in layers], math.inf]
                theta = math.radians(angle)
                if behind[1] == 0.0 and abs(before[0] * math.sin(theta) / behind[0]) >= 1.0:
                    continue
                both = [coh_tmm(kind, n, d, theta, wavelength) for kind in "sp"]
                rows.append({
                    "before": before[0], "layers": layers, "behind": behind,
                    "wavelength": wavelength, "angle": angle,
                    "reflectance": sum(float(one["R"]) for one in both) / 2.0,
                    "transmittance": sum(float(one["T"]) for one in both) / 2.0,
                })
    Path(path).write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")


if __name__ == "__main__":
    task, path = sys.argv[1:]
    {"rays": rays, "coatings": coatings}[task](path)
