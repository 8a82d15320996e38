"""The references of `curves.rs`: sums over wavelengths with numpy, of tables by colour-science (PyPI
`colour-science`, 0.4.7), straight lines between their points on both sides.

    python3 curves.py

writes `colorchecker_lab.csv` (24 patches under eight lights, by sums of 1 nm) and fills in the electrons of
`electrons.json` (sums of 0.01 nm).
"""

import csv
import json
import pathlib

import colour
import numpy as np

HERE = pathlib.Path(__file__).parent
H, C = 6.62607015e-34, 299792458.0


def table(name):
    curve = colour.SDS_ILLUMINANTS[name]
    return curve.wavelengths, curve.values / curve[560]


def planck(kelvin, nm):
    return nm**-5.0 / np.expm1(1.438776877e7 / (nm * kelvin))


def lamp(spec, nm):
    """A lamp of the scene file at wavelengths (nm)."""
    if isinstance(spec, list):
        return sum(lamp(one, nm) for one in spec)
    scale = spec.get("scale", 1.0)
    if "line" in spec:
        return scale * np.maximum(0.0, 1.0 - np.abs(nm - spec["line"]) / spec["width"])
    name = spec["illuminant"]
    if isinstance(name, dict):
        kelvin = name["black_body"]
        return scale * planck(kelvin, nm) / planck(kelvin, 560.0)
    if name == "a":
        # CIE 015:2018, equation 4.1, which holds beyond the table's 830 nm as well.
        a = lambda nm: nm**-5.0 / np.expm1(1.435e7 / (2848.0 * nm))
        return scale * a(nm) / a(560.0)
    words = {"a": "A", "d50": "D50", "d65": "D65"}
    name = words.get(name, name.upper().replace("_", "-"))
    return scale * np.interp(nm, *table(name), left=0.0, right=0.0)


def patches():
    with open(HERE / "../../../../scenes/spectra/colorchecker.csv") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    values = np.array(rows[1:], dtype=float)
    return rows[0][1:], values[:, 0], values[:, 1:]


LIGHTS = {
    "a": {"illuminant": "a"},
    "d50": {"illuminant": "d50"},
    "d65": {"illuminant": "d65"},
    "fl2": {"illuminant": "fl2"},
    "fl11": {"illuminant": "fl11"},
    "led_b3": {"illuminant": "led_b3"},
    "lasers": [{"line": 532, "width": 1, "scale": 1}, {"line": 638, "width": 1, "scale": 1.5}],
    "three_lasers": [
        {"line": 460, "width": 1}, {"line": 532, "width": 1}, {"line": 638, "width": 1, "scale": 1.5}
    ],
}


def lab():
    nm = np.arange(360.0, 831.0)
    cmfs = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    observer = np.array([cmfs[x] for x in nm])
    names, at, values = patches()
    with open(HERE / "colorchecker_lab.csv", "w") as out:
        out.write("# CIELAB of the patches under each light, white being the light itself: curves.py\n")
        out.write("light,patch,L,a,b\n")
        for light, spec in LIGHTS.items():
            power = lamp(spec, nm)
            white = power @ observer
            for name, column in zip(names, values.T):
                xyz = (power * np.interp(nm, at, column)) @ observer / white[1]
                xy = colour.XYZ_to_xy(white / white[1])
                found = colour.XYZ_to_Lab(xyz, xy)
                out.write(f"{light},{name},{found[0]:.6f},{found[1]:.6f},{found[2]:.6f}\n")


def electrons():
    path = HERE / "electrons.json"
    cases = json.loads(path.read_text())
    names, at, values = patches()
    for case in cases:
        nm = np.arange(300.0, 1200.0, 0.01) + 0.005
        curve = lambda points: np.interp(nm, *np.array(points, dtype=float).T, left=0.0, right=0.0)
        light = lamp(case["lamp"], nm) / np.pi
        light *= np.interp(nm, at, values[:, names.index(case["patch"])])
        rate = light * curve(case["qe"]) * curve(case["filter"]) * nm * 1e-9 / (H * C)
        # A pixel of 5 um for 10 ms.
        case["electrons"] = float(f"{rate.sum() * 0.01 * 25e-12 * 0.01:.8g}")
    lines = ",\n".join("  " + json.dumps(case) for case in cases)
    path.write_text(f"[\n{lines}\n]\n")


if __name__ == "__main__":
    lab()
    electrons()
