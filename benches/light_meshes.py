"""Meshes and images of `light_scenes.py`, and the files that programs read them from."""

import math


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


def read_obj(path):
    """Points and triangles of an OBJ file whose indices count from 1."""
    import numpy as np

    points, faces = [], []
    for line in path.read_text().splitlines():
        word, *numbers = line.split() or [""]
        if word == "v":
            points.append(list(map(float, numbers[:3])))
        elif word == "f":
            first, *others = [int(corner.partition("/")[0]) - 1 for corner in numbers]
            faces += [[first, *pair] for pair in zip(others, others[1:])]
    return np.array(points), np.array(faces)


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


def textured_quad(corner, along, across):
    """The same with texture coordinates, from the corner on."""
    return *quad(corner, along, across), None, [[0, 0], [1, 0], [1, 1], [0, 1]]


def turned(points, turn):
    """Points turned by so many degrees about +Y."""
    import numpy as np

    sine, cosine = math.sin(math.radians(turn)), math.cos(math.radians(turn))
    return points @ np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])


def box(centre, size, turn):
    """A box turned by so many degrees about +Y."""
    import numpy as np

    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [face for a, b, c, d in quads for face in ([a, b, c], [a, c, d])]
    return turned(corners, turn) + np.array(centre), faces


def standing(mesh, at, length, turn):
    """A mesh as long along its longest side, turned about +Y, whose lowest point is on the height of `at`."""
    import numpy as np

    points, faces = mesh
    low, high = points.min(0), points.max(0)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return turned((points - foot) * length / (high - low).max(), turn) + np.array(at), faces


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


def closed_room():
    """The same without boxes, six metres deep and closed behind the camera."""
    whites = [quad([-1, 0, -1], [0, 0, 6], [2, 0, 0]), quad([-1, 2, -1], [2, 0, 0], [0, 0, 6]),
              quad([-1, 0, -1], [2, 0, 0], [0, 2, 0]), quad([-1, 0, 5], [0, 2, 0], [2, 0, 0])]
    return {"white": together(whites), "red": quad([-1, 0, -1], [0, 2, 0], [0, 0, 6]),
            "green": quad([1, 0, -1], [0, 0, 6], [0, 2, 0])}


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


def pattern():
    """Texels of a texture: 512 x 512, sRGB."""
    import numpy as np

    y, x = np.mgrid[0:512, 0:512]
    wave = 0.5 + 0.5 * np.sin(x / 9.0) * np.sin(y / 13.0 + np.sin(x / 31.0))
    return np.stack([255 * wave, 90 + 120 * (1 - wave), 60 + 90 * wave], -1).astype(np.uint8)


def write_png(path, texels):
    """A PNG file of colours."""
    import struct
    import zlib

    rows, columns, _ = texels.shape
    raw = b"".join(b"\0" + row.tobytes() for row in texels)
    chunk = lambda kind, data: (struct.pack(">I", len(data)) + kind + data
                                + struct.pack(">I", zlib.crc32(kind + data)))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))
