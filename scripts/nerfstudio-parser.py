#!/usr/bin/env python3
"""Data sets of `etendue render` as nerfstudio's own parser and cameras have them.

    python3 scripts/nerfstudio-parser.py FOLDER...

Every folder holds frames with depth.npy and position.npy, and the transforms.json beside them. It is read by
nerfstudio's `NerfstudioDataParserConfig` without orienting, centring or scaling, and:

* its poses and intrinsics are those of index.json, which are OpenCV's, to the rounding of its f32;
* the rays of its cameras, as long as depth.npy says, end at the points of position.npy.

nerfstudio is looked for where this runs. Its parser wants few of its requirements: with Debian's python3-torch
in a venv with --system-site-packages, `pip install --no-deps nerfstudio viser` and pillow, jaxtyping, rich,
tyro, opencv-python-headless, msgspec, websockets, imageio and tensorboard are enough. Exit code 0 where all of it
holds, 1 where something does not, 77 without nerfstudio.
"""

import json
import sys
from importlib import metadata
from pathlib import Path

# Numbers in f32 are rounded by 6e-8 of themselves; rays are worked out in a dozen steps.
POSE, POINT = 1e-6, 2e-6


def parsed(folder):
    from nerfstudio.data.dataparsers.nerfstudio_dataparser import NerfstudioDataParserConfig

    config = NerfstudioDataParserConfig(
        data=folder, orientation_method="none", center_method="none", auto_scale_poses=False,
        scale_factor=1.0, eval_mode="all", load_3D_points=False, depth_unit_scale_factor=1.0,
        downscale_factor=1)
    return config.setup().get_dataparser_outputs(split="train")


def compare(folder):
    """The greatest differences: of poses (m), of intrinsics (pixels), and of points (of their distances)."""
    import numpy as np

    outputs = parsed(folder)
    frames = json.loads((folder / "index.json").read_text())["frames"]
    assert len(outputs.image_filenames) == len(frames), "frames are missing"
    worst = dict.fromkeys(["poses", "intrinsics", "points"], 0.0)
    seen = 0

    def note(kind, difference):
        worst[kind] = max(worst[kind], float(difference))

    for number, (frame, image) in enumerate(zip(frames, outputs.image_filenames)):
        assert image == folder / frame["files"]["picture"]["png"] and image.exists(), image
        camera = outputs.cameras[number]
        # OpenCV's axes are right, down, ahead; nerfstudio's are right, up, back.
        pose = np.linalg.inv(frame["camera_from_world"]) @ np.diag([1, -1, -1, 1])
        note("poses", np.abs(camera.camera_to_worlds.numpy() - pose[:3]).max())
        k, half = frame["K"], 0.5 if frame["pixel_origin"] == "center" else 0.0
        ours = [k[0][0], k[1][1], k[0][2] + half, k[1][2] + half, *frame["resolution"]]
        theirs = [camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height]
        note("intrinsics", max(abs(float(a) / b - 1) for a, b in zip(theirs, ours)))
        rays = outputs.cameras.generate_rays(camera_indices=number)
        along = (rays.directions * rays.metadata["directions_norm"]).numpy()
        depth = np.load(outputs.metadata["depth_filenames"][number])
        position = np.load(folder / frame["files"]["Position"]["npy"])
        is_hit = np.isfinite(depth)
        points = rays.origins.numpy()[is_hit] + along[is_hit] * depth[is_hit][:, None]
        apart = np.linalg.norm(points - position[is_hit], axis=1)
        note("points", (apart / depth[is_hit]).max(initial=0.0))
        seen += int(is_hit.sum())
    assert seen > 0, "nothing is seen in any frame"
    return len(frames), seen, worst


def main():
    try:
        version = metadata.version("nerfstudio")
    except metadata.PackageNotFoundError:
        print("nerfstudio is not installed")
        return 77
    is_good = True
    for folder in map(Path, sys.argv[1:]):
        count, seen, worst = compare(folder)
        print(f"nerfstudio {version}, {folder}: {count} frames; poses within {worst['poses']:.1e} m, intrinsics "
              f"within {worst['intrinsics']:.1e} of themselves, {seen} points within {worst['points']:.1e} of their "
              "depths")
        is_good &= max(worst["poses"], worst["intrinsics"]) < POSE and worst["points"] < POINT
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
