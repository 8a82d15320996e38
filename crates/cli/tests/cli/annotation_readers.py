"""Reads COCO's and BOP's sets and a Cryptomatte by other programs, and compares them with the arrays beside them.

    annotation_readers.py FOLDER

The annotations of `coco.json` by pycocotools, the mattes by cryptomatte-api, and BOP's folder as its toolkit's `inout`
and `calc_gt_info` have it: JSON with numbers as keys, masks and depth by imageio, models by the rules of `load_ply`.
"""

import json
import struct
import sys
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
from cryptomatte_api import Cryptomatte
from pycocotools.coco import COCO

folder = Path(sys.argv[1])
objects = np.load(folder / "id_object.npy")
depth = np.load(folder / "depth.npy")
names = {
    entry["id"]: entry["name"]
    for layer in json.loads((folder / "layers.json").read_text())["layers"]
    if layer["name"] == "Id.object"
    for entry in layer["names"]
}


def check_coco():
    coco = COCO(folder / "coco.json")
    (image,) = coco.loadImgs(coco.getImgIds())
    assert imageio.imread(folder / image["file_name"]).shape[:2] == (image["height"], image["width"])
    annotations = coco.loadAnns(coco.getAnnIds(imgIds=[image["id"]]))
    assert {annotation["object"] for annotation in annotations} == set(np.unique(objects)) - {0}
    for annotation in annotations:
        mask = coco.annToMask(annotation).astype(bool)
        np.testing.assert_array_equal(mask, objects == annotation["object"])
        rows, columns = np.nonzero(mask)
        box = [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
        assert annotation["bbox"] == box and annotation["area"] == mask.sum()
        (category,) = coco.loadCats([annotation["category_id"]])
        assert category["name"] == names[annotation["object"]]


def load_json(path):
    """As `inout.load_json(path, keys_to_int=True)`."""
    return json.loads(
        path.read_text(), object_hook=lambda x: {int(k) if k.isdigit() else k: v for k, v in x.items()}
    )


def load_ply(path):
    """The corners and triangles of a model: the formats and names that `inout.load_ply` knows, and no others."""
    formats = {"float": ("f", 4), "double": ("d", 8), "int": ("i", 4), "uchar": ("B", 1)}
    with open(path, "rb") as file:
        assert file.readline() == b"ply\n"
        assert file.readline() == b"format binary_little_endian 1.0\n"
        counts, properties, element = {}, {"vertex": [], "face": []}, None
        while (line := file.readline().decode().split()) != ["end_header"]:
            if line[0] == "element":
                element = line[1]
                counts[element] = int(line[2])
            elif line[0] == "property":
                properties[element].append(line[1:])
        layout = "<" + "".join(formats[kind][0] for kind, _ in properties["vertex"])
        columns = [name for _, name in properties["vertex"]]
        size = struct.calcsize(layout)
        corners = np.array([struct.unpack(layout, file.read(size)) for _ in range(counts["vertex"])])
        assert properties["face"] == [["list", "uchar", "int", "vertex_indices"]]
        faces = np.array([struct.unpack("<B3i", file.read(13)) for _ in range(counts["face"])])
        assert (faces[:, 0] == 3).all() and faces[:, 1:].max() < len(corners) and file.read() == b""
    return {name: corners[:, k] for k, name in enumerate(columns)}, faces[:, 1:]


def check_bop():
    bop = folder / "bop"
    scene = bop / "train/000000"
    cameras, truths, facts = (load_json(scene / f"scene_{name}.json") for name in ["camera", "gt", "gt_info"])
    infos = load_json(bop / "models/models_info.json")
    assert set(cameras) == set(truths) == set(facts) == {0}
    sizes = json.loads((bop / "camera.json").read_text())
    K = np.array(cameras[0]["cam_K"]).reshape(3, 3)
    assert (sizes["fx"], sizes["fy"], sizes["cx"], sizes["cy"]) == (K[0, 0], K[1, 1], K[0, 2], K[1, 2])
    image = imageio.imread(scene / "depth/000000.png").astype(np.float32) * cameras[0]["depth_scale"]
    hit = np.isfinite(depth)
    assert ((image > 0) == hit).all() and image.shape == (sizes["height"], sizes["width"])
    # Half of a step of 0.1 mm, and the step of a float near 5000.
    assert np.abs(image[hit] - 1000 * depth[hit]).max() < 0.05 + 5e-4
    assert imageio.imread(scene / "rgb/000000.png").shape[:2] == image.shape
    assert len(truths[0]) == len(facts[0]) == 3
    for number, (truth, fact) in enumerate(zip(truths[0], facts[0])):
        whole, seen = (
            imageio.imread(scene / f"{kind}/000000_{number:06}.png") == 255 for kind in ["mask", "mask_visib"]
        )
        assert not (seen & ~whole).any(), "what is seen is part of the whole"
        assert fact["px_count_visib"] == seen.sum() and fact["px_count_valid"] == whole.sum()
        assert fact["px_count_all"] >= whole.sum()
        if seen.any():
            # Boxes as `misc.calc_2d_bbox` has them.
            rows, columns = np.nonzero(seen)
            assert fact["bbox_visib"] == [columns.min(), rows.min(), np.ptp(columns), np.ptp(rows)]
        R = np.array(truth["cam_R_m2c"]).reshape(3, 3)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) > 0
        model, faces = load_ply(bop / f"models/obj_{truth['obj_id']:06}.ply")
        corners = np.stack([model["x"], model["y"], model["z"]], axis=1)
        info = infos[truth["obj_id"]]
        apart = np.linalg.norm(corners[:, None] - corners[None], axis=2).max()
        assert abs(apart - info["diameter"]) < 1e-5 * apart, "the models are 32-bit floats"
        np.testing.assert_allclose(corners.min(0), [info[f"min_{axis}"] for axis in "xyz"], rtol=1e-6)
        # The picture of the model in its pose is around the mask: each seen pixel is in the box of projected corners.
        seen_from = corners @ R.T + np.array(truth["cam_t_m2c"])
        points = seen_from @ K.T
        places = points[:, :2] / points[:, 2:]
        if whole.any():
            rows, columns = np.nonzero(whole)
            low, high = places.min(0), places.max(0)
            assert (columns >= low[0]).all() and (columns <= high[0]).all()
            assert (rows >= low[1]).all() and (rows <= high[1]).all()
        # Faces look outwards: a closed surface has a positive volume.
        a, b, c = (corners[faces[:, k]] for k in range(3))
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0


def check_cryptomatte():
    mattes = {matte.metadata().name(): matte for matte in Cryptomatte.load(str(folder / "cryptomatte.exr"))}
    assert set(mattes) == {"CryptoObject", "CryptoInstance", "CryptoMaterial"}, set(mattes)
    found = mattes["CryptoObject"].masks()
    assert set(found) == set(names.values()), set(found)
    for number, name in names.items():
        share = np.asarray(found[name], dtype=np.float64).reshape(objects.shape)
        # Where all around sees one thing, it has the pixel; halves are at edges.
        alone = np.ones_like(share, dtype=bool)
        for rows, columns in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)]:
            alone &= np.roll(objects, (rows, columns), (0, 1)) == objects
        alone[[0, -1]], alone[:, [0, -1]] = False, False
        np.testing.assert_allclose(share[alone], (objects == number)[alone], atol=1e-6)
        assert share.min() >= 0 and share.max() <= 1 + 1e-6
    total = sum(np.asarray(share, dtype=np.float64).reshape(objects.shape) for share in found.values())
    assert (total <= 1 + 1e-5).all()


check_coco()
check_bop()
check_cryptomatte()
