"""Annotated objects by way of Python: the files that the command writes, and pycocotools' reading of them."""

import json

import numpy as np
from test_etendue import quad


def test_a_shot_writes_sets_and_mattes(tmp_path):
    scene = quad(tracer={"type": "facing"}, layers=["ids"], objects=[
        {"name": "wall", "file": "mesh"}, {"name": "ball", "shape": "sphere", "radius": 0.5},
    ])  # fmt: skip
    shot = scene.render()
    files = shot.write(tmp_path, "png,coco,bop,cryptomatte")
    assert any(name.endswith("cryptomatte.exr") for name in files)
    assert (tmp_path / "bop/train/000000/scene_gt.json").exists()
    from pycocotools.coco import COCO

    coco = COCO(tmp_path / "coco.json")
    for annotation in coco.loadAnns(coco.getAnnIds()):
        np.testing.assert_array_equal(coco.annToMask(annotation) == 1, shot["id_object"] == annotation["object"])
    names = {category["name"] for category in json.loads((tmp_path / "coco.json").read_text())["categories"]}
    assert names == {"wall", "ball"}
