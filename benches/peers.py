#!/usr/bin/env python3
"""Other programs at the same job, in one run, taking turns with etendue.

    python3 benches/peers.py [--triangles N] [--rounds N] [--output docs/measurements/benchmarks.md]

The job: the blob of `benchmarks models`, depth and normals of 1024 x 1024 pixels through the same
pinhole, once with one ray a pixel and, where a program can, with 16. Each program is timed twice:

* trace: from a built structure to arrays of depth and normals. For etendue this is the `render`
  stage of its own report: rays, traversal, f64 and filling the layers.
* load + build: from the file to the built structure.

Programs run in processes of their own, which stay alive between the rounds and do one thing when
they are told to, so that only one of them works at a time. The programs come from PyPI, into a
virtual environment below target/; what cannot be had is named in the table.
"""

import json
import statistics
import subprocess
import tempfile
import time
from pathlib import Path

import program
from section import put, spread

SIDE = 1024

# Title, packages of PyPI, model, and the ways to sample.
PEERS = {
    "open3d": ("Open3D", ["open3d"], "ply", [1, 16]),
    "embreex": ("trimesh with embreex", ["trimesh", "embreex"], "ply", [1]),
    "mitsuba_llvm": ("Mitsuba 3, llvm_ad_rgb", ["mitsuba"], "ply", [1, 16]),
    "mitsuba_scalar": ("Mitsuba 3, scalar_rgb", ["mitsuba"], "ply", [1, 16]),
}


def pinhole(scene):
    """Axes (rows: right, up, back), origin and tangent of half the field of view of a scene."""
    import numpy as np

    camera = json.loads(Path(scene).read_text())["camera"]
    origin = np.array(camera["pose"]["from"])
    back = origin - np.array(camera["pose"]["look_at"])
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    tangent = np.tan(np.radians(camera["fov"]) / 2)
    return np.stack([right, np.cross(back, right), back]), origin, tangent


def rays(scene, samples):
    """Origins and directions, one row a ray, in rows of pixels; jittered when there are several."""
    import numpy as np

    axes, origin, tangent = pinhole(scene)
    places = np.arange(SIDE)
    rows, columns = np.meshgrid(places, places, indexing="ij")
    random = np.random.default_rng(1)
    shape = (SIDE, SIDE, samples)
    dx, dy = random.random((2, *shape)) if samples > 1 else np.full((2, *shape), 0.5)
    x = ((columns[..., None] + dx) * 2 / SIDE - 1) * tangent
    y = (1 - (rows[..., None] + dy) * 2 / SIDE) * tangent
    directions = np.stack([x, y, np.full(shape, -1.0)], axis=-1).reshape(-1, 3) @ axes
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.broadcast_to(origin, directions.shape), directions


class Open3d:
    """Its raycasting scene, which is Embree; the rays are made beforehand."""

    def __init__(self, folder):
        self.folder = folder
        self.rays = {}

    def load(self):
        import open3d

        mesh = open3d.t.io.read_triangle_mesh(str(self.folder / "blob.ply"))
        self.scene = open3d.t.geometry.RaycastingScene()
        self.scene.add_triangles(mesh)
        # The structure is built at the first query.
        self.scene.cast_rays(open3d.core.Tensor([[0.0, 0, 9, 0, 0, -1]]).to(open3d.core.float32))

    def prepare(self, samples):
        import numpy as np
        import open3d

        both = np.concatenate(rays(self.folder / "ply.json", samples), axis=1)
        self.rays[samples] = open3d.core.Tensor(both.astype(np.float32))

    def trace(self, samples):
        answer = self.scene.cast_rays(self.rays[samples])
        return float(answer["t_hit"][SIDE // 2 * SIDE * samples + SIDE // 2 * samples].item())


class Embreex:
    """trimesh's ray queries through embreex; depth from the hits' places, normals by triangle."""

    def __init__(self, folder):
        self.folder = folder
        self.rays = {}

    def load(self):
        import trimesh
        from trimesh.ray.ray_pyembree import RayMeshIntersector

        self.mesh = trimesh.load(self.folder / "blob.ply", process=False)
        self.intersector = RayMeshIntersector(self.mesh, scale_to_box=False)
        self.intersector.intersects_first([[0.0, 0, 9]], [[0.0, 0, -1]])
        self.normals = self.mesh.face_normals

    def prepare(self, samples):
        self.rays[samples] = [part.copy() for part in rays(self.folder / "ply.json", samples)]

    def trace(self, samples):
        import numpy as np

        origins, directions = self.rays[samples]
        triangle = self.intersector.intersects_first(origins, directions)
        hit = triangle >= 0
        normal = np.zeros(directions.shape)
        normal[hit] = self.normals[triangle[hit]]
        # Depth from the plane of the triangle: trimesh gives indices only, without that detour.
        corner = self.mesh.vertices[self.mesh.faces[triangle[hit], 0]]
        depth = np.full(len(directions), np.inf)
        toward = np.einsum("ij,ij->i", normal[hit], directions[hit])
        depth[hit] = np.einsum("ij,ij->i", normal[hit], corner - origins[hit]) / toward
        return float(depth[SIDE // 2 * SIDE + SIDE // 2])


class Mitsuba:
    """Mitsuba's aov integrator: depth and geometric normals."""

    def __init__(self, folder, variant):
        import mitsuba

        mitsuba.set_variant(variant)
        self.mitsuba = mitsuba
        self.folder = folder

    def load(self):
        mi = self.mitsuba
        camera = json.loads((self.folder / "ply.json").read_text())["camera"]
        pose = camera["pose"]
        frame = mi.ScalarTransform4f().look_at(pose["from"], pose["look_at"], [0, 1, 0])
        self.scene = mi.load_dict({
            "type": "scene",
            "integrator": {"type": "aov", "aovs": "depth:depth,normal:geo_normal"},
            "sensor": {
                "type": "perspective", "fov": camera["fov"], "to_world": frame,
                "film": {"type": "hdrfilm", "width": SIDE, "height": SIDE,
                         "rfilter": {"type": "box"}},
            },
            "shape": {"type": "ply", "filename": str(self.folder / "blob.ply"),
                      "face_normals": True},
        })

    def prepare(self, samples):
        pass

    def trace(self, samples):
        import numpy as np

        image = np.array(self.mitsuba.render(self.scene, spp=samples))
        return float(image[SIDE // 2, SIDE // 2, -4])


def make(peer, folder):
    if peer == "open3d":
        return Open3d(folder)
    if peer == "embreex":
        return Embreex(folder)
    variant = {"mitsuba_llvm": "llvm_ad_rgb", "mitsuba_scalar": "scalar_rgb"}[peer]
    return Mitsuba(folder, variant)


def serve(peer, folder):
    """Answers with its seconds and its value."""
    subject = make(peer, Path(folder))
    prepared = set()

    def answer(word, samples=1):
        if word == "trace" and samples not in prepared:
            subject.prepare(samples)
            prepared.add(samples)
        start = time.perf_counter()
        value = subject.load() if word == "load" else subject.trace(samples)
        return time.perf_counter() - start, value

    program.serve(answer)


class Etendue:
    """The `etendue` command on the GLB; one process a run."""

    def __init__(self, folder):
        self.program, self.folder = program.built("etendue"), Path(folder)

    def run(self, *more):
        report = self.folder / "report.json"
        command = [self.program, "render", self.folder / "glb.json", "-o", self.folder / "out",
                   "--outputs", "exr", "--quiet", "--report", report, *more]
        start = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        whole = time.perf_counter() - start
        return json.loads(report.read_text())["seconds"] | {"whole": whole}


def measure(arguments, folder):
    """Seconds by (title, what), and remarks on what could not be measured."""
    series, remarks, peers, depths = {}, [], {}, {}
    for peer, (title, packages, _, ways) in PEERS.items():
        ok, words = program.install(packages)
        if not ok:
            remarks.append(f"{title} is left out: pip could not install it ({words}).")
            continue
        versions = ", ".join(f"{package} {program.version(package)}" for package in packages)
        process = program.Peer(__file__, peer, folder)
        try:
            process.ask("load")
            for samples in ways:
                depths[f"{title} ({versions})"] = process.ask("trace", samples)[1]
        except RuntimeError as error:
            remarks.append(f"{title} is left out: {error}")
            process.end()
            continue
        peers[f"{title} ({versions})"] = (process, ways)
    ours = Etendue(folder)
    ours.run()
    note = lambda title, what, seconds: series.setdefault((title, what), []).append(seconds)
    for _ in range(arguments.rounds):
        once = ours.run()
        note("etendue", "trace, 1", once["render"])
        note("etendue", "load + build", once["load"] + once["build"])
        note("etendue", "whole process", once["whole"])
        note("etendue", "trace, 16",
             ours.run("--layers", "facing", "--samples", "16")["render"])
        for title, (process, ways) in peers.items():
            note(title, "load + build", process.ask("load")[0])
            for samples in ways:
                note(title, f"trace, {samples}", process.ask("trace", samples)[0])
    for process, _ in peers.values():
        process.end()
    return series, remarks, depths


def table(series, remarks, depths, arguments):
    columns = ["trace, 1", "trace, 16", "load + build", "whole process"]
    titles = list(dict.fromkeys(title for title, _ in series))

    def cell(title, what):
        values = series.get((title, what))
        return spread(values, 3) if values else "-"

    lines = [
        "",
        f"The blob of {arguments.triangles} triangles, depth and normals, 1024 x 1024 pixels; "
        f"seconds on all cores, medians of {arguments.rounds} rounds in which the programs take "
        "turns, with the fastest and the slowest. etendue reads the GLB, the others the PLY. "
        "etendue's 16 samples are a colour from the normal (`facing`): its depth and normals are "
        "those of the chief ray, never averages. Times of others are without writing a file; "
        "rays for Open3D and embreex are made beforehand and not counted.",
        "",
        "| | " + " | ".join(columns) + " |",
        "|---" * (len(columns) + 1) + "|",
    ]
    for title in titles:
        lines.append(f"| {title} | " + " | ".join(cell(title, what) for what in columns) + " |")
    lines.append("")
    for what in ["trace, 1", "trace, 16", "load + build"]:
        others = [(statistics.median(series[title, what]), title)
                  for title in titles if title != "etendue" and (title, what) in series]
        if others:
            best, title = min(others)
            times = best / statistics.median(series["etendue", what])
            lines.append(f"- {what}: etendue is {times:.2f} times as fast as the best of the "
                         f"others, {title}.")
    whole = [(statistics.median(series[title, "load + build"])
              + statistics.median(series[title, "trace, 1"]), title)
             for title in titles if (title, "load + build") in series and title != "etendue"]
    if whole:
        best, title = min(whole)
        times = best / statistics.median(series["etendue", "whole process"])
        lines.append(f"- file to pixels: etendue's whole process, its EXR written, is {times:.2f} "
                     f"times as fast as load, build and trace of {title} (goal: 4 at 10M "
                     "triangles).")
    if depths:
        seen = ", ".join(f"{title} {depth:.6f}" for title, depth in depths.items())
        lines.append(f"- all look at the same: depth at the picture's centre (m): {seen}.")
    lines += [f"- {remark}" for remark in remarks]
    return "\n".join(lines) + "\n"


def main():
    parser = program.arguments(__doc__, "measurements/benchmarks.md", rounds=5)
    parser.add_argument("--triangles", type=int, nargs="+", default=[1_000_000, 10_000_000])
    arguments = parser.parse_args()
    program.enter("peers")
    text = ""
    for triangles in arguments.triangles:
        arguments.triangles = triangles
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([program.built("benchmarks"), "models", folder, "--triangles",
                            str(triangles)], check=True)
            text += table(*measure(arguments, folder), arguments)
    put(arguments.output, "peers", text)
    print(text)


if __name__ == "__main__":
    program.begin(main, serve)
