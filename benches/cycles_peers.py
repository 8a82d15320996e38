#!/usr/bin/env python3
"""Light in etendue and in Blender's Cycles, in one run, taking turns.

    python3 benches/cycles_peers.py [--rounds N] [--output docs/measurements/benchmarks-cycles.md]

The jobs are those scenes of `light_scenes.py` whose surfaces are matte. Cycles is `bpy` from PyPI, on processors, with
its light tree, without its adaptive sampling, clamping and denoising, and with a box as the pixel's filter. Timed is
the processor's clock of all threads: of both what a render of twice as many samples takes beyond a plain one.
"""

import math
import os
import statistics
import tempfile
import textwrap
import time
from pathlib import Path

import light_peers
import light_scenes
import program
from light_scenes import SAMPLES, SIDE

JOBS = ["Cornell box, direct", "Cornell box, path of 5 bounces", "100 point lights", "1000 emissive triangles"]


def read_ply(path):
    """Points and triangles of a file that `light_meshes.write_ply` wrote."""
    import numpy as np

    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    count = {line.split()[1]: int(line.split()[2]) for line in lines if line.startswith("element")}
    columns = sum(line.startswith("property float") for line in lines)
    size = 4 * columns * count["vertex"]
    points = np.frombuffer(body[:size], "<f4").reshape(-1, columns)[:, :3]
    rows = np.frombuffer(body[size:], [("count", "u1"), ("corners", "<i4", 3)])
    return points, rows["corners"]


class Cycles:
    """The scenes by Cycles."""

    def __init__(self, folder):
        import bpy

        self.bpy, self.folder = bpy, folder

    def load(self, job):
        """Makes the scene of a job the one that is rendered."""
        from mathutils import Matrix, Vector

        bpy = self.bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = light_scenes.scene_of(job, self.folder)
        blender = bpy.context.scene
        # Nothing but what light does.
        blender.render.engine = "CYCLES"
        blender.world = bpy.data.worlds.new("dark")
        blender.world.use_nodes = True
        blender.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
        cycles = blender.cycles
        cycles.device, cycles.use_light_tree = "CPU", True
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.light_sampling_threshold = 0.0
        # Bounces beyond the first surface.
        bounces = scene["tracer"].get("max_bounces", 1) - 1
        cycles.max_bounces = cycles.diffuse_bounces = bounces
        cycles.pixel_filter_type = "BOX"
        render = blender.render
        render.resolution_x = render.resolution_y = SIDE
        render.resolution_percentage = 100
        render.image_settings.file_format = "OPEN_EXR"
        render.image_settings.color_depth, render.image_settings.color_mode = "32", "RGB"
        render.filepath = str(self.folder / "cycles.exr")
        # The camera looks along -Z, its picture upright along +Y.
        pose, view = scene["camera"]["pose"], bpy.data.cameras.new("camera")
        view.angle = math.radians(scene["camera"]["fov"])
        camera = bpy.data.objects.new("camera", view)
        place = Vector(pose["from"])
        back = (place - Vector(pose["look_at"])).normalized()
        right = Vector((0, 1, 0)).cross(back).normalized()
        axes = Matrix((right, back.cross(right), back)).transposed().to_4x4()
        camera.matrix_world = Matrix.Translation(place) @ axes
        blender.collection.objects.link(camera)
        blender.camera = camera
        materials = {name: self.material(name, spec) for name, spec in scene["materials"].items()}
        for thing in scene["objects"]:
            points, faces = read_ply(self.folder / thing["file"])
            mesh = bpy.data.meshes.new(thing["file"])
            mesh.from_pydata(points.tolist(), [], faces.tolist())
            mesh.materials.append(materials[thing["material"]])
            blender.collection.objects.link(bpy.data.objects.new(thing["file"], mesh))
        for number, light in enumerate(scene["lights"]):
            lamp = bpy.data.lights.new(f"light{number}", "POINT")
            lamp.shadow_soft_size = 0.0
            # Watts over the whole sphere, of the white that all of them are.
            lamp.energy = 4 * math.pi * light["intensity"][0]
            point = bpy.data.objects.new(f"light{number}", lamp)
            point.location = light["at"]
            blender.collection.objects.link(point)

    def material(self, name, spec):
        """A matte surface, or one whose front shines and that reflects nothing."""
        made = self.bpy.data.materials.new(name)
        made.use_nodes = True
        nodes, links = made.node_tree.nodes, made.node_tree.links
        nodes.clear()
        out = nodes.new("ShaderNodeOutputMaterial")
        if spec["type"] == "emissive":
            own = nodes.new("ShaderNodeEmission")
            own.inputs["Color"].default_value = [*spec["radiance"], 1.0]
            front = nodes.new("ShaderNodeMath")
            front.operation, front.inputs[0].default_value = "SUBTRACT", 1.0
            links.new(nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], front.inputs[1])
            links.new(front.outputs[0], own.inputs["Strength"])
            made.cycles.emission_sampling = "FRONT"
        else:
            own = nodes.new("ShaderNodeBsdfDiffuse")
            own.inputs["Color"].default_value = [*spec["color"], 1.0]
        links.new(own.outputs[0], out.inputs["Surface"])
        return made

    def trace(self, samples, seed):
        """Processor seconds of a render, and its picture."""
        import numpy as np

        bpy = self.bpy
        scene = bpy.context.scene
        scene.cycles.samples, scene.cycles.seed = samples, seed
        start = time.process_time()
        bpy.ops.render.render(write_still=True)
        seconds = time.process_time() - start
        image = bpy.data.images.load(scene.render.filepath)
        picture = np.array(image.pixels[:], dtype=np.float64).reshape(SIDE, SIDE, -1)[::-1, :, :3]
        bpy.data.images.remove(image)
        return seconds, picture


def serve(_, folder):
    """Answers with its seconds and the picture's file."""
    import numpy as np

    subject = Cycles(Path(folder))

    def answer(word, job, seed):
        if word == "load":
            subject.load(job)
            return 0, ""
        twice, _ = subject.trace(2 * SAMPLES, seed)
        once, picture = subject.trace(SAMPLES, seed)
        name = str(Path(folder) / "cycles.npy")
        np.save(name, picture)
        return twice - once, name

    program.serve(answer)


def measure(arguments, folder):
    """Seconds and pictures of both, by job and program."""
    import numpy as np

    # Blender's threads are as many as the processors, as etendue's are.
    process = program.Peer(__file__, "cycles", folder)
    ours, results = light_peers.Etendue(folder), {}
    for job in arguments.jobs:
        process.ask("load", job, 0)
        taken = {"etendue": [], "Cycles": []}
        for seed in range(arguments.rounds):
            seconds, picture, _ = ours.trace(job, seed)
            taken["etendue"].append((seconds, picture))
            seconds, name = process.ask("trace", job, seed)
            taken["Cycles"].append((seconds, np.load(name)))
        results[job] = taken
    process.end()
    return results


def page(results, arguments):
    import numpy as np

    lines = ["# Light, against Blender's Cycles", "",
             "`make bench-cycles` measures this and writes this page: the matte scenes of [the page on Mitsuba]"
             f"(benchmarks-light.md), {SIDE} × {SIDE} pixels of {SAMPLES} samples, by Cycles of bpy "
             f"{program.version('bpy')} on processors, with its light tree, without adaptive sampling, clamping and "
             f"denoising. Tracing alone, processor seconds of all threads ({os.cpu_count()} cores), medians of "
             f"{arguments.rounds} rounds in which the programs take turns. *Noise*, *median* and *cost* are what "
             "they are there.", ""]
    for job, taken in results.items():
        lines += [f"## {job[0].upper() + job[1:]}", "",
                  "| | seconds | noise | median | mean | etendue is faster by | cost at one error |",
                  "|---|---|---|---|---|---|---|"]
        middle = {title: statistics.median(seconds for seconds, _ in all) for title, all in taken.items()}
        pictures = {title: [picture for _, picture in all] for title, all in taken.items()}
        noise = {title: light_peers.noises(some) for title, some in pictures.items()}
        own = middle["etendue"] * noise["etendue"][0] ** 2
        for title, all in taken.items():
            seconds = [one for one, _ in all]
            lines.append(
                f"| {title} | {middle[title]:.2f} ({min(seconds):.2f} to {max(seconds):.2f}) | {100 * noise[title][0]:.2f} % "
                f"| {100 * noise[title][1]:.2f} % | {np.mean(pictures[title]):.4f} "
                f"| {middle[title] / middle['etendue']:.2f} | {middle[title] * noise[title][0] ** 2 / own:.2f} |")
        lines.append("")
    wrapped = [line if line.startswith(("|", "#")) else textwrap.fill(line, 120) for line in lines]
    return "\n".join(wrapped).rstrip() + "\n"


def main():
    parser = program.arguments(__doc__, "measurements/benchmarks-cycles.md", rounds=5)
    parser.add_argument("--jobs", nargs="+", choices=JOBS, default=JOBS)
    arguments = parser.parse_args()
    # An environment of its own: Blender brings a Python that it was built for.
    program.enter("cycles", ["numpy", "bpy"])
    with tempfile.TemporaryDirectory() as folder:
        text = page(measure(arguments, folder), arguments)
    arguments.output.write_text(text)
    print(text)


if __name__ == "__main__":
    program.begin(main, serve)
