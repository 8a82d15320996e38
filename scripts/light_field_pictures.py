"""The pictures of docs/how-to/light-fields.md: FOLDER holds what the page's Python left, IMAGES is where they go."""

import sys

import numpy as np
from PIL import Image


def save(values, scale, path):
    """Linear light as an sRGB picture, each pixel `scale` times as large."""
    x = np.clip(values, 0, 1)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    encoded = (255 * encoded).round().astype(np.uint8)
    Image.fromarray(encoded.repeat(scale, 0).repeat(scale, 1)).save(path)


folder, images = sys.argv[1:]
corner = (slice(180, 280), slice(400, 540))
for name, stem in [("raw", "picture"), ("white", "white")]:
    save(np.load(f"{folder}/out/{stem}.npy")[corner], 3, f"{images}/light-field-{name}.png")
for name, picture in zip(["near", "focus", "far"], np.load(f"{folder}/refocused.npy")):
    save(picture, 6, f"{images}/light-field-{name}.png")
save(np.load(f"{folder}/focused/picture.npy")[corner], 3, f"{images}/light-field-focused-raw.png")
for name in ["near", "focus", "far"]:
    save(np.load(f"{folder}/focused-{name}.npy"), 3, f"{images}/light-field-focused-{name}.png")
