"""Scenes and what they are made of in other processes: forked, spawned, pickled."""

import copy
import json
import multiprocessing
import os
import pickle

import numpy as np
import pytest
from test_etendue import CHECKOUT, FACES, LENSES, QUAD, quad

import etendue

CONTEXTS = ["fork", "spawn"]


def everything(scene, accel, lens, distance):
    """What all of the package gives with the camera or an object elsewhere."""
    scene["camera.pose.from"] = [0, 0, distance]
    scene["objects[0].transform.translate"] = [0, 0, distance / 8]
    depth = scene.render()["depth"]
    ball = {"shape": "sphere", "radius": 1.5}
    light = quad(objects=[ball], tracer={"type": "path"}, layers=[]).render(samples=4)["picture"]
    rays = np.tile([0.1, 0.2, distance], (5000, 1))
    t = accel.closest(rays, [[0, 0, -1]] * 5000).t
    again = etendue.Accel(QUAD * distance, FACES).occluded(rays, [[0, 0, -1]] * 5000)
    traced = lens.trace([[0, 1, -50]] * 5000, [[0, 0, 1]] * 5000).positions
    raw = etendue.Sensor("imx183").expose(np.full((64, 64), 100.0 * distance))
    orbit = {"type": "orbit", "count": 2, "center": [0, 0, 0]}
    frames = [shot["depth"] for shot in quad(frames=orbit).frames()]
    return [depth, light, t, again, traced, raw, *frames]


def work(sender, *arguments):
    sender.send(everything(*arguments))


def in_child(context, *arguments):
    """`everything` of another process, which must not hang."""
    context = multiprocessing.get_context(context)
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=work, args=(sender, *arguments))
    child.start()
    sender.close()
    try:
        assert receiver.poll(60), "the child hangs"
        return receiver.recv()
    finally:
        child.kill()
        child.join()


@pytest.mark.parametrize("context", CONTEXTS)
def test_a_child_does_what_its_parent_does(context):
    scene, accel = quad(), etendue.Accel(QUAD, FACES)
    lens = etendue.Lens(LENSES / "achromat.json")
    # Pools and libraries have their threads in the parent before there is a child.
    for distance in [2.5, 3.5, 4.5] if context == "fork" else [2.5]:
        expected = everything(scene, accel, lens, distance)
        scene["camera.pose.from"] = [0, 0, 1]
        found = in_child(context, scene, accel, lens, distance)
        for a, b in zip(expected, found):
            np.testing.assert_array_equal(a, b)


def render_from(task):
    scene, distance = task
    scene["camera.pose.from"] = [0, 0, distance]
    return scene.render()


@pytest.mark.parametrize("context", CONTEXTS)
def test_workers_take_scenes_and_return_shots(context):
    scene = quad(camera={**quad()["camera"], "sensor": {"resolution": [8, 6], "type": "raw", "exposure": 0.01}},
                 tracer={"type": "facing"})  # fmt: skip
    scene.threads = 1
    scene.render()
    with multiprocessing.get_context(context).Pool(2) as pool:
        shots = pool.map_async(render_from, [(scene, 2.0), (scene, 3.0), (scene, 5.0)]).get(60)
    for shot, distance in zip(shots, [2.0, 3.0, 5.0]):
        own = render_from((scene, distance))
        assert list(shot) == list(own) and shot.report["threads"] == 1
        for key in own:
            np.testing.assert_array_equal(shot[key], own[key])
        np.testing.assert_array_equal(shot.raw, own.raw)
        np.testing.assert_array_equal(shot.K, own.K)
        assert shot.meaning("depth") == own.meaning("depth") and shot.exposures == own.exposures
        assert shot.report["image_hash"] == own.report["image_hash"] and shot._repr_png_() is None
        with pytest.raises(ValueError, match="arrays alone"):
            shot.write("nowhere")


def copies(scene):
    return [pickle.loads(pickle.dumps(scene)), copy.copy(scene), copy.deepcopy(scene)]


def test_copies_are_the_same_scene(tmp_path):
    (tmp_path / "own.obj").write_text("v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n")
    own = etendue.load(tmp_path / "own.obj")
    small = {"camera.sensor.resolution": [16, 12], "render.samples": 1}
    irrational = etendue.Scene(QUAD / 3, FACES, camera=quad()["camera"], layers=["depth"])
    for scene in [quad(), irrational, own, etendue.load(CHECKOUT / "scenes" / "cube.json", small)]:
        scene["camera.fov"] = 33
        report = scene.render().report
        for other in copies(scene):
            again = other.render().report
            for key in ["scene_hash", "image_hash"]:
                assert again[key] == report[key]
            # Its own: a change here is none there.
            other["camera.fov"] = 44
            assert scene["camera.fov"] == 33
    # A copy of bytes holds them, and its folder goes with it alone.
    scene = etendue.load((tmp_path / "own.obj").read_bytes())
    path = scene._folder.name
    other = pickle.loads(pickle.dumps(scene))
    assert other._folder.name != path and os.listdir(other._folder.name) == ["model.glb"]
    child = os.fork()
    if child == 0:
        del scene
        os._exit(0)
    os.waitpid(child, 0)
    assert os.path.exists(path)
    del scene
    assert not os.path.exists(path) and os.path.exists(other._folder.name)


def test_copies_guard_the_files_that_the_scene_was_read_from(tmp_path):
    # The camera's file has the name of a file of the results, and no value of the scene names it any more.
    (tmp_path / "camera.json").write_text(json.dumps(quad()["camera"]))
    scene = {"etendue": 1, "camera": "camera.json", "layers": ["depth"], "objects": [{"shape": "sphere"}]}
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    scene = etendue.load(tmp_path / "scene.json")
    for other in [scene, *copies(scene), pickle.loads(pickle.dumps(copy.copy(scene)))]:
        with pytest.raises((ValueError, OSError), match="camera.json"):
            other.render().write(tmp_path)
    assert json.loads((tmp_path / "camera.json").read_text()) == quad()["camera"]


def test_a_sensor_is_pickled():
    sensor = pickle.loads(pickle.dumps(etendue.Sensor("imx183", {"temperature": 313.15})))
    assert sensor.facts == etendue.Sensor("imx183", {"temperature": 313.15}).facts
    assert sensor.facts != etendue.Sensor("imx183").facts


def test_threads_are_as_many_as_are_asked_for():
    for threads in [1, 3]:
        assert quad(threads=threads).render().report["threads"] == threads
    scene = quad()
    scene.threads = 2
    assert copy.copy(scene).render().report["threads"] == 2
    for threads in [0, -1, 1.5, 5000, True]:
        with pytest.raises(ValueError, match="threads is"):
            quad(threads=threads)
    one, two = (etendue.Accel(QUAD, FACES, threads=threads) for threads in [1, 2])
    rays = np.random.default_rng(1).normal(size=(3000, 3))
    for a, b in zip(one.closest(rays, -rays), two.closest(rays, -rays)):
        np.testing.assert_array_equal(a, b)
