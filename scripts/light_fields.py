"""The pictures of docs/how-to/light-fields.md, and second opinions of its cameras, with numpy and Pillow:

    light_fields.py pictures FOLDER IMAGES    the page's pictures, of what its Python left in FOLDER
    light_fields.py patches ETENDUE FOLDER    focused cameras, put together by their published formula
    light_fields.py views FOLDER              views that plenopticam 0.9.3 cuts out of FOLDER's raw picture

The exit code of the opinions is 1 where pictures agree by less than 40 dB.
"""

import json
import subprocess
import sys
import tempfile
import types
import warnings
from pathlib import Path

import numpy as np
from PIL import Image

LEAST = 40.0  # dB


def save(values, scale, path):
    """Linear light as an sRGB picture, each pixel `scale` times as large."""
    x = np.clip(values, 0, 1)
    encoded = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    encoded = (255 * encoded).round().astype(np.uint8)
    Image.fromarray(encoded.repeat(scale, 0).repeat(scale, 1)).save(path)


def pictures(folder, images):
    """Writes the page's pictures."""
    corner = (slice(180, 280), slice(400, 540))
    for name, stem in [("raw", "picture"), ("white", "white")]:
        save(np.load(f"{folder}/out/{stem}.npy")[corner], 3, f"{images}/light-field-{name}.png")
    for name, picture in zip(["near", "focus", "far"], np.load(f"{folder}/refocused.npy")):
        save(picture, 6, f"{images}/light-field-{name}.png")
    save(np.load(f"{folder}/focused/picture.npy")[corner], 3, f"{images}/light-field-focused-raw.png")
    for name in ["near", "focus", "far"]:
        save(np.load(f"{folder}/focused-{name}.npy"), 3, f"{images}/light-field-focused-{name}.png")


# The focused cameras: in mm, but for the distance of the wall (m).
F, DISTANCE, PITCH, PIXEL = 35.0, 0.8, 0.09, 0.006
PERIODS, TEXELS = 40, 64


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


def focused(a, width):
    """The scene of a focused camera before a wall of waves, its picture `a` mm before the lenslets."""
    return {
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


def patches(command, folder):
    """Raw pictures of a wall of waves, on both sides of the main lens' picture, put together by patches as Lumsdaine and
    Georgiev published it ("The focused plenoptic camera", 2009, section 5), from the lengths of the camera alone: P x P
    pixels of each lenslet, turned about where it sees the picture upside down, side by side. Against the closed form of
    the wall, and so is etendue's refocused picture, which takes the mean of all lenslets."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    wave = 0.5 + 0.4 * np.outer(*[np.cos(2 * np.pi * (np.arange(TEXELS) + 0.5) / TEXELS)] * 2)
    Image.fromarray(np.round(65535 * wave).astype(np.uint16)).save(folder / "wave.png")
    picture = 1 / (1 / F - 1e-3 / DISTANCE)  # mm behind the main lens
    worst = np.inf
    for a in (0.85, -0.85):  # from the picture to the lenslets (mm)
        b = PITCH * (picture + a) / (F / 2 - PITCH)  # images of the opening touch
        pixel = PIXEL * abs(a) / b  # of the sensor, in the picture
        period = 7 * pixel
        (folder / "scene.json").write_text(json.dumps(focused(a, PERIODS * period * DISTANCE / picture)))
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
        by_patches = psnr(found, place[..., 0], place[..., 1], pixel, period)

        x, y = np.meshgrid(*[(np.arange(n) - (n - 1) / 2) * pixel for n in own.shape[::-1]])
        blended = psnr(own, x, y, pixel, period)
        written = geometry["patches"]
        lengths = [written["magnification"] / (b / a), written["patch_px"] / (PITCH * b / abs(a) / PIXEL),
                   written["pixel_pitch_um"] / (1e3 * pixel)]
        assert np.allclose(lengths, 1, atol=1e-6), lengths
        print(f"picture {a} mm before the lenslets: patches of {count} pixels by their published formula {by_patches:.1f} dB, "
              f"refocused by etendue {blended:.1f} dB")
        worst = min(worst, by_patches, blended)
    return worst


class Absent(types.ModuleType):
    """A module that is imported and never used."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return Absent(name)


def cut_by_plenopticam(raw, geometry):
    """The views that plenopticam cuts, at the lenslets' centres of geometry.json. Square grids."""
    warnings.filterwarnings("ignore")
    for name in ["depthy", "depthy.misc", "depthy.lightfield", "depthy.lightfield.epi_depth",
                 "color_matcher", "color_matcher.top_level"]:
        sys.modules[name] = Absent(name)

    from plenopticam.cfg import PlenopticamConfig
    from plenopticam.lfp_aligner import LfpAligner
    from plenopticam.lfp_extractor.lfp_cropper import LfpCropper
    from plenopticam.lfp_extractor.lfp_rearranger import LfpRearranger

    config = PlenopticamConfig()
    config.default_values()
    settings = config.params
    place = tempfile.mkdtemp()
    settings.update({config.lfp_path: f"{place}/raw.png", config.cal_path: place, config.smp_meth: "local"})
    settings.update({config.ptc_leng: geometry["views"], config.opt_prnt: False, config.opt_dbug: False})
    for option in ["vign", "cont", "colo", "awb_", "sat_", "refo", "refi", "lier", "dpth", "rota", "arti"]:
        settings[getattr(config, f"opt_{option}")] = False
    centres = np.array(geometry["centres_px"])
    rows, columns = np.mgrid[0 : centres.shape[0], 0 : centres.shape[1]]
    config.calibs[config.mic_list] = (
        np.stack([centres[..., 1], centres[..., 0], rows, columns], -1).reshape(-1, 4).tolist()
    )
    config.calibs[config.pat_type] = "rec"
    config.calibs[config.ptc_mean] = [geometry["pitch_px"]] * 2

    aligner = LfpAligner(raw, cfg=config)
    aligner.main()
    cropper = LfpCropper(lfp_img_align=aligner.lfp_img, cfg=config)
    cropper.main()
    rearranger = LfpRearranger(cropper.lfp_img_align, cfg=config)
    rearranger.main()
    return rearranger.vp_img_arr.astype(float)


def views(folder):
    """Views that plenopticam cuts out of the raw picture of a folder, against the reference views."""
    geometry = json.loads(Path(folder, "geometry.json").read_text())
    raw = np.load(f"{folder}/picture.npy").astype(float)
    reference = np.load(f"{folder}/reference.npy").astype(float)
    found = cut_by_plenopticam(raw, geometry)
    assert found.shape == reference.shape, (found.shape, reference.shape)

    # It scales what it writes to 16 bits: back by least squares.
    pairs = np.stack([found.ravel(), np.ones(found.size)], 1)
    scale, shift = np.linalg.lstsq(pairs, reference.ravel(), rcond=None)[0]
    errors = ((found * scale + shift - reference) ** 2).mean((2, 3, 4))
    decibels = -10 * np.log10(errors)
    print(f"plenopticam 0.9.3: worst view {decibels.min():.1f} dB, median {np.median(decibels):.1f} dB")
    return decibels.min()


if __name__ == "__main__":
    task, *words = sys.argv[1:]
    worst = {"pictures": pictures, "patches": patches, "views": views}[task](*words)
    sys.exit(0 if worst is None or worst >= LEAST else 1)
