"""Scenes in which the plan could save much, each as it is and as somebody who knows the scene overrides it by hand.

Pictures are as large as users render: finding out what a lens does takes as long whatever their size, which is most of
what there is to see in small ones.
"""

import json
import struct

WHITE = {"type": "matte", "color": [0.7, 0.7, 0.7]}
GROUND = {"shape": "rectangle", "width": 12, "height": 12, "material": "white", "transform": {"rotate": [1, 0, 0, -90]}}
BALL = {"shape": "sphere", "radius": 0.3, "material": "white", "transform": {"translate": [0, 0.3, 0]}}
ROOM = [{"shape": "box", "size": [4, 3, 4], "material": "grey"}, BALL | {"material": "grey"},
        {"shape": "rectangle", "width": 1, "height": 1, "material": "lamp",
         "transform": {"translate": [0, 1.49, 0], "rotate": [1, 0, 0, 90]}}]
SKY = [{"type": "environment", "radiance": [1, 1, 1]}]
POSE = {"from": [0, 0.6, 2.4], "look_at": [0, 0.3, 0]}
# What approximations are taken within.
TOLERANCE = "0.5 px, 2 %"
THIRTY = {"type": "multispectral", "bands": {"from": 400, "to": 700, "count": 30}}


def sheet(path, side, half):
    """Writes a waved square of 2 side² triangles, `half` its size (m), as binary PLY."""
    import numpy as np
    u = np.linspace(-half, half, side + 1)
    x, y = np.meshgrid(u, u)
    z = 0.05 * half * np.sin(9 * x / half) * np.cos(7 * y / half)
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype("<f4")
    i = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.concatenate([np.stack([i, i + 1, i + side + 2], 1), np.stack([i, i + side + 2, i + side + 1], 1)])
    rows = np.zeros(len(faces), dtype=[("n", "u1"), ("at", "<i4", 3)])
    rows["n"], rows["at"] = 3, faces
    head = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\n"
            f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    path.write_bytes(head.encode() + points.tobytes() + rows.tobytes())


def image(path, side):
    """Writes a PNG of stripes, by the standard library alone."""
    import zlib
    import numpy as np
    at = np.arange(side)
    grey = (128 + 100 * np.sin(2 * np.pi * 5 * at / side)[None, :] * np.cos(2 * np.pi * 3 * at / side)[:, None])
    rows = np.repeat(grey.astype("u1")[:, :, None], 3, axis=2).reshape(side, -1)
    raw = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(raw, 6)) + chunk(b"IEND", b""))


def scene(camera, size, objects=(GROUND, BALL), **more):
    """A scene of a camera with a picture of `size`."""
    camera = {"pose": POSE} | camera
    camera["sensor"] = {"resolution": size} | camera.get("sensor", {})
    return {"etendue": 1, "camera": camera, "objects": list(objects), "materials": {"white": WHITE}} | more


def lens(sensor=None, **more):
    """A camera with the double Gauss of the examples."""
    camera = {"type": "lens", "lens": "lenses/double-gauss.json", "f_number": 2.8, "focus_distance": "2.4 m",
              "sensor_height": "24 mm"}
    return camera | ({"sensor": sensor} if sensor else {}) | more


def cases(folder, scenes):
    """What could be saved, whether exactly, the scene, what overrides the plan by hand, and what makes it do all."""
    lenses = folder / "lenses"
    lenses.mkdir()
    gauss = json.loads((scenes / "lenses" / "double-gauss.json").read_text())
    (lenses / "double-gauss.json").write_text(json.dumps(gauss))
    (lenses / "even.json").write_text(json.dumps(undispersed(gauss)))
    for path, side, half in (("behind.ply", 708, 1.0), ("small.ply", 1000, 0.01), ("coarse.ply", 10, 0.01)):
        sheet(folder / path, side, half)
    image(folder / "large.png", 4096)
    image(folder / "little.png", 64)
    light = {"tracer": {"type": "path"}, "lights": SKY}
    some = {"render": {"samples": 64}}
    wide, through, bands = [640, 480], [480, 320], [240, 160]

    behind = {"file": "behind.ply", "material": "white", "transform": {"translate": [0, 0.5, 8]}}
    depth = scene({"type": "pinhole"}, [1280, 960], [GROUND, BALL, behind], layers=["depth"])
    yield ("a million triangles behind the camera, depth", True, depth,
           {"objects": [GROUND, BALL]}, {"plan": {"unseen": True}})
    small = {"file": "small.ply", "material": "white", "transform": {"translate": [0, 0.4, 0]}}
    coarse = small | {"file": "coarse.ply"}
    tiny = scene({"type": "pinhole"}, wide, [GROUND, small], **light, **some)
    yield "two million triangles within 10 × 10 pixels", False, tiny, {"objects": [GROUND, coarse]}, None
    grey = scene(lens(THIRTY), [96, 64], **light, render={"samples": 256})
    yield "30 bands of a grey scene through a lens", False, grey, {"plan": {"dispersion": False}}, None
    textured = scene({"type": "pinhole"}, wide, [
        GROUND, {"shape": "rectangle", "width": 0.1, "height": 0.1, "material": "image", "transform": {"translate": [0, 0.3, 0]}}],
        **light, **some)
    textured["materials"] = {"white": WHITE, "image": {"type": "matte", "color": {"image": "large.png"}}}
    little = {"white": WHITE, "image": {"type": "matte", "color": {"image": "little.png"}}}
    yield "an image of 4096² on 20 × 20 pixels", False, textured, {"materials": little}, None
    closed = scene(lens(f_number=16), through, **light, **some)
    pinhole = scene({"type": "pinhole", "fov": 27}, through)["camera"]
    yield "a lens at f/16, all in focus", False, closed, {"camera": pinhole}, None
    even = scene(lens(lens="lenses/even.json"), through, **light, **some)
    yield "glasses of a lens with vd 10⁶", False, even, {"plan": {"dispersion": False}}, None
    raw = {"type": "raw", "quantum_efficiency": [[400, 0.2], [550, 0.6], [700, 0.1]]}
    yield ("a raw sensor with a curve, through a lens", False, scene(lens(raw), through, **light, **some),
           {"plan": {"dispersion": False}}, None)
    yield ("30 bands of a grey scene through a pinhole", True,
           scene({"type": "pinhole", "sensor": THIRTY}, bands, **light, **some),
           {"camera": scene({"type": "pinhole"}, bands)["camera"]}, None)
    room = scene({"type": "pinhole", "pose": {"from": [1.2, 0.1, 1.1], "look_at": [-1, -0.3, -1]}}, [192, 128], ROOM,
                 tracer={"type": "path"}, lights=[], **some)
    room["materials"] = {"grey": {"type": "matte", "color": [0.3] * 3}, "lamp": {"type": "emissive", "radiance": [5] * 3}}
    # Four leave out 2.2 % of the light in 99 % of blocks, five 0.7 %.
    yield "32 bounces where 5 are within the tolerance", False, room, {"tracer": {"type": "path", "max_bounces": 5}}, None


def undispersed(gauss):
    """The same lens of glasses that bend all wavelengths alike, but for a millionth."""
    def glass(value):
        if isinstance(value, dict):
            return {key: {"nd": 1.62, "vd": 1e6} if key == "glass" and of != "air" else glass(of)
                    for key, of in value.items()}
        return [glass(of) for of in value] if isinstance(value, list) else value
    return glass(gauss)
