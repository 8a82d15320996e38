"""Renders the pictures of docs/explanation/spectra.md and of the gallery's chart: the ColorChecker under three lamps by measured
curves, by colours of three numbers beside it, and the colour errors that these make.

    python3 benches/spectra.py

Pictures go to docs/images/spectra.
"""

import json
import os
import subprocess
import sys
import zlib
from pathlib import Path

import program

program.enter("peers", ["numpy"])

import numpy as np  # noqa: E402

ROOT = program.ROOT
OUT = ROOT / "out" / "spectra"
IMAGES = ROOT / "docs" / "images" / "spectra"
LAMPS = {
    "daylight": {"illuminant": "d65", "scale": 2.5},
    "three-band fluorescent": {"illuminant": "fl11", "scale": 0.9},
    "two lasers": [{"line": 532, "scale": 70}, {"line": 638, "scale": 120}],
}
FROM_XYZ = np.array([
    [3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
])


def main():
    etendue = os.environ.get("ETENDUE") or program.built("etendue")
    scene = json.loads((ROOT / "scenes" / "color-checker-xyz.json").read_text())
    for material in scene["materials"].values():
        material["color"]["file"] = str(ROOT / "scenes" / material["color"]["file"])
    # White behind the patches, by which the eye judges.
    scene["materials"]["white"] = {"type": "matte", "color": [1, 1, 1]}
    scene["objects"].append({
        "shape": "rectangle", "width": 20, "height": 20, "material": "white",
        "transform": {"translate": [0, 0, -1]},
    })
    lines = ["| lamp | ΔE₀₀ of colours of three numbers: mean | worst |", "|---|---|---|"]
    for number, (lamp, irradiance) in enumerate(LAMPS.items()):
        scene["lights"][0]["irradiance"] = irradiance
        curves = xyz(etendue, scene, f"{number}-curves")
        rgb = json.loads(json.dumps(scene))
        for name, look in looks(etendue).items():
            rgb["materials"][name]["color"] = look
        colours = xyz(etendue, rgb, f"{number}-rgb")
        save(number, curves, colours)
        off = np.array([
            delta_e(*(lab(image[y, x], image[0, 0]) for image in (curves, colours)))
            for y, x in middles(curves)
        ])
        lines.append(f"| {lamp} | {off.mean():.1f} | {off.max():.1f} |")
    print("\n".join(lines))


def looks(etendue):
    """The linear sRGB of each patch under D65, as a picture's author would pick it."""
    table = ROOT / "scenes" / "spectra" / "colorchecker.csv"
    said = subprocess.run(
        [etendue, "spectrum", table, "--under", "d65", "--json"], check=True, capture_output=True
    )
    light = json.loads(subprocess.run(
        [etendue, "spectrum", "d65", "--json"], check=True, capture_output=True
    ).stdout)[0]["xyz"][1]
    found = {row["name"]: FROM_XYZ @ (np.array(row["xyz"]) / light) for row in json.loads(said.stdout)}
    return {name: np.clip(rgb, 0, 1).tolist() for name, rgb in found.items()}


def xyz(etendue, scene, name):
    folder = OUT / name
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "scene.json"
    path.write_text(json.dumps(scene))
    subprocess.run(
        [etendue, "render", path, "-o", folder / "out", "--outputs", "npy", "--allow-outside", "--quiet"],
        check=True, stdout=sys.stderr,
    )
    return np.load(folder / "out" / "raw.npy").astype(float)


def middles(image):
    height, width = image.shape[:2]
    scale = height / 4.2
    return [
        (int(height / 2 - (1.5 - k // 6) * scale), int(width / 2 + (k % 6 - 2.5) * scale))
        for k in range(24)
    ]


def lab(xyz, white):
    t = xyz / white
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t * (29 / 6) ** 2 / 3 + 4 / 29)
    return 116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])


def delta_e(one, other):
    """CIEDE2000 (Sharma, Wu and Dalal 2005)."""
    (l1, a1, b1), (l2, a2, b2) = one, other
    c = (np.hypot(a1, b1) + np.hypot(a2, b2)) / 2
    g = 0.5 * (1 - np.sqrt(c**7 / (c**7 + 25.0**7)))
    a1, a2 = (1 + g) * a1, (1 + g) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a)) % 360 for a, b in ((a1, b1), (a2, b2)))
    turn = (h2 - h1 + 180) % 360 - 180
    dh = 2 * np.sqrt(c1 * c2) * np.sin(np.radians(turn / 2))
    lm, cm, hm = (l1 + l2) / 2, (c1 + c2) / 2, (h1 + turn / 2) % 360
    cos = lambda x: np.cos(np.radians(x))
    t = 1 - 0.17 * cos(hm - 30) + 0.24 * cos(2 * hm) + 0.32 * cos(3 * hm + 6) - 0.2 * cos(4 * hm - 63)
    sl = 1 + 0.015 * (lm - 50) ** 2 / np.sqrt(20 + (lm - 50) ** 2)
    sc, sh = 1 + 0.045 * cm, 1 + 0.015 * cm * t
    rotation = -2 * np.sqrt(cm**7 / (cm**7 + 25.0**7)) * np.sin(
        np.radians(60 * np.exp(-(((hm - 275) / 25) ** 2)))
    )
    l, c, h = (l2 - l1) / sl, (c2 - c1) / sc, dh / sh
    return np.sqrt(l * l + c * c + h * h + rotation * c * h)


def save(number, curves, colours):
    """Curves above, colours of three numbers below: sRGB, white as the eye takes it (von Kries in XYZ)."""
    d65 = np.array([0.95047, 1.0, 1.08883])
    both = np.concatenate([curves, colours]) / np.maximum(curves[0, 0], 1) * d65
    linear = np.clip(both @ FROM_XYZ.T, 0, 1)
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    rows = np.round(255 * shown).astype(np.uint8)
    IMAGES.mkdir(parents=True, exist_ok=True)
    height, width = rows.shape[:2]
    packed = zlib.compress(b"".join(b"\0" + row.tobytes() for row in rows), 9)

    def chunk(kind, content):
        check = zlib.crc32(kind + content).to_bytes(4, "big")
        return len(content).to_bytes(4, "big") + kind + content + check

    header = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([8, 2, 0, 0, 0])
    (IMAGES / f"chart-{number}.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    )


if __name__ == "__main__":
    main()
