"""What moves while the shutter is open, as users of the package have it."""

import json

import numpy as np

import etendue

SQUARE = np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])
ROWS = 8


def wall(**more):
    """A wall 3 m before a camera whose rows are read 0.1 s apart."""
    camera = {
        "type": "pinhole",
        "fov": 40,
        "pose": {"from": [0, 0, 3], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [4, ROWS]},
        "shutter": {"type": "rolling", "line_time": 0.1, "exposure": 0.02},
    }
    return etendue.Scene(SQUARE, FACES, **{"camera": camera, "layers": ["depth", "time"], **more})


def test_rows_see_an_array_of_triangles_where_it_is_at_their_times():
    scene = wall()
    scene["objects[0].motion"] = {"type": "velocity", "velocity": [0, 0, 1.5]}
    shot = scene.render()
    due = 0.01 + 0.1 * np.arange(ROWS)
    np.testing.assert_allclose(shot["time"], np.repeat(due[:, None], 4, axis=1), rtol=1e-12)
    # To 1e-9 of the scene, whose wall is 18 m wide.
    np.testing.assert_allclose(shot["depth"], 3 - 1.5 * shot["time"], atol=2e-8)
    # A change of the speed is seen, and one of the camera's, which goes the other way.
    scene["objects[0].motion.velocity"] = [0, 0, 0.5]
    scene["camera.motion"] = {"type": "velocity", "velocity": [0, 0, 1]}
    shot = scene.render()
    np.testing.assert_allclose(shot["depth"], 3 + 0.5 * shot["time"], atol=2e-8)


def test_a_light_that_moves_sends_the_mean_of_its_closed_form():
    lamp = {"type": "point", "at": [-0.5, 0.3, 1.2], "intensity": [3, 3, 3]}
    camera = {
        "type": "orthographic",
        "height": 0.001,
        "pose": {"from": [0, -3, 4], "look_at": [0, 0, 0]},
        "sensor": {"resolution": [16, 16]},
        "shutter": {"exposure": 1},
    }
    scene = wall(
        camera=camera,
        layers=[],
        tracer={"type": "direct"},
        lights=[lamp],
        materials={"floor": {"type": "matte", "color": [0.5, 0.5, 0.5]}},
    )
    scene["objects[0].material"] = "floor"

    def sent(x):
        squared = 1.2**2 + 0.3**2
        return 1.2 * x / squared / np.sqrt(squared + x * x)

    scene["lights[0].motion"] = {"type": "velocity", "velocity": [2, 0, 0]}
    due = 0.5 / np.pi * 3 * (sent(1.5) - sent(-0.5)) / 2
    found = scene.render(samples=256)["picture"].mean()
    # 65 536 random times were 0.3 / 256 off.
    assert abs(found / due - 1) < 1.2e-3, (found, due)


def test_a_session_that_goes_on_renders_what_moves_as_a_new_one(tmp_path):
    scene = {
        "etendue": 1,
        "camera": {
            "type": "pinhole",
            "pose": {"from": [0, 0.5, 4], "look_at": [0, 0, 0]},
            "motion": {"type": "velocity", "velocity": [0.4, 0, 0]},
            "sensor": {"resolution": [12, 9]},
            "shutter": {"type": "rolling", "line_time": 0.01, "exposure": 0.05},
        },
        "layers": ["depth"],
        "tracer": {"type": "path"},
        "lights": [
            {
                "type": "point",
                "at": [2, 3, 2],
                "intensity": [9, 9, 9],
                "motion": {"type": "velocity", "velocity": [0, 0, 3]},
            }
        ],
        "objects": [
            {
                "shape": "box",
                "motion": {"type": "velocity", "angular_velocity": [0, 500, 0]},
            }
        ],
    }
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    (tmp_path / "other.json").write_text(json.dumps({**scene, "objects": [{"shape": "box"}], "lights": []}))
    shot = etendue.load(tmp_path / "scene.json").render(samples=4)
    again = etendue.load(tmp_path / "other.json")
    again.render(samples=1)
    for key in ["objects", "lights"]:
        again[key] = scene[key]
    again = again.render(samples=4)
    for name in ["depth", "picture"]:
        np.testing.assert_array_equal(shot[name], again[name])
