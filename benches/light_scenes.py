"""The scenes that `light_peers.py` compares programs on: each is written once, as a scene of etendue whose
models are PLY files, and told to Mitsuba from there."""

import math

SIDE, SAMPLES = 256, 64

MATTE = {"white": [0.73, 0.73, 0.73], "red": [0.65, 0.05, 0.05], "green": [0.12, 0.45, 0.15]}


def write_ply(path, points, faces, normals=None, uvs=None):
    """A binary PLY file of triangles."""
    import numpy as np

    columns = [np.asarray(points, "<f4")]
    names = ["x", "y", "z"]
    if normals is not None:
        columns.append(np.asarray(normals, "<f4"))
        names += ["nx", "ny", "nz"]
    if uvs is not None:
        columns.append(np.asarray(uvs, "<f4"))
        names += ["u", "v"]
    table = np.hstack(columns)
    rows = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    properties = "".join(f"property float {name}\n" for name in names)
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(table)}\n{properties}"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    path.write_bytes(head.encode() + table.tobytes() + rows.tobytes())


def sphere(centre, radius, rows=48):
    """A sphere of triangles with normals and texture coordinates."""
    import numpy as np

    v, u = np.mgrid[0:rows + 1, 0:2 * rows + 1]
    polar, azimuth = math.pi * v / rows, math.pi * u / rows
    normals = np.stack([np.sin(polar) * np.cos(azimuth), np.cos(polar), np.sin(polar) * np.sin(azimuth)], -1)
    uvs = np.stack([u / (2 * rows), 1 - v / rows], -1).reshape(-1, 2)
    normals = normals.reshape(-1, 3)
    width = 2 * rows + 1
    faces = []
    for row in range(rows):
        for column in range(2 * rows):
            a = row * width + column
            b, c, d = a + 1, a + width, a + width + 1
            faces += [[a, b, c]] * (row > 0) + [[b, d, c]] * (row < rows - 1)
    return np.array(centre) + radius * normals, faces, normals, uvs


def quad(corner, along, across):
    """Two triangles; the front is where `along` × `across` points."""
    import numpy as np

    a, u, v = map(np.array, (corner, along, across))
    return np.array([a, a + u, a + u + v, a + v], float), [[0, 1, 2], [0, 2, 3]]


def box(centre, size, turn):
    """A box turned by so many degrees about +Y."""
    import numpy as np

    sine, cosine = math.sin(math.radians(turn)), math.cos(math.radians(turn))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2
    turned = corners @ np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [face for a, b, c, d in quads for face in ([a, b, c], [a, c, d])]
    return turned + np.array(centre), faces


def together(meshes):
    import numpy as np

    points, faces, count = [], [], 0
    for mesh in meshes:
        points.append(mesh[0])
        faces.append(np.array(mesh[1]) + count)
        count += len(mesh[0])
    return np.vstack(points), np.vstack(faces)


def room():
    """A Cornell box of two metres, open to the front: by material."""
    whites = [quad([-1, 0, -1], [0, 0, 2], [2, 0, 0]), quad([-1, 2, -1], [2, 0, 0], [0, 0, 2]),
              quad([-1, 0, -1], [2, 0, 0], [0, 2, 0]),
              box([-0.35, 0.6, -0.35], [0.6, 1.2, 0.6], 18), box([0.35, 0.3, 0.3], [0.6, 0.6, 0.6], -17)]
    return {"white": together(whites), "red": quad([-1, 0, -1], [0, 2, 0], [0, 0, 2]),
            "green": quad([1, 0, -1], [0, 0, 2], [0, 2, 0])}


def ceiling_lamp(half=0.25):
    return quad([-half, 1.99, -half], [2 * half, 0, 0], [0, 0, 2 * half])


def sky(path):
    """A sky with a small sun, as a Radiance file of 512 x 256 pixels."""
    import numpy as np

    height, width = 256, 512
    v, u = np.mgrid[0:height, 0:width]
    up = np.cos(math.pi * (v + 0.5) / height)[..., None]
    image = np.where(up > 0, [0.35, 0.5, 0.8] * (0.4 + 0.6 * (1 - up)), [0.15, 0.13, 0.1])
    image[64:68, 330:334] = [2400, 2200, 1800]
    largest = image.max(-1)
    mantissa, exponent = np.frexp(largest)
    scaled = image * (mantissa * 256 / largest)[..., None]
    texels = np.concatenate([scaled, exponent[..., None] + 128], -1).astype(np.uint8)
    path.write_bytes(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
                     + texels.tobytes())


def texture(path):
    """A pattern of 512 x 512 texels."""
    import struct
    import zlib

    import numpy as np

    y, x = np.mgrid[0:512, 0:512]
    wave = 0.5 + 0.5 * np.sin(x / 9.0) * np.sin(y / 13.0 + np.sin(x / 31.0))
    image = np.stack([255 * wave, 90 + 120 * (1 - wave), 60 + 90 * wave], -1).astype(np.uint8)
    raw = b"".join(b"\0" + row.tobytes() for row in image)
    chunk = lambda kind, data: (struct.pack(">I", len(data)) + kind + data
                                + struct.pack(">I", zlib.crc32(kind + data)))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 512, 512, 8, 2, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))


INDOORS = {"from": [0, 1, 4.4], "look_at": [0, 1, 0], "fov": 32.0}
OUTDOORS = {"from": [0, 1.6, 4.2], "look_at": [0, 0.5, 0], "fov": 40.0}


class Scenes:
    """The scenes by name; their files are written to a folder."""

    def __init__(self, folder):
        self.folder = folder
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

    def walls(self):
        return [self.part(mesh, name) for name, mesh in room().items()]

    def matte(self):
        return {name: {"type": "matte", "color": color} for name, color in MATTE.items()}

    def cornell(self, bounces):
        lamp = self.part(ceiling_lamp(), "lamp")
        materials = self.matte() | {"lamp": {"type": "emissive", "radiance": [17.0, 12.0, 7.0]}}
        return self.scene(INDOORS, bounces, self.walls() + [lamp], materials, [])

    def furnished(self):
        """The room with forty small boxes more: 516 triangles, which go into a tree."""
        lamp = self.part(ceiling_lamp(), "lamp")
        materials = self.matte() | {"lamp": {"type": "emissive", "radiance": [17.0, 12.0, 7.0]}}
        boxes = [box([-0.9 + 0.2 * (k % 10), 0.06, 0.2 + 0.2 * (k // 10)], [0.1, 0.12, 0.1], 25 * k)
                 for k in range(40)]
        return self.scene(INDOORS, 5, self.walls() + [lamp, self.part(together(boxes), "red")], materials, [])

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

    def asset(self):
        texture(self.folder / "pattern.png")
        materials = self.matte() | {"asset": {"type": "gltf", "color": {"image": "pattern.png"},
                                              "metallic": 0.2, "roughness": 0.4}}
        ball = self.part(sphere([0, 0.8, 0], 0.8, 160), "asset")
        return self.scene(OUTDOORS, 5, [self.floor(), ball], materials, [self.sky()])


# Of each job, how its scene is made, and the goals at the same samples and at one error.
JOBS = {
    "Cornell box, direct": (lambda s: s.cornell(1), 2.5, 3.0),
    "Cornell box, path of 5 bounces": (lambda s: s.cornell(5), 1.5, 2.0),
    "furnished room, path of 5 bounces": (Scenes.furnished, 1.2, 1.5),
    "glossy balls, sky with a sun": (Scenes.balls, 1.3, 1.5),
    "100 point lights": (Scenes.points, 1.3, 3.0),
    "1000 emissive triangles": (Scenes.lamps, 1.3, 1.5),
    "glass, lamp, sky": (Scenes.glass, 1.2, 1.5),
    "textured glTF surface, environment image": (Scenes.asset, 1.2, 1.5),
}


def mitsuba_scene(mi, scene, folder, sampler):
    """The same by Mitsuba's parts."""
    camera, tracer = scene["camera"], scene["tracer"]
    pose = camera["pose"]
    bounces = tracer.get("max_bounces", 1)
    parts = {
        "type": "scene",
        # A depth of 2 is one surface; roulette begins where etendue's does.
        "integrator": {"type": "path", "max_depth": bounces + 1, "rr_depth": 5},
        "sensor": {
            "type": "perspective", "fov": camera["fov"],
            "to_world": mi.ScalarTransform4f().look_at(pose["from"], pose["look_at"], [0, 1, 0]),
            "sampler": {"type": sampler, "sample_count": scene["render"]["samples"]},
            "film": {"type": "hdrfilm", "width": SIDE, "height": SIDE, "pixel_format": "rgb",
                     "rfilter": {"type": "box"}},
        },
    }
    for k, thing in enumerate(scene["objects"]):
        material = scene["materials"][thing["material"]]
        path = folder / thing["file"]
        # It would make up normals for models that have none.
        flat = b"property float nx" not in path.read_bytes()[:1000]
        shape = {"type": "ply", "filename": str(path), "face_normals": flat}
        if material["type"] == "emissive":
            shape["emitter"] = {"type": "area", "radiance": rgb(material["radiance"])}
            shape["bsdf"] = {"type": "diffuse", "reflectance": rgb([0.0] * 3)}
        else:
            shape["bsdf"] = mitsuba_bsdf(material, folder)
        parts[f"object{k}"] = shape
    for k, light in enumerate(scene["lights"]):
        parts[f"light{k}"] = mitsuba_light(mi, light, folder)
    return mi.load_dict(parts)


def rgb(color):
    return {"type": "rgb", "value": list(color)}


def mitsuba_bsdf(material, folder):
    kind = material["type"]
    if kind == "dielectric":
        return {"type": "dielectric", "int_ior": material["ior"], "ext_ior": 1.0}
    if kind == "matte":
        own = {"type": "diffuse", "reflectance": rgb(material["color"])}
    elif kind == "metal":
        own = {"type": "roughconductor", "material": "none", "distribution": "ggx",
               "alpha": material["roughness"] ** 2, "specular_reflectance": rgb(material["color"])}
    else:
        image = {"type": "bitmap", "filename": str(folder / material["color"]["image"])}
        own = {"type": "principled", "base_color": image, "metallic": material["metallic"],
               "roughness": material["roughness"], "specular": 0.5}
    return {"type": "twosided", "inner": own}


def mitsuba_light(mi, light, folder):
    if light["type"] == "point":
        return {"type": "point", "position": light["at"], "intensity": rgb(light["intensity"])}
    if "image" in light:
        # Its images begin at another side.
        return {"type": "envmap", "filename": str(folder / light["image"]),
                "to_world": mi.ScalarTransform4f().rotate([0, 1, 0], 180)}
    return {"type": "constant", "radiance": rgb(light["radiance"])}
