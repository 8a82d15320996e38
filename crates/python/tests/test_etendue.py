"""The installed package, as its users call it."""

import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest

import etendue

CHECKOUT = pathlib.Path(os.environ["ETENDUE_CHECKOUT"])
LENSES = CHECKOUT / "scenes" / "lenses"

# A few roundings of f64 of the direction and along it.
EPSILON = 1e-15
QUAD = np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def quad(**more):
    camera = {
        "type": "pinhole",
        "fov": 40,
        "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [8, 6]},
    }
    return etendue.Scene(QUAD, FACES, **{"camera": camera, "layers": ["depth", "normal", "ids"], **more})


@pytest.fixture(autouse=True)
def heeds_ctrl_c():
    """A process that was started in the background ignores SIGINT until it says otherwise."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_layers_are_arrays():
    scene = quad()
    shot = scene.render()
    assert set(shot) >= {"depth", "normal", "id_object"}
    assert shot["depth"].shape == (6, 8) and shot["depth"].dtype == np.float64
    np.testing.assert_allclose(shot["depth"], 3.0, rtol=EPSILON)
    np.testing.assert_array_equal(shot["normal"], np.broadcast_to([0, 0, 1], (6, 8, 3)))
    assert shot["id_object"].dtype == np.uint32 and (shot["id_object"] == 1).all()
    assert shot["Depth"] is shot["depth"]
    assert shot.raw is None
    assert "metre" in str(shot.meaning("depth")) or "m" == shot.meaning("depth")["unit"]
    with pytest.raises(KeyError, match="depth, normal"):
        shot["dept"]


def test_a_change_is_seen_and_projects():
    scene = quad()
    scene["camera.pose.from"] = np.array([0.0, 0.0, 5.0])
    assert scene["camera.pose.from"] == [0, 0, 5]
    shot = scene.render()
    np.testing.assert_allclose(shot["depth"], 5.0, rtol=EPSILON)
    # The point in the middle of a pixel, projected with K and pose, is that pixel.
    rows, columns = np.mgrid[0:6, 0:8]
    rays = np.linalg.inv(shot.K) @ np.stack([columns.ravel(), rows.ravel(), np.ones(48)])
    world = shot.pose[:3, :3] @ (rays * shot["depth"].ravel()) + shot.pose[:3, 3:]
    # Roundings of f64.
    np.testing.assert_allclose(world[2], 0, atol=1e-14)
    with pytest.raises(KeyError):
        scene["camera.nothing"]


def test_what_is_refused_is_a_value_error_and_leaves_the_scene():
    scene = quad()
    with pytest.raises(ValueError, match="fow"):
        scene["camera.fow"] = 3
    with pytest.raises(ValueError, match="vertices has the shape"):
        etendue.Scene(np.zeros((3, 2)), FACES)
    with pytest.raises(ValueError, match="vertex 4 of 4"):
        etendue.Scene(QUAD, [[0, 1, 4]])
    with pytest.raises(ValueError, match="-1"):
        etendue.Scene(QUAD, [[0, 1, -1]])
    with pytest.raises(ValueError, match="dtype"):
        etendue.Scene(QUAD, [[0.0, 1.0, 2.0]])
    with pytest.raises(ValueError, match="come together"):
        etendue.Scene(QUAD)
    np.testing.assert_allclose(scene.render()["depth"], 3.0, rtol=EPSILON)


def test_arrays_of_any_layout_are_taken():
    wide = np.zeros((8, 6))
    wide[::2, ::2] = QUAD
    vertices = wide[::2, ::2]
    assert not vertices.flags.c_contiguous
    faces = np.asfortranarray(FACES.astype(np.int16))
    faces.setflags(write=False)
    scene = etendue.Scene(vertices, faces, layers=["depth"], camera=quad()["camera"])
    np.testing.assert_allclose(scene.render()["depth"], 3.0, rtol=EPSILON)


def test_the_command_renders_the_same(tmp_path):
    scene = {
        "etendue": 1,
        "tracer": {"type": "facing"},
        "layers": ["depth"],
        "objects": [{"shape": "sphere"}],
        "camera": {"type": "pinhole", "sensor": {"resolution": [16, 12], "type": "raw", "exposure": 0.01}},
    }
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    shot = etendue.load(tmp_path / "scene.json").render(samples=4)
    files = shot.write(tmp_path / "out")
    assert {pathlib.Path(file).name for file in files} >= {"layers.exr", "depth.npy", "raw.npy"}
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "depth.npy"), shot["depth"])
    np.testing.assert_array_equal(np.load(tmp_path / "out" / "raw.npy"), shot.raw)
    assert shot.raw.dtype == np.uint16
    assert shot._repr_png_().startswith(b"\x89PNG")
    assert shot.report["samples"] == 4


def test_frames():
    orbit = {"type": "orbit", "count": 4, "center": [0, 0, 0]}
    shots = list(quad(frames=orbit).frames())
    assert len(shots) == 4
    np.testing.assert_allclose(shots[2]["depth"], 3.0, rtol=1e-14)
    np.testing.assert_allclose(shots[2].pose[:3, 3], [0, 0, -3], atol=1e-14)


def test_frames_are_compared():
    # Two cameras side by side: focal length times baseline over depth.
    grid = {"type": "grid", "columns": 2, "spacing": 0.25}
    left, right = quad(frames=grid, layers=["depth", "disparity"]).frames()
    np.testing.assert_allclose(left["disparity"], left.K[0, 0] * 0.25 / left["depth"], rtol=1e-13)
    assert "disparity" not in right


def test_meshes_of_others_and_bytes(tmp_path):
    class Mesh:
        vertices, faces = QUAD, FACES

    shot = etendue.Scene(Mesh(), layers=["depth"], camera=quad()["camera"]).render()
    np.testing.assert_allclose(shot["depth"], 3.0, rtol=EPSILON)
    binary = QUAD.astype("<f4").tobytes() + FACES.astype("<u4").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(binary)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 6},
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunk = lambda kind, data: len(data).to_bytes(4, "little") + kind + data  # noqa: E731
    body = chunk(b"JSON", text) + chunk(b"BIN\0", binary)
    glb = b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body
    shot = etendue.load(glb, {"camera": quad()["camera"], "layers": ["depth"]}).render()
    np.testing.assert_allclose(shot["depth"], 3.0, rtol=EPSILON)
    with pytest.raises(ValueError, match="model.glb"):
        etendue.load(b"glTF").render()


def test_a_scene_is_one_threads_at_a_time():
    scene = etendue.Scene(
        objects=[{"shape": "sphere"}],
        tracer={"type": "path"},
        render={"samples": 1 << 20},
        camera={"type": "pinhole", "sensor": {"resolution": [64, 64]}},
    )
    seen = []

    def told(stage, share):
        # Another thread, while the first is at work.
        if not seen:
            seen.append(True)
            thread = threading.Thread(target=other)
            thread.start()
            thread.join()
        return False

    def other():
        try:
            scene.render()
        except RuntimeError as error:
            seen.append(str(error))
        raise_in_main.set()

    raise_in_main = threading.Event()
    threading.Thread(
        target=lambda: (raise_in_main.wait(60), os.kill(os.getpid(), signal.SIGINT)), daemon=True
    ).start()
    with pytest.raises(KeyboardInterrupt):
        scene.render(progress=told)
    assert len(seen) == 2 and "another thread" in seen[1]


def test_what_a_callback_raises_comes_out():
    class Mine(Exception):
        pass

    def told(stage, share):
        # Late, when what there is of the picture would do.
        if stage == "render" and share > 0:
            raise Mine("enough")

    scene = etendue.Scene(
        objects=[{"shape": "sphere"}],
        tracer={"type": "path"},
        render={"samples": 1 << 20},
        camera={"type": "pinhole", "sensor": {"resolution": [64, 64]}},
    )
    with pytest.raises(Mine, match="enough"):
        scene.render(progress=told)
    # The scene is none the worse.
    assert scene.render(samples=1).report["samples"] == 1


def test_files_that_fail_are_os_errors(tmp_path):
    def missing(**scene):
        return etendue.Scene(folder=tmp_path, layers=["depth"], **scene).render

    camera = quad()["camera"]
    paint = {"m": {"type": "matte", "color": {"image": "gone.png"}}}
    ball = [{"shape": "sphere", "material": "m"}]
    lens = {"type": "lens", "lens": "gone.json", "sensor": {"resolution": [8, 6]}}
    for call in [
        lambda: etendue.load(tmp_path / "gone.json"),
        lambda: etendue.load(tmp_path / "gone.glb").render(),
        lambda: etendue.Lens(tmp_path / "gone.zmx"),
        lambda: etendue.Sensor(tmp_path / "gone.json"),
        missing(camera=camera, objects=[{"file": "gone.obj"}]),
        missing(camera=lens, objects=[{"shape": "sphere"}]),
        missing(camera=camera, objects=ball, materials=paint, tracer={"type": "path"}),
        lambda: list(quad(frames={"type": "trajectory", "file": "gone.json"}).frames()),
    ]:
        with pytest.raises(FileNotFoundError, match="gone"):
            call()
    (tmp_path / "file").write_text("")
    shot = quad().render()
    for folder in ["file", "file/below"]:
        with pytest.raises(OSError, match="cannot write .*file"):
            shot.write(tmp_path / folder)


def test_messages_speak_python(tmp_path):
    scene = quad()
    messages = []
    for call in [
        lambda: scene.__setitem__("camera.fow", 3),
        lambda: scene.__setitem__("camera.sensor.resolution", [0, 1]),
        lambda: scene.__setitem__("frames[3", 3),
        lambda: etendue.load(CHECKOUT / "scenes" / "cube.json", {"camera.fow": 3}),
        lambda: quad(objects=[{"file": "/etc/passwd"}]).render(),
        lambda: quad(objects=[{"file": "../mesh.ply"}]).render(),
        lambda: quad(objects=[{"shape": "sphere", "sides": 4096}], memory_limit=1 << 20).render(),
        lambda: etendue.Sensor("imx183", {"temperatur": 3}),
    ]:
        with pytest.raises((ValueError, OSError)) as raised:
            call()
        messages.append(str(raised.value))
    assert "camera.fow=3" in messages[0]
    assert "allow_outside=True" in messages[4] and "allow_outside=True" in messages[5]
    assert not [message for message in messages if re.search(r"(^|[\s`(])--[a-z]", message)], messages


def test_ctrl_c_ends_a_trace():
    # Minutes of work: every ray has to look at every triangle.
    endless = """
import etendue, threading, os, signal, numpy as np
accel = etendue.Accel([[-9, -9, 0], [9, -9, 0], [0, 9, 0]], [[0, 1, 2]] * 20000, "exact")
rays = np.tile([0.0, 0, 1], (1000000, 1))
threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    accel.closest(rays, -rays)
except KeyboardInterrupt:
    print("interrupted")
"""
    done = subprocess.run([sys.executable, "-c", endless], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "interrupted", done.stderr


def test_progress_and_ctrl_c():
    stages = []
    quad().render(progress=lambda stage, share: stages.append((stage, share)))
    assert stages and all(0 <= share <= 1 for _, share in stages)
    endless = """
import etendue, threading, os, signal, time
scene = etendue.Scene(objects=[{"shape": "sphere"}], tracer={"type": "path"}, render={"samples": 1048576},
                      camera={"type": "pinhole", "sensor": {"resolution": [64, 64]}})
threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    scene.render()
except KeyboardInterrupt:
    print("interrupted")
"""
    done = subprocess.run([sys.executable, "-c", endless], capture_output=True, text=True, timeout=60)
    assert done.stdout.strip() == "interrupted", done.stderr


def test_a_light_field_is_arrays():
    camera = {
        "type": "light_field",
        "focal_length": 20,
        "f_number": 4,
        "focus_distance": 0.5,
        "microlenses": {"pitch": 0.1},
        "pose": {"from": [0, 0, 0.5], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [120, 90], "pixel_pitch": 8},
    }
    scene = quad(camera=camera, layers=["depth"], tracer={"type": "flat"})
    field = scene.render(samples=4).light_field()
    n, rows, cols = (field.geometry[key] for key in ["views", "rows", "cols"])
    assert field.raw.shape == field.white.shape == (90, 120, 3)
    assert field.views.shape == field.reference.shape == (n, n, rows, cols, 3)
    assert field.depth.shape == field.disparity.shape == (rows, cols)
    camera["microlenses"]["picture_distance"] = 0.5
    field = quad(camera=camera, layers=["depth"], tracer={"type": "flat"}).render(samples=1).light_field()
    assert field.views is None and "focused" in field.geometry["no_views"]
    assert field.refocused is None and "gaps" in field.geometry["no_patches"]
    camera["microlenses"]["picture_distance"] = 2
    field = quad(camera=camera, layers=["depth"], tracer={"type": "flat"}).render(samples=1).light_field()
    assert field.views is None and field.refocused.shape == (*field.geometry["patches"]["resolution"][::-1], 3)
    assert quad().render().light_field() is None


def test_a_lens_bends_rays_to_its_focus():
    lens = etendue.Lens(LENSES / "achromat.json")
    efl = lens.effective_focal_length
    heights = np.array([0.0, 0.01, -0.01])
    origins = np.stack([heights, np.zeros(3), np.full(3, -10.0)], axis=1)
    traced = lens.trace(origins, [[0, 0, 1]] * 3)
    assert (traced.status == 0).all() and (traced.element == -1).all()
    slopes = traced.directions[:, 0] / traced.directions[:, 2]
    # Close to the axis the slope is the height over the focal length; the rest is of the third order.
    np.testing.assert_allclose(slopes[1:], -heights[1:] / efl, rtol=1e-5)
    wide = lens.trace([[1000.0, 0, -10]], [[0, 0, 1]])
    assert wide.status[0] != 0 and wide.element[0] >= 0
    with pytest.raises(ValueError, match="no ray"):
        lens.trace([[np.nan, 0, 0]], [[0, 0, 1]])
    with pytest.raises(ValueError, match="2 origins for 1"):
        lens.trace(np.zeros((2, 3)), [[0, 0, 1]])


def test_a_sensor_counts_electrons():
    sensor = etendue.Sensor("imx183")
    facts = sensor.facts
    electrons = np.full((200, 300), 1000.0)
    raw = sensor.expose(electrons, seed=1)
    assert raw.shape == (200, 300) and raw.dtype == np.uint16
    mean = facts["black_level"] + 1000 * facts["system_gain"]
    # Noise of a thousand electrons over 60,000 pixels leaves 0.13 e-; the pattern of pixels a few more.
    assert abs(raw.mean() - mean) < 5 * facts["system_gain"]
    np.testing.assert_array_equal(raw, sensor.expose(electrons, seed=1))
    assert (raw != sensor.expose(electrons, seed=2)).any()
    with pytest.raises(ValueError, match="imx184"):
        etendue.Sensor("imx184")
    with pytest.raises(ValueError, match="shape"):
        sensor.expose([1, 2, 3])


@pytest.mark.parametrize("backend", ["embree", "bvh", "exact"])
def test_rays_hit_where_they_should(backend):
    accel = etendue.Accel(QUAD, FACES, backend)
    random = np.random.default_rng(1)
    origins = np.concatenate([random.uniform(-8, 8, (5000, 2)), np.full((5000, 1), 2.0)], axis=1)
    directions = np.tile([0.0, 0, -4], (5000, 1))
    hits = accel.closest(origins, directions)
    # In lengths of the direction.
    np.testing.assert_array_equal(hits.t, 0.5)
    assert set(hits.triangle) == {0, 1}
    np.testing.assert_array_equal(hits.normal, np.tile([0.0, 0, 1], (5000, 1)))
    corners = QUAD[FACES[hits.triangle]]
    u, v = hits.u[:, None], hits.v[:, None]
    points = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    np.testing.assert_allclose(points[:, :2], origins[:, :2], atol=1e-14)
    away = accel.closest(origins[:2], [[0, 0, 1], [np.nan, 0, 1]])
    assert (away.triangle == -1).all() and np.isinf(away.t).all()
    assert accel.occluded(origins, directions).all()
    assert not accel.occluded(origins, directions, t_max=0.49).any()
    with pytest.raises(ValueError, match="origins"):
        accel.closest(origins, directions[:3])


def test_an_unknown_accelerator_is_named():
    with pytest.raises(ValueError, match="embree, bvh, exact"):
        etendue.Accel(QUAD, FACES, "optix")


def test_the_lines_of_the_documentation_run(tmp_path, monkeypatch):
    monkeypatch.chdir(CHECKOUT)
    for page, least in [("docs/guide/python.md", 4), ("README.md", 1)]:
        blocks = re.findall(r"```python\n(.*?)```", (CHECKOUT / page).read_text(), re.S)
        assert len(blocks) >= least
        names = {"out": str(tmp_path)}
        for block in blocks:
            exec(compile(block, page, "exec"), names)  # one after the other, as a reader does


def test_the_data_set_of_the_documentation_goes_through_pytorch(monkeypatch):
    """By hand, where PyTorch installs: it is as large as all else that is tested with."""
    data = pytest.importorskip("torch.utils.data")
    monkeypatch.chdir(CHECKOUT)
    blocks = re.findall(r"```python\n(.*?)```", (CHECKOUT / "docs/guide/python.md").read_text(), re.S)
    names = {}
    exec(next(block for block in blocks if "class Depths" in block), names)
    found = names["data"]
    assert isinstance(found, data.Dataset)
    batches = list(data.DataLoader(found, batch_size=4, num_workers=16))
    assert [tuple(picture.shape) for picture, _ in batches] == [(4, 3, 48, 64)] * 3
    for index, (picture, depth) in enumerate(pair for batch in batches for pair in zip(*batch)):
        alone = found[index]
        assert np.array_equal(picture.numpy(), alone[0]) and np.array_equal(depth.numpy(), alone[1])
