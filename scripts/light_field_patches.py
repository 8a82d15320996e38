"""A second opinion of focused cameras: the raw pictures that the command ETENDUE takes of a wall of waves, on both sides
of the main lens' picture, put together by patches as Lumsdaine and Georgiev published it ("The focused plenoptic
camera", 2009, section 5), from the lengths of the camera alone: P x P pixels of each lenslet, turned about where it
sees the picture upside down, side by side. Against the closed form of the wall, and so is etendue's refocused picture,
which takes the mean of all lenslets."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

LEAST = 40.0  # dB
F, DISTANCE, PITCH, PIXEL = 35.0, 0.8, 0.09, 0.006  # mm, but for the distance of the wall (m)
PERIODS, TEXELS = 40, 64

command, folder = sys.argv[1], Path(sys.argv[2])
folder.mkdir(parents=True, exist_ok=True)
wave = 0.5 + 0.4 * np.outer(*[np.cos(2 * np.pi * (np.arange(TEXELS) + 0.5) / TEXELS)] * 2)
Image.fromarray(np.round(65535 * wave).astype(np.uint16)).save(folder / "wave.png")
picture = 1 / (1 / F - 1e-3 / DISTANCE)  # mm behind the main lens


def cubic(values, x, y):
    """Cubic convolution (Keys 1981) at pixels x, y."""
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    total = 0
    for row in range(-1, 3):
        for column in range(-1, 3):
            weight = 1
            for t in (np.abs(x - left - column), np.abs(y - top - row)):
                near, far = (1.5 * t - 2.5) * t * t + 1, ((-0.5 * t + 2.5) * t - 4) * t + 2
                weight = weight * np.where(t <= 1, near, far)
            total = total + weight * values[top + row, left + column]
    return total


def psnr(found, x, y, pixel, period):
    """Of pixels of a width (mm) at places x, y of the main lens' picture (mm), against the wall's own."""
    mean = np.sinc(pixel / period)  # a pixel's mean of a wave
    wall = 0.5 + 0.4 * mean**2 * np.cos(2 * np.pi * x / period) * np.cos(2 * np.pi * y / period)
    return -10 * np.log10(np.mean((found - wall) ** 2))


worst = np.inf
for a in (0.85, -0.85):  # from the picture to the lenslets (mm)
    b = PITCH * (picture + a) / (F / 2 - PITCH)  # images of the opening touch
    pixel = PIXEL * abs(a) / b  # of the sensor, in the picture
    period = 7 * pixel
    width = PERIODS * period * DISTANCE / picture
    scene = {
        "etendue": 1,
        "tracer": {"type": "flat"},
        "render": {"samples": 32},
        "camera": {
            "type": "light_field", "focal_length": F, "f_number": 2, "focus_distance": DISTANCE,
            "microlenses": {"pitch": PITCH, "picture_distance": a},
            "pose": {"from": [0, 0, 0], "look_at": [0, 0, -1]},
            "sensor": {"resolution": [300, 240], "pixel_pitch": 1e3 * PIXEL},
        },
        "materials": {"a": {"type": "matte", "color": {
            "image": "wave.png", "encoding": "linear", "repeat": [PERIODS, PERIODS]}}},
        "objects": [{"shape": "rectangle", "width": width, "height": width, "material": "a",
                     "transform": {"translate": [0, 0, -DISTANCE]}}],
    }
    (folder / "scene.json").write_text(json.dumps(scene))
    subprocess.run([command, "render", folder / "scene.json", "-o", folder / "out", "-q"], check=True)
    geometry = json.loads((folder / "out/geometry.json").read_text())
    raw, white, own = (np.load(folder / f"out/{name}.npy")[..., 1] for name in ("picture", "white", "refocused"))

    # Its own way: lenslets on their grid, a patch of the published width d b/a, which is made whole.
    count = round(PITCH * b / abs(a) / PIXEL)
    middle = (np.array(raw.shape[::-1]) - 1) / 2
    lenslets = np.stack(np.meshgrid(*[PITCH * np.arange(-n, n + 1) for n in (9, 7)]), -1)
    images = lenslets * (1 + b / (picture + a))  # away from the middle of the opening
    offsets = (np.arange(count) - (count - 1) / 2) / count
    x, y = np.meshgrid(offsets, offsets)
    # Patches are side by side where neighbours' ends are one point: the width of a patch in the picture is
    # that between the points in the middles of images.
    apart = PITCH * (1 - a / (picture + a))
    place = (lenslets - (images - lenslets) * a / b)[:, :, None, None] + apart * np.stack([x, y], -1)
    at = (lenslets[:, :, None, None] * (1 + b / a) - place * b / a) / PIXEL + middle
    found = cubic(raw, at[..., 0], at[..., 1]) / cubic(white, at[..., 0], at[..., 1])
    patches = psnr(found, place[..., 0], place[..., 1], pixel, period)

    size = own.shape[::-1]
    x, y = np.meshgrid(*[(np.arange(n) - (n - 1) / 2) * pixel for n in size])
    blended = psnr(own, x, y, pixel, period)
    told = geometry["patches"]
    lengths = [told["magnification"] / (b / a), told["patch_px"] / (PITCH * b / abs(a) / PIXEL),
               told["pixel_pitch_um"] / (1e3 * pixel)]
    assert np.allclose(lengths, 1, atol=1e-6), lengths
    print(f"picture {a} mm before the lenslets: patches of {count} pixels by their published formula {patches:.1f} dB, "
          f"refocused by etendue {blended:.1f} dB")
    worst = min(worst, patches, blended)
sys.exit(0 if worst >= LEAST else 1)
