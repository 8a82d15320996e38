"""A depth camera with its errors, judged against exact depth.

    python depth_camera.py [FOLDER]

A pair of cameras looks at a scene on which a projector throws random dots, as active-stereo cameras do. Each picture goes
through a sensor with its noise; disparities come from matching blocks along the rows, to 1/16 of a pixel; what light does not
reach, what one camera alone sees and what is seen at too flat an angle has none. The depth is compared with the exact one of
the left camera, by kind of pixel. With a folder, depth.png and errors.png are written there.
"""

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

import etendue

WIDTH, HEIGHT = 424, 320
FOCAL, BASELINE = 380.0, 0.075     # px, m
STEPS = 16                         # disparities to 1/16 px, as block matchers of such cameras give them
FARTHEST = 4.0                     # m: less disparity than that is not believed


def rig(folder):
    """The scene of arrays and shapes, with a projector between two cameras."""
    dots = np.random.default_rng(11).random((180, 240)) < 0.3
    cv2.imwrite(str(folder / "dots.png"), np.where(dots, 255, 25).astype(np.uint8))
    return etendue.Scene(
        folder=folder,
        camera={
            "type": "pinhole",
            "intrinsics": {"fx": FOCAL, "fy": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2, "pixel_origin": "corner"},
            "pose": {"from": [0, 0.5, 1.6], "look_at": [0, 0.25, 0]},
            "sensor": {"resolution": [WIDTH, HEIGHT]},
        },
        tracer={"type": "direct"},
        layers=["depth", "incidence"],
        objects=[
            {"shape": "sphere", "radius": 0.25, "material": "clay", "transform": {"translate": [-0.3, 0.25, 0]}},
            {"shape": "box", "size": [0.3, 0.5, 0.3], "material": "clay", "transform": {"translate": [0.35, 0.25, -0.2], "rotate": [0, 1, 0, 35]}},
            {"shape": "box", "size": [0.2, 0.2, 0.2], "material": "dark", "transform": {"translate": [0.05, 0.1, 0.35], "rotate": [0, 1, 0, 10]}},
            {"shape": "rectangle", "width": 4, "height": 4, "material": "clay", "transform": {"rotate": [1, 0, 0, -90]}},
            {"shape": "rectangle", "width": 4, "height": 3, "material": "clay", "transform": {"translate": [0, 1.5, -1]}},
        ],
        materials={
            "clay": {"type": "matte", "color": [0.55, 0.55, 0.55]},
            "dark": {"type": "matte", "color": [0.001, 0.001, 0.001]},
        },
        lights=[
            {
                "type": "projector", "at": [0, 0.5, 1.6], "look_at": [0, 0.25, 0], "fov": 62, "aspect": 1.333,
                "image": {"image": "dots.png", "encoding": "linear", "filter": "nearest"}, "intensity": [14, 14, 14],
            },
            {"type": "environment", "radiance": [0.01, 0.01, 0.01]},
        ],
        render={"samples": 8},
        frames={
            "type": "rig",
            "path": [{"camera.pose": {"from": [0, 0.5, 1.6], "look_at": [0, 0.25, 0]}}],
            "cameras": [{"name": "left", "at": [-BASELINE / 2, 0, 0]}, {"name": "right", "at": [BASELINE / 2, 0, 0]}],
        },
    )  # fmt: skip


def exposed(picture, sensor, seed):
    """The picture of light through a sensor, as 8 bits: 1 of radiance is 12 000 electrons."""
    raw = sensor.expose(12000 * picture.mean(axis=2), seed=seed).astype(np.float32)
    facts = sensor.facts
    return np.clip((raw - facts["black_level"]) / (facts["white_level"] - facts["black_level"]) * 255, 0, 255).astype(np.uint8)


def matched(left, right):
    """Disparity of the left picture (px), NaN where there is none: semi-global matching, and its check from the right."""
    matcher = cv2.StereoSGBM_create(
        minDisparity=0, numDisparities=64, blockSize=5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=1, uniquenessRatio=12,
        speckleWindowSize=60, speckleRange=1,
    )
    disparity = matcher.compute(left, right).astype(np.float64) / STEPS
    # A mean of fewer than 2 levels of 255 around a pixel tells nothing.
    dark = cv2.blur(left, (9, 9)) < 2
    return np.where((disparity > FOCAL * BASELINE / FARTHEST) & ~dark, disparity, np.nan)


def judged(depth, shot, occluded):
    """Rows of kind, pixels, share that is measured, median and 95th percentile of the error (mm), all by the exact depth."""
    truth, incidence = shot["depth"], np.degrees(shot["incidence"])
    seen = np.isfinite(truth)
    kinds = {
        "facing, lit, seen by both": seen & (incidence < 60) & ~occluded,
        "at 60 to 80 degrees": seen & (incidence >= 60) & (incidence < 80) & ~occluded,
        "grazing, above 80 degrees": seen & (incidence >= 80) & ~occluded,
        "hidden from the right": seen & occluded,
    }
    rows = {}
    for kind, mask in kinds.items():
        has = mask & np.isfinite(depth)
        error = 1000 * np.abs(depth - truth)[has]
        quantiles = np.percentile(error, [50, 95]) if error.size else [np.nan, np.nan]
        rows[kind] = (int(mask.sum()), has.sum() / max(mask.sum(), 1), *quantiles)
    return rows


def main(out=None):
    with tempfile.TemporaryDirectory() as folder:
        scene = rig(Path(folder))
        scene["layers"] = ["depth", "incidence", "disparity", "ids", {"type": "occlusion", "to": {"cameras": 1}}]
        left, right = scene.frames()
        sensor = etendue.Sensor("imx250")
        pictures = [exposed(shot["picture"], sensor, seed) for seed, shot in enumerate([left, right])]
    disparity = matched(*pictures)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = FOCAL * BASELINE / disparity
    hidden = (left["occlusion_camera_hidden"] > 0) | (left["occlusion_camera_outside"] > 0)
    rows = judged(depth, left, hidden)
    off = np.abs(disparity - left["disparity"])[np.isfinite(disparity) & np.isfinite(left["disparity"]) & ~hidden]
    print(f"{'':28} {'pixels':>7} {'measured':>9} {'median':>8} {'95 %':>8}")
    for kind, (count, share, median, most) in rows.items():
        print(f"{kind:28} {count:7} {share:9.0%} {median:5.1f} mm {most:5.1f} mm")
    dark = (left["id_object"] == 3) & ~hidden
    print(f"{'the black box':28} {int(dark.sum()):7} {np.isfinite(depth)[dark].mean():9.0%}")
    # One pixel of disparity at depth z is z² / (f b).
    z = np.median(left["depth"])
    print(f"disparity: median error {np.median(off):.3f} px; a pixel at {z:.2f} m is {1000 * z * z / (FOCAL * BASELINE):.0f} mm")
    if out is not None:
        out = Path(out)
        out.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(out / "depth.png"), np.nan_to_num(255 * (1 - depth / FARTHEST)).clip(0, 255).astype(np.uint8))
        error = np.nan_to_num(1000 * np.abs(depth - left["depth"]), nan=0.0, posinf=0.0)
        cv2.imwrite(str(out / "errors.png"), (5 * error).clip(0, 255).astype(np.uint8))
    return rows, np.isfinite(depth)[dark].mean(), np.median(off)


if __name__ == "__main__":
    rows, dark, off = main(*sys.argv[1:2])
    facing, flat, grazing, hidden = rows.values()
    # Matching of blocks is right to a fraction of a pixel, and no better: it draws disparities to whole pixels.
    assert off < 0.25 and facing[1] > 0.8, "a depth camera measures what faces it"
    assert grazing[1] < facing[1] and hidden[1] < 0.5 * facing[1] and dark < 0.5 * facing[1], "and loses the rest"
