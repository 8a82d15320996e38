"""The scenes that programs are compared on: each is written once, as a scene of etendue whose models are PLY files,
and told to other programs from there (`light_mitsuba.py`)."""

import json
import math
import os
from pathlib import Path

import program
from light_meshes import (box, ceiling_lamp, closed_room, pattern, quad, read_obj, room, sky, sphere, standing,
                          together, write_ply, write_png)

SIDE, SAMPLES = 256, 64
# Of the blob's pictures, and of those of its colour under a headlight.
BLOB_SIDE, FACING_SAMPLES = 512, 16

MATTE = {"white": [0.73, 0.73, 0.73], "red": [0.65, 0.05, 0.05], "green": [0.12, 0.45, 0.15]}

INDOORS = {"from": [0, 1, 4.4], "look_at": [0, 1, 0], "fov": 32.0}
OUTDOORS = {"from": [0, 1.6, 4.2], "look_at": [0, 0.5, 0], "fov": 40.0}
AT_BLOB = {"from": [0.7, 0.9, 2.6], "look_at": [0, 0, 0]}
# Where a point or a square of one metre lights the blob from.
OVER_BLOB = [1.0, 2.0, 1.5]

# Of odedstein/meshes: koala.obj by YahooJAPAN (thing 182225), remeshed by Oded Stein, CC-BY-3.0; spot.obj by Keenan
# Crane, public domain.
# Of each where it stands, its length (m), and by how many degrees it is turned.
MODELS = {"koala.obj": ([-0.4, 0, -0.2], 1.3, 40), "spot.obj": ([0.6, 0.4, 0.35], 0.7, 150)}


def models():
    """The folder of the models from elsewhere; `None` where ETENDUE_ASSETS names none that has them."""
    assets = os.environ.get("ETENDUE_ASSETS")
    folders = [Path(assets) / "data" / "obj", Path(assets) / "obj"] if assets else []
    has_all = lambda folder: all((folder / name).exists() for name in MODELS)
    return next(filter(has_all, folders), None)


def facing(at):
    """The matrix that turns +z of what lies at the origin from `at` to there."""
    import numpy as np

    z = -np.array(at) / np.linalg.norm(at)
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    matrix = np.eye(4)
    matrix[:3] = np.stack([x, np.cross(z, x), z, at], axis=1)
    return matrix.tolist()


class Scenes:
    """The scenes by name; their files are written to a folder, in which `benchmarks models` has put the blob."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.count = 0

    def part(self, mesh, material):
        name = f"part{self.count}.ply"
        self.count += 1
        write_ply(self.folder / name, *mesh)
        return {"file": name, "material": material}

    def scene(self, camera, bounces, objects, materials, lights, samples=SAMPLES):
        tracer = {"type": "direct"} if bounces == 1 else {"type": "path", "max_bounces": bounces}
        return {
            "etendue": 1,
            "camera": {"type": "pinhole", "fov": camera["fov"],
                       "pose": {"from": camera["from"], "look_at": camera["look_at"]},
                       "sensor": {"resolution": [SIDE, SIDE]}},
            "tracer": tracer, "objects": objects, "materials": materials, "lights": lights,
            "render": {"samples": samples},
        }

    def blob(self, light, bounces):
        """A million triangles through a thin lens, under a point or a square that shines."""
        objects = [{"file": "blob.glb", "material": "clay"}]
        materials = {"clay": {"type": "matte", "color": [0.8, 0.4, 0.3]}}
        lights = []
        if light == "point":
            lights.append({"type": "point", "at": OVER_BLOB, "intensity": [8.0] * 3})
        else:
            objects.append({"shape": "rectangle", "material": "lamp", "transform": {"matrix": facing(OVER_BLOB)}})
            materials["lamp"] = {"type": "emissive", "radiance": [6.0] * 3}
        scene = self.scene(AT_BLOB | {"fov": 42.0}, bounces, objects, materials, lights)
        scene["camera"] |= {"type": "thin_lens", "focal_length": 50.0, "f_number": 2.8, "focus_distance": 1.9,
                            "sensor": {"resolution": [BLOB_SIDE, BLOB_SIDE]}}
        return scene

    def headlight(self, tracer):
        """The blob in its own colour, as `benchmarks models` frames it, by a tracer without lights."""
        scene = json.loads((self.folder / "glb.json").read_text())
        del scene["layers"]
        return scene | {"tracer": {"type": tracer}, "render": {"samples": FACING_SAMPLES}}

    def walls(self, kind=room):
        return [self.part(mesh, name) for name, mesh in kind().items()]

    def matte(self):
        return {name: {"type": "matte", "color": color} for name, color in MATTE.items()}

    def indoors(self, bounces, objects):
        """Objects in a room under its lamp."""
        lamp = self.part(ceiling_lamp(), "lamp")
        materials = self.matte() | {"lamp": {"type": "emissive", "radiance": [17.0, 12.0, 7.0]}}
        return self.scene(INDOORS, bounces, [*objects, lamp], materials, [])

    def cornell(self, bounces):
        return self.indoors(bounces, self.walls())

    def furnished(self):
        """The room with forty small boxes more: 516 triangles, which go into a tree."""
        boxes = [box([-0.9 + 0.2 * (k % 10), 0.06, 0.2 + 0.2 * (k // 10)], [0.1, 0.12, 0.1], 25 * k)
                 for k in range(40)]
        return self.indoors(5, [*self.walls(), self.part(together(boxes), "red")])

    def inhabited(self):
        """A closed room with models from elsewhere: 123 074 triangles."""
        folder = models()
        animals = [self.part(standing(read_obj(folder / name), *place), "white") for name, place in MODELS.items()]
        pedestal = self.part(box([0.6, 0.2, 0.35], [0.45, 0.4, 0.45], 20), "red")
        return self.indoors(5, [*self.walls(closed_room), pedestal, *animals])

    def in_bands(self, scene, count):
        """A scene before a sensor of as many bands from 400 to 700 nm."""
        edges = [400 + 300 * k / count for k in range(count + 1)]
        scene["camera"]["sensor"] |= {"type": "multispectral", "noise": "none", "pixel_pitch": "10 um", "bands": edges}
        return scene

    def through_lens(self, scene):
        """A scene through the traced lenses of a double Gauss."""
        lens = (program.ROOT / "scenes/lenses/double-gauss.json").read_text()
        (self.folder / "lens.json").write_text(lens)
        kept = {key: scene["camera"][key] for key in ("pose", "sensor")}
        # The lens has its own size; the sensor's pixels follow from its height.
        kept["sensor"].pop("pixel_pitch", None)
        scene["camera"] = {"type": "lens", "lens": "lens.json", "f_number": 2.8, "focus_distance": "4.4 m",
                           "sensor_height": "28 mm"} | kept
        return scene

    def floor(self, material="white"):
        return self.part(quad([-4, 0, -4], [0, 0, 8], [8, 0, 0]), material)

    def balls(self):
        objects, materials = [self.floor()], self.matte()
        for k in range(5):
            name = f"metal{k}"
            materials[name] = {"type": "metal", "color": [0.9, 0.6 + 0.06 * k, 0.3 + 0.12 * k],
                               "roughness": 0.15 + 0.12 * k}
            objects.append(self.part(sphere([-1.4 + 0.7 * k, 0.33, 0.3 * (k % 2)], 0.33), name))
        return self.scene(OUTDOORS, 5, objects, materials, [self.sky()])

    def sky(self):
        sky(self.folder / "sky.hdr")
        return {"type": "environment", "image": "sky.hdr"}

    def points(self):
        lights = []
        for k in range(100):
            angle, height = 2.4 * k, 0.1 + 1.8 * (k * 0.618 % 1)
            radius = 0.9 * math.sqrt((k + 0.5) / 100)
            at = [radius * math.cos(angle), height, radius * math.sin(angle)]
            lights.append({"type": "point", "at": at, "intensity": [0.02 + 0.08 * (k % 3)] * 3})
        return self.scene(INDOORS, 1, self.walls(), self.matte(), lights)

    def lamps(self):
        import numpy as np

        points, faces = [], []
        for k in range(1000):
            x, z = -0.95 + 1.9 * (k % 40) / 39, -0.95 + 1.9 * (k // 40) / 24
            y = 1.9 - 0.05 * math.sin(7 * x) * math.cos(5 * z)
            points += [[x, y, z], [x + 0.02, y, z], [x, y, z + 0.02]]
            faces.append([3 * k, 3 * k + 1, 3 * k + 2])
        lamp = self.part((np.array(points), faces), "lamp")
        materials = self.matte() | {"lamp": {"type": "emissive", "radiance": [20.0, 18.0, 15.0]}}
        return self.scene(INDOORS, 1, self.walls() + [lamp], materials, [])

    def glass(self):
        materials = self.matte() | {"glass": {"type": "dielectric", "ior": 1.5},
                                    "lamp": {"type": "emissive", "radiance": [8.0, 8.0, 7.0]}}
        lamp = self.part(quad([-0.6, 2.2, -0.6], [1.2, 0, 0], [0, 0, 1.2]), "lamp")
        ball = self.part(sphere([0, 0.6, 0], 0.6), "glass")
        other = self.part(sphere([-1.1, 0.3, 0.5], 0.3), "red")
        lights = [{"type": "environment", "radiance": [0.4, 0.5, 0.7]}]
        return self.scene(OUTDOORS, 8, [self.floor(), ball, other, lamp], materials, lights)

    def image(self):
        """The pattern as the colour of a material."""
        write_png(self.folder / "pattern.png", pattern())
        return {"image": "pattern.png"}

    def asset(self):
        surface = {"type": "gltf", "color": self.image(), "metallic": 0.2, "roughness": 0.4}
        ball = self.part(sphere([0, 0.8, 0], 0.8, 160), "asset")
        return self.scene(OUTDOORS, 5, [self.floor(), ball], self.matte() | {"asset": surface}, [self.sky()])


CORNELL = "Cornell box, path of 5 bounces"
IN_BANDS = f"{CORNELL}, in 31 bands"
INHABITED = "room of models from elsewhere, path of 5 bounces"
FACING, FLAT = (f"`{tracer}`, {FACING_SAMPLES} samples" for tracer in ("facing", "flat"))
BALLS = "glossy balls, sky with a sun"
ASSET = "textured glTF surface, environment image"

# Of each job that Mitsuba does, too, how its scene is made, and the goals at the same samples and at one error.
JOBS = {
    "direct, point light": (lambda s: s.blob("point", 1), 2.0, 3.0),
    "direct, area light": (lambda s: s.blob("area", 1), 2.0, 3.0),
    "path, area light": (lambda s: s.blob("area", 5), 1.2, 1.5),
    "Cornell box, direct": (lambda s: s.cornell(1), 2.5, 3.0),
    CORNELL: (lambda s: s.cornell(5), 1.5, 2.0),
    "furnished room, path of 5 bounces": (Scenes.furnished, 1.2, 1.5),
    INHABITED: (Scenes.inhabited, 1.2, 1.5),
    BALLS: (Scenes.balls, 1.3, 1.5),
    "100 point lights": (Scenes.points, 1.3, 3.0),
    "1000 emissive triangles": (Scenes.lamps, 1.3, 1.5),
    "glass, lamp, sky": (Scenes.glass, 1.2, 1.5),
    ASSET: (Scenes.asset, 1.2, 1.5),
    # Mitsuba finds depth and normals, without light: there is no error to compare.
    FACING: (lambda s: s.headlight("facing"), 1.0, None),
}

# Of each job of etendue alone, how its scene is made, the job beside which it is held, and how many times as long it
# may take.
ALONE = {
    f"{CORNELL}, through the double Gauss": (lambda s: s.through_lens(s.cornell(5)), CORNELL, 1.6),
    # With rays of all bands together, as at the design wavelength.
    f"{CORNELL}, through the double Gauss, without dispersion": (
        lambda s: s.through_lens(s.cornell(5)) | {"plan": {"dispersion": False}}, CORNELL, 1.6),
    FLAT: (lambda s: s.headlight("flat"), None, None),
    IN_BANDS: (lambda s: s.in_bands(s.cornell(5), 31), None, None),
    f"{IN_BANDS}, through the double Gauss": (
        lambda s: s.through_lens(s.in_bands(s.cornell(5), 31)), IN_BANDS, 2.0),
}


def scene_of(job, folder):
    """The job as a scene of etendue, whose models are written to a folder."""
    make, *_ = (JOBS | ALONE)[job]
    return make(Scenes(folder))


def left_out():
    """Jobs that cannot be done here, each with the reason."""
    if models():
        return {}
    names = " and ".join(MODELS)
    return {INHABITED: f"ETENDUE_ASSETS names no folder with {names} of odedstein/meshes in `data/obj`"}
