"""Frames by their numbers, values that are removed, and what objects say of themselves."""

import multiprocessing
import os
import pickle

import numpy as np
import pytest
from test_etendue import CHECKOUT, FACES, LENSES, QUAD, quad

import etendue


def orbit(count, **more):
    return quad(frames={"type": "orbit", "count": count, "center": [0, 0, 0]}, layers=["depth", "position"], **more)


def test_frames_are_a_sequence():
    frames = orbit(5).frames()
    assert len(frames) == 5
    poses = [shot.pose for shot in frames]
    for index in [3, 0, 4]:
        np.testing.assert_array_equal(frames[index].pose, poses[index])
    np.testing.assert_array_equal(frames[-1].pose, poses[4])
    np.testing.assert_array_equal(frames[np.int64(2)].pose, poses[2])
    some = frames[1:4:2]
    assert len(some) == 2
    np.testing.assert_array_equal(some[1]["depth"], frames[3]["depth"])
    assert not np.array_equal(poses[0], poses[1])
    for index in [5, -6]:
        with pytest.raises(IndexError, match="0 to 4"):
            frames[index]
    # What the scene says now.
    frames.scene["frames.count"] = 3
    assert len(frames) == 3


def test_a_scene_without_frames_has_one():
    frames = quad().frames()
    assert len(frames) == 1 and len(list(frames)) == 1
    np.testing.assert_array_equal(frames[0]["depth"], quad().render()["depth"])
    with pytest.raises(IndexError):
        frames[1]


def test_frames_go_to_other_processes():
    frames = pickle.loads(pickle.dumps(orbit(3).frames()))
    np.testing.assert_array_equal(frames[2]["depth"], orbit(3).frames()[2]["depth"])


def test_values_are_removed():
    scene = quad(render={"samples": 4, "seed": 3})
    before = scene.values
    assert "render.seed" in scene and "render.sampler" not in scene
    del scene["render.seed"]
    assert "render.seed" not in scene and scene["render.samples"] == 4
    scene["objects"] = [{"file": "mesh"}, {"shape": "sphere"}]
    del scene["objects[1]"]
    assert len(scene["objects"]) == 1
    del scene["render"]
    assert scene.values == {key: value for key, value in before.items() if key != "render"} | {"objects": [{"file": "mesh"}]}
    for path in ["render", "render.seed", "objects[7]", "camera.pose.from.x"]:
        with pytest.raises(KeyError, match=path.replace("[", r"\[").replace("]", r"\]")):
            del scene[path]
    # What the scene needs stays.
    with pytest.raises(ValueError, match="file|shape"):
        del scene["objects[0].file"]
    assert scene["objects[0].file"] == "mesh"
    np.testing.assert_array_equal(scene.render()["depth"], quad().render()["depth"])


def test_what_objects_say_of_themselves():
    scene = etendue.load(CHECKOUT / "scenes" / "cube.json", {"camera.sensor.resolution": [8, 6]})
    assert repr(scene).startswith("<etendue.Scene cube.json: objects ")
    assert repr(scene.render(samples=1)).startswith("<etendue.Shot 8 x 6: ")
    assert repr(scene.frames()).startswith("<etendue.Frames: 1 of <etendue.Scene")
    assert repr(etendue.Lens(LENSES / "achromat.json")).endswith(": 100.1 mm, f/4.17>")
    assert repr(etendue.Sensor("imx183")).startswith("<etendue.Sensor imx183: 5")
    exposed = etendue.Light(np.ones((4, 4)), unit="1").expose("imx183")
    assert repr(exposed) == "<etendue.Exposed: 1 of (4, 4)>"


def test_texture_coordinates_normals_and_colours_of_arrays():
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]])
    colors = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    tilted = np.tile([0.6, 0, 0.8], (4, 1))
    layers = ["uv", "albedo", "position", {"type": "normal", "kind": "shading"}]
    made = {"uvs": uvs, "normals": tilted, "colors": colors}
    scene = etendue.Scene(
        QUAD, FACES, **made, camera=quad()["camera"], layers=layers,
    )  # fmt: skip
    for scene in [scene, pickle.loads(pickle.dumps(scene))]:
        shot = scene.render()
        x, y = shot["position"][..., 0], shot["position"][..., 1]
        # The quad is 18 m wide and its v runs down; attributes are 32-bit floats.
        np.testing.assert_allclose(shot["uv"], np.stack([(x + 9) / 18, (9 - y) / 18], axis=-1), atol=1e-6)
        np.testing.assert_allclose(shot["normal_shading"], np.broadcast_to([0.6, 0, 0.8], x.shape + (3,)), atol=1e-7)
        # On the triangle below the diagonal the third corner's blue has the weight (y + 9) / 18; the grey is 0.8.
        below = x > y
        np.testing.assert_allclose(shot["albedo"][..., 2][below], 0.8 * ((y + 9) / 18)[below], atol=1e-6)
    checker = {"type": "checker", "colors": [[0, 0, 0], [1, 1, 1]], "squares": 2}
    scene["materials"], scene["objects[0].material"] = {"tiles": checker}, "tiles"
    scene.insert_mesh("mesh", QUAD, FACES, uvs=uvs)
    shot = scene.render()
    column, row = (2 * shot["uv"]).astype(int)[..., 0], (2 * shot["uv"]).astype(int)[..., 1]
    assert set(np.unique((column + row) % 2)) == {0, 1}
    albedo = shot["albedo"][..., 0]
    assert len({tuple(np.unique(albedo[(column + row) % 2 == k])) for k in (0, 1)}) == 2
    for name, value, words in [
        ("uvs", uvs[:3], "3 uvs are given for 4 vertices"),
        ("uvs", colors, r"\(4, 3\) instead of \(n, 2\)"),
        ("normals", np.full((4, 3), np.nan), "normals: that of vertex 0"),
        ("colors", colors[:, :2], r"instead of \(n, 4\)"),
    ]:
        with pytest.raises(ValueError, match=words):
            scene.insert_mesh("mesh", QUAD, FACES, **{name: value})
    with pytest.raises(ValueError, match="not given"):
        etendue.Scene(uvs=uvs)


def test_an_image_lies_by_texture_coordinates(tmp_path):
    import cv2

    image = np.zeros((2, 2, 3), np.uint8)
    image[0, 0], image[0, 1], image[1, 0] = [0, 0, 255], [0, 255, 0], [255, 0, 0]  # cv2 has blue first
    cv2.imwrite(str(tmp_path / "four.png"), image)
    paint = {"image": "four.png", "encoding": "linear", "filter": "nearest"}
    scene = etendue.Scene(
        QUAD, FACES, uvs=[[0, 1], [1, 1], [1, 0], [0, 0]], camera=quad()["camera"], layers=["albedo", "position"],
        objects=[{"file": "mesh", "material": "paint"}], materials={"paint": {"type": "matte", "color": paint}},
        folder=tmp_path,
    )  # fmt: skip
    shot = scene.render()
    left, top = shot["position"][..., 0] < 0, shot["position"][..., 1] > 0
    expected = np.zeros(left.shape + (3,))
    expected[left & top, 0] = expected[~left & top, 1] = expected[left & ~top, 2] = 1
    np.testing.assert_array_equal(shot["albedo"], expected)


def test_colours_go_through_the_filters_of_a_sensor():
    sensor = etendue.Sensor("imx183", {"cfa": "rggb"})
    assert sensor.facts["cfa"] == ["rg", "gb"]
    colors = np.zeros((40, 60, 3))
    colors[..., 0], colors[..., 1], colors[..., 2] = 500, 1500, 3000
    raw = sensor.expose(colors, seed=4)
    mosaic = np.empty((40, 60))
    mosaic[0::2, 0::2], mosaic[1::2, 1::2] = 500, 3000
    mosaic[0::2, 1::2] = mosaic[1::2, 0::2] = 1500
    np.testing.assert_array_equal(raw, sensor.expose(mosaic, seed=4))
    assert etendue.Sensor("imx183").facts["cfa"] is None
    with pytest.raises(ValueError, match="colour filter array"):
        etendue.Sensor("imx183").expose(colors)
    with pytest.raises(ValueError, match="filters w"):
        etendue.Sensor("imx183", {"cfa": "rgwb"}).expose(colors)


def test_denoising_wants_its_library():
    scene = quad(tracer={"type": "path"}, lights=[{"type": "environment", "radiance": [1, 1, 1]}])
    if "ETENDUE_OIDN" not in os.environ:
        try:
            scene.render(samples=2, denoise=True)
        except ValueError as error:
            assert "Open Image Denoise" in str(error), error
    else:
        shot = scene.render(samples=2, denoise=True)
        assert shot["denoised"].shape == shot["picture"].shape
    assert "denoised" not in scene.render(samples=2)


# Frames a worker of a data loader renders in its life, and workers; more by hand: ETENDUE_FRAMES=10000.
FRAMES = int(os.environ.get("ETENDUE_FRAMES", 320))
WORKERS = 16


def resident():
    """Bytes that this process holds."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGESIZE")


def share(frames, start, sender):
    """Renders each of a worker's frames, and tells what it held after a tenth of them and at the end."""
    numbers = range(start, len(frames), WORKERS)
    total, early = 0.0, None
    for done, number in enumerate(numbers):
        total += float(frames[number]["depth"].sum())
        if early is None and done >= len(numbers) // 10:
            early = resident()
    sender.send((total, early, resident()))


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_sixteen_workers_render_frames_in_bounded_memory(context):
    frames = orbit(FRAMES, **{}).frames()
    frames.scene.threads = 1
    if context == "spawn" and FRAMES > 1000:
        pytest.skip("as many frames as are asked for are rendered by forked workers")
    context = multiprocessing.get_context(context)
    workers = []
    for start in range(WORKERS):
        receiver, sender = context.Pipe(duplex=False)
        child = context.Process(target=share, args=(frames, start, sender))
        child.start()
        sender.close()
        workers.append((child, receiver))
    try:
        found = []
        for _, receiver in workers:
            assert receiver.poll(120 + FRAMES / 20), "a worker hangs"
            found.append(receiver.recv())
    finally:
        for child, _ in workers:
            child.kill()
            child.join()
    few = orbit(FRAMES).frames()
    assert found[0][0] == sum(float(few[number]["depth"].sum()) for number in range(0, FRAMES, WORKERS))
    for _, early, late in found:
        # Pages of the interpreter come and go by a few MiB; what a frame leaves would be hundreds of them.
        assert late - early < 16 << 20, f"{(late - early) >> 20} MiB more after {FRAMES // WORKERS} frames"
