#!/usr/bin/env python3
"""The Python package against its own Rust and against other ray casters, and frames against their rays.

    python3 benches/python_peers.py [--rounds N] [--output docs/measurements/benchmarks-python.md]

* A million rays into the blob of a million triangles, from arrays to arrays of distance, triangle and
  normal: `etendue.Accel.closest`, the same call from Rust with rays in batches made beforehand (the
  program `closest`), Open3D's `RaycastingScene` and embreex through trimesh. Programs take turns, each in a
  process of its own.
* A hundred poses of that blob, depth and normals of 640 x 480 pixels: the time of the frames after the
  first, over what their rays alone take.
* Memory over a thousand frames.

The wheel is that of `make python`; other programs come from PyPI.
"""

import json
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import program
from section import put, spread

TRIANGLES = 1_000_000
SIDE = 1000


def arrays(folder):
    """Writes the blob and the rays as plain numbers; neighbours in a row of pixels stand side by side."""
    import numpy as np
    import trimesh

    mesh = trimesh.load(folder / "blob.ply", process=False)
    vertices, faces = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.uint32)
    origin = np.array([1.5, 2.2, 3.3])
    back = origin / np.linalg.norm(origin)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    places = ((np.arange(SIDE) + 0.5) * 2 / SIDE - 1) * 0.25
    x, y = np.meshgrid(places, -places)
    directions = np.stack([x, y, np.full_like(x, -1.0)], axis=-1).reshape(-1, 3)
    directions = directions @ np.stack([right, np.cross(back, right), back])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = np.ascontiguousarray(np.broadcast_to(origin, directions.shape))
    for name, values in {"vertices.f64": vertices, "faces.u32": faces, "origins.f64": origins,
                         "directions.f64": directions}.items():
        values.tofile(folder / name)


def read(folder):
    import numpy as np

    rows = lambda name, kind: np.fromfile(folder / name, dtype=kind).reshape(-1, 3)
    return (rows("vertices.f64", np.float64), rows("faces.u32", np.uint32),
            rows("origins.f64", np.float64), rows("directions.f64", np.float64))


class Etendue:
    def __init__(self, folder):
        import etendue

        vertices, faces, self.origins, self.directions = read(folder)
        self.accel = etendue.Accel(vertices, faces)

    def trace(self):
        return self.accel.closest(self.origins, self.directions, coherent=True).t


class Open3d:
    """Rays in its own tensor, single precision, made beforehand."""

    def __init__(self, folder):
        import numpy as np
        import open3d

        vertices, faces, origins, directions = read(folder)
        self.scene = open3d.t.geometry.RaycastingScene()
        self.scene.add_triangles(open3d.core.Tensor(vertices.astype(np.float32)),
                                 open3d.core.Tensor(faces))
        both = np.concatenate([origins, directions], axis=1).astype(np.float32)
        self.rays = open3d.core.Tensor(both)

    def trace(self):
        answer = self.scene.cast_rays(self.rays)
        return answer["t_hit"].numpy()


class Embreex:
    """embreex by itself, without what trimesh adds: rays in single precision made beforehand."""

    def __init__(self, folder):
        import numpy as np
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        vertices, faces, origins, directions = read(folder)
        self.scene = EmbreeScene()
        TriangleMesh(self.scene, vertices.astype(np.float32)[faces])
        self.origins, self.directions = origins.astype(np.float32), directions.astype(np.float32)

    def trace(self):
        import numpy as np

        found = self.scene.run(self.origins, self.directions, output=1)
        return np.where(found["geomID"] >= 0, found["tfar"], np.inf)


KINDS = {"etendue": Etendue, "open3d": Open3d, "embreex": Embreex}


def serve(kind, folder):
    import numpy as np

    subject = KINDS[kind](Path(folder))

    def answer(_word):
        start = time.perf_counter()
        t = subject.trace()
        seconds = time.perf_counter() - start
        return seconds, float(t[np.isfinite(t)].sum())

    program.serve(answer)


class Rust(program.Peer):
    """The same protocol."""

    def __init__(self, folder):
        self.process = subprocess.Popen([program.built("closest"), folder], text=True,
                                        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE)


def rays(rounds, folder):
    """Lines on a million rays."""
    peers, remarks = {}, []
    arrays(folder)
    for title, kind, packages in [
        ("etendue from Python", "etendue", []),
        ("etendue from Rust", None, []),
        ("Open3D", "open3d", ["open3d"]),
        ("embreex", "embreex", ["embreex"]),
    ]:
        ok, words = program.install(packages)
        if not ok:
            remarks.append(f"- {title} is left out: pip could not install it ({words}).")
            continue
        process = program.Peer(__file__, kind, folder) if kind else Rust(folder)
        try:
            process.ask("trace")
        except RuntimeError as error:
            remarks.append(f"- {title} is left out: {error}")
            continue
        names = " ".join(f"{package} {program.version(package)}" for package in packages)
        peers[f"{title} ({names})" if names else title] = process
    seconds, sums = {title: [] for title in peers}, {}
    for _ in range(rounds):
        for title, process in peers.items():
            took, sums[title] = process.ask("trace")
            seconds[title].append(took)
    for process in peers.values():
        process.end()
    middle = {title: statistics.median(values) for title, values in seconds.items()}
    ours = middle["etendue from Python"]
    lines = ["| | seconds | Mrays/s | times etendue from Python |", "|---|---|---|---|"]
    for title, values in seconds.items():
        lines.append(f"| {title} | {spread(values, 4)} | {SIDE * SIDE / middle[title] / 1e6:.1f} | "
                     f"{middle[title] / ours:.2f} |")
    ratio = ours / middle["etendue from Rust"]
    lines += ["", f"- From Python it takes {ratio:.3f} times what it takes from Rust (goal: 1.1)."]
    lines.append("- All look at the same: the distances add up to "
                 + ", ".join(f"{value:.3f}" for value in sums.values()) + " m.")
    return lines + remarks


def scene():
    import etendue

    return etendue.Scene(
        layers=["depth", "normal"],
        camera={"type": "pinhole", "fov": 34, "pose": {"from": [1.5, 2.2, 3.3], "look_at": [0, 0, 0]},
                "sensor": {"resolution": [640, 480]}},
        objects=[{"shape": "blob", "triangles": TRIANGLES, "seed": 7, "radius": 0.8}],
        frames={"type": "orbit", "count": 100},
    )


def poses(rounds):
    """Lines on a hundred poses."""
    shares, walls, traced = [], [], []
    for _ in range(rounds):
        frames = scene().frames()
        next(frames)
        start = time.perf_counter()
        tracing = sum(shot.report["seconds"]["render"] for shot in frames)
        wall = time.perf_counter() - start
        shares.append(wall / tracing)
        walls.append(wall)
        traced.append(tracing)
    return [
        f"The 99 frames after the first take {spread(walls, 2)} s, their rays alone {spread(traced, 2)} s: "
        f"{spread(shares, 3)} times their rays (goal: 1.15).",
    ]


def memory():
    """Lines on a thousand frames of a small picture."""
    import etendue

    def resident():
        for line in open("/proc/self/status"):
            if line.startswith("VmRSS"):
                return int(line.split()[1]) / 1024
        return 0.0

    frames = etendue.Scene(
        layers=["depth", "normal"],
        camera={"type": "pinhole", "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
                "sensor": {"resolution": [320, 240]}},
        objects=[{"shape": "blob", "triangles": 100_000, "seed": 7}],
        frames={"type": "orbit", "count": 1000},
    ).frames()
    peaks = []
    for number, shot in enumerate(frames):
        shot["depth"]
        del shot
        if number % 100 == 0:
            peaks.append(0.0)
        peaks[-1] = max(peaks[-1], resident())
    change = peaks[-1] / peaks[1] - 1
    shown = ", ".join(f"{peak:.1f}" for peak in peaks)
    return [f"The most memory (MiB) in each hundred of a thousand frames: {shown}. The last hundred takes "
            f"{100 * change:+.2f} % of the second (goal: within 1 %)."]


def main():
    parser = program.arguments(__doc__, "measurements/benchmarks-python.md", rounds=7)
    arguments = parser.parse_args()
    program.enter("peers", ["trimesh", "numpy"])
    wheels = sorted((program.ROOT / "out" / "python" / "wheels").glob("*.whl"))
    if not wheels:
        raise SystemExit("no wheel in out/python/wheels: `make python` makes it")
    program.install(["--force-reinstall", "--no-deps", str(wheels[-1])])
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([program.built("benchmarks"), "models", folder, "--triangles", str(TRIANGLES)],
                       check=True)
        lines = ["", "## A million rays", "",
                 f"A million rays of a pinhole, in rows of pixels, into the blob of {TRIANGLES} triangles; "
                 f"seconds on all cores, medians of {arguments.rounds} rounds in which the programs take "
                 "turns, with the fastest and the slowest. etendue takes and gives double precision and "
                 "measures in it, the others are single precision.", ""]
        lines += rays(arguments.rounds, Path(folder))
    lines += ["", "## A hundred poses", "", *poses(3), "", "## A thousand frames", "", *memory(), ""]
    text = "\n".join(lines)
    put(arguments.output, "python", text)
    print(text)


if __name__ == "__main__":
    program.begin(main, serve)
