"""The scenes whose costs `costs.py` measures: balls behind a lens, a room, a body of glass, and files that they name."""

import json
import math
import random
import struct
import zlib

import program

LENSES = program.ROOT / "scenes" / "lenses"

# Half the stop's width and what stands behind the lens, in mm.
STOP, BEHIND = 8.55, 9.0

# Cells a side of the mesh that changes its shape.
CELLS = 60


def double_gauss():
    return json.loads((LENSES / "double-gauss.json").read_text())


def of_ball(camera):
    """A ball that a camera sees, by its angle to the view."""
    objects = [{"shape": "sphere", "triangles": 1000}]
    return {"etendue": 1, "camera": camera, "tracer": {"type": "facing"}, "objects": objects}


def asphere(order, coefficient):
    """12 × 8 pixels through a stop, an asphere of one term, and a spherical surface."""
    lens = {
        "elements": [
            {"type": "aperture", "shape": "circular", "radius": 4, "thickness": 2, "stop": True},
            {
                "type": "surface",
                "radius": 40,
                "thickness": 5,
                "glass": "N-BK7",
                "semi_diameter": 8,
                "aspheric": {str(order): coefficient},
            },
            {"type": "surface", "radius": -60, "semi_diameter": 8},
        ]
    }
    camera = {
        "type": "lens",
        "lens": lens,
        "focus_distance": "3 m",
        "sensor_height": "10 mm",
        "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [12, 8]},
    }
    return of_ball(camera) | {"render": {"samples": 1}}


def png(path, rows):
    """Writes a grey PNG of 8 bits."""

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">2I5B", len(rows[0]), len(rows), 8, 0, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b""))


def masks():
    """Masks by name: rows of grey values."""
    choose = random.Random(1)

    def of(side, is_open):
        return [[255 if is_open(x, y) else 0 for x in range(side)] for y in range(side)]

    def holes(side, count):
        # Away from the corners, which no stop leaves open.
        places = set()
        while len(places) < count:
            x, y = choose.randrange(side), choose.randrange(side)
            if (x - side / 2) ** 2 + (y - side / 2) ** 2 < (0.35 * side) ** 2:
                places.add((x, y))
        return of(side, lambda x, y: (x, y) in places)

    cells = [[choose.random() < 0.5 for _ in range(13)] for _ in range(13)]
    yield "a coded mask of 13 × 13 cells", of(13, lambda x, y: cells[y][x])
    yield "a ring of a twentieth of the width", of(
        256, lambda x, y: 0.36 < ((x - 127.5) ** 2 + (y - 127.5) ** 2) ** 0.5 / 256 < 0.41
    )
    yield "12 pixels of 256 × 256", holes(256, 12)
    yield "3 pixels of 256 × 256", holes(256, 3)
    yield "1 pixel of 256 × 256", holes(256, 1)
    yield "1 pixel of 1024 × 1024", holes(1024, 1)


def masked(mask, is_behind):
    """The double Gauss with or without a mask (a file), in the stop or behind the lens."""
    lens = double_gauss()
    if mask is not None:
        half = BEHIND if is_behind else STOP
        element = {"type": "aperture", "shape": "image", "file": mask, "width": 2 * half}
        stop = next(i for i, e in enumerate(lens["elements"]) if e.get("stop"))
        if is_behind:
            lens["elements"][-1]["thickness"] = 2
            lens["elements"].append(element)
        else:
            lens["elements"][stop] = {**element, "thickness": lens["elements"][stop]["thickness"], "stop": True}
    return of_ball({
        "type": "lens",
        "lens": lens,
        "focus_distance": "1.6 m",
        "sensor_height": "24 mm",
        "pose": {"from": [0, 0.5, 1.9], "look_at": [0, 0.3, 0]},
        "sensor": {"resolution": [96, 64]},
    })


def quad(at, turn, material):
    return {"shape": "rectangle", "width": 2, "height": 2, "material": material,
            "transform": {"translate": at, "rotate": turn}}


BLOCK = {"shape": "box", "size": [0.6, 1.2, 0.6], "material": "white",
         "transform": {"translate": [-0.3, 0.6, -0.3], "rotate": [0, 1, 0, 20]}}


def room(camera, side, objects):
    """Five walls of 2 m lit by a lamp, by paths of five bounces, with objects in it; the camera sees it in `side`² pixels
    from in front."""
    sensor = {"resolution": [side, side]} | camera.get("sensor", {})
    walls = [
        quad([0, 0, 0], [1, 0, 0, -90], "white"), quad([0, 2, 0], [1, 0, 0, 90], "white"),
        quad([0, 1, -1], [1, 0, 0, 0], "white"), quad([-1, 1, 0], [0, 1, 0, 90], "red"),
        quad([1, 1, 0], [0, 1, 0, -90], "green"),
        {"shape": "rectangle", "width": 0.5, "height": 0.5, "material": "lamp",
         "transform": {"translate": [0, 1.99, 0], "rotate": [1, 0, 0, 90]}}]
    return {
        "etendue": 1,
        "camera": camera | {"pose": {"from": [0, 1, 4.9], "look_at": [0, 1, 0]}, "sensor": sensor},
        "tracer": {"type": "path", "max_bounces": 5},
        "materials": {"white": {"type": "matte", "color": [0.73, 0.73, 0.73]},
                      "red": {"type": "matte", "color": [0.63, 0.06, 0.05]},
                      "green": {"type": "matte", "color": [0.14, 0.45, 0.09]},
                      "lamp": {"type": "emissive", "radiance": [17, 12, 7]}},
        "objects": walls + objects,
    }


PINHOLE = {"type": "pinhole", "fov": 36}


def banded(lens, bands, side):
    """The room in so many bands, red, green and blue where there are three, through a lens or a pinhole."""
    camera, sensor = PINHOLE, {}
    if lens:
        camera = {"type": "lens", "lens": double_gauss(), "f_number": 2.8, "focus_distance": "4.4 m",
                  "sensor_height": "28 mm"}
    if bands != 3:
        edges = [400 + 300 * k / bands for k in range(bands + 1)]
        sensor = {"type": "multispectral", "noise": "none", "bands": edges}
    if bands != 3 and not lens:
        sensor |= {"pixel_pitch": "10 um"}
    return room(camera | {"sensor": sensor}, side, [BLOCK])


def moving(side):
    """The room by what stands or moves in it. Some name `sheet.gltf`."""
    shutter = PINHOLE | {"shutter": {"exposure": "10 ms"}}
    places = [{"translate": [-0.75 + 0.5 * (k % 4), 0.3 + 0.6 * (k // 4), -0.2]} for k in range(12)]
    copies = {"shape": "sphere", "radius": 0.2, "material": "white", "instances": places}
    spin = {"motion": {"type": "velocity", "velocity": [5, 0, 0]}}
    sheet = {"file": "sheet.gltf", "material": "white", "animation": {"time": 0.02}, "transform": {"translate": [0, 1, 0]}}
    playing = sheet | {"animation": {"time": 0.02, "plays": True}}
    flight = {"motion": {"type": "velocity", "velocity": [1, 0, 0], "angular_velocity": [0, 20, 0]}}
    return {"still": room(PINHOLE, side, [BLOCK]), "a shutter, nothing moves": room(shutter, side, [BLOCK]),
            "the camera moves": room(shutter | flight, side, [BLOCK]),
            "12 copies stand": room(shutter, side, [copies]), "12 copies move": room(shutter, side, [copies | spin]),
            "it stands in its moment": room(shutter, side, [sheet]),
            "a morph of 7200 triangles plays": room(shutter, side, [playing])}


def sheet(folder):
    """Writes `sheet.gltf`, whose one morph target makes a wave of it within a tenth of a second."""
    count = CELLS + 1
    places = [(x / CELLS - 0.5, y / CELLS - 0.5) for y in range(count) for x in range(count)]
    positions = [(0.8 * x, 0.8 * y, 0.0) for x, y in places]
    moves = [(0.0, 0.0, 0.2 * math.sin(9 * x) * math.cos(7 * y)) for x, y in places]
    indices = []
    for y in range(CELLS):
        for x in range(CELLS):
            a = y * count + x
            indices += [a, a + 1, a + count, a + count, a + 1, a + count + 1]
    parts = [struct.pack(f"<{3 * len(positions)}f", *sum(positions, ())), struct.pack(f"<{3 * len(moves)}f", *sum(moves, ())),
             struct.pack(f"<{len(indices)}I", *indices), struct.pack("<2f", 0, 0.1), struct.pack("<2f", 0, 1)]
    kinds = [(5126, "VEC3", len(positions)), (5126, "VEC3", len(moves)), (5125, "SCALAR", len(indices)),
             (5126, "SCALAR", 2), (5126, "SCALAR", 2)]
    starts = [sum(map(len, parts[:k])) for k in range(len(parts))]
    document = {
        "asset": {"version": "2.0"}, "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 2, "targets": [{"POSITION": 1}]}]}],
        "animations": [{"samplers": [{"input": 3, "output": 4}],
                        "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}],
        "accessors": [{"bufferView": k, "componentType": kind, "type": shape, "count": n}
                      for k, (kind, shape, n) in enumerate(kinds)],
        "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": len(part)} for start, part in zip(starts, parts)],
        "buffers": [{"byteLength": sum(map(len, parts)), "uri": "sheet.bin"}]}
    (folder / "sheet.bin").write_bytes(b"".join(parts))
    (folder / "sheet.gltf").write_text(json.dumps(document))


def glass(body):
    """A body of glass, by what it is made of, in 16 × 16 pixels of a path tracer."""
    camera = {"type": "pinhole", "pose": {"from": [0, 0, 4], "look_at": [0, 0, 0]}, "sensor": {"resolution": [16, 16]}}
    return {"etendue": 1, "camera": camera, "tracer": {"type": "path"}, "render": {"samples": 1},
            "materials": {"glass": {"type": "dielectric"}}, "objects": [{**body, "material": "glass"}]}
