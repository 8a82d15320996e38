"""Pictures of light from elsewhere: read as others read them, and exposed as the command and the render do."""

import json
import warnings

import numpy as np
import pytest

import etendue

BANDS = [400, 450, 505, 600, 700, 1500]
SENSOR = {
    "type": "multispectral",
    "bands": BANDS,
    "resolution": [12, 9],
    "radiometry": "physical",
    "pixel_pitch": 4,
    "system_gain": 0.5,
    "exposures": [1e-5, 2e-5],
    "frames": 2,
}


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    scene = etendue.Scene(
        camera={
            "type": "orthographic",
            "height": 2.5,
            "pose": {"from": [0, 0, 2], "look_at": [0, 0, 0]},
            "sensor": SENSOR,
        },
        tracer={"type": "facing"},
        objects=[{"shape": "sphere", "material": "paint"}],
        materials={"paint": {"type": "matte", "color": [2e-4, 1e-4, 3e-4]}},
    )
    folder = tmp_path_factory.mktemp("shot")
    shot = scene.render(samples=1)
    shot.write(folder, "exr,npy,envi")
    return shot, folder


@pytest.mark.parametrize("name", ["layers.exr", "spectrum.npy", "spectrum.hdr", "spectrum.img"])
def test_a_render_is_read_and_exposed_to_the_bit(shot, name, tmp_path):
    shot, folder = shot
    light = etendue.Light.read(folder / name)
    assert light.values.dtype == np.float32
    assert np.array_equal(light.values, shot["spectrum"])
    assert light.edges.tolist() == BANDS and light.unit == "W.m^-2.nm^-1"
    assert light.wavelengths[1] == 477.5
    (tmp_path / "sensor.json").write_text(json.dumps(SENSOR))
    exposed = light.expose(tmp_path / "sensor.json")
    assert exposed.exposures == shot.exposures
    for index in range(4):
        assert np.array_equal(exposed.raw_of(index), shot.raw_of(index)), index
    files = exposed.write(tmp_path / "out")
    assert np.array_equal(np.load(tmp_path / "out" / "raw_003.npy"), shot.raw_of(3)) and len(files) > 4


def test_others_read_the_same(shot):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import colour
    import spectral

    shot, folder = shot
    wavelengths, values = colour.read_spectral_image_Fichet2021(folder / "layers.exr")["S0"]
    order = np.argsort(wavelengths)
    light = etendue.Light.read(folder / "layers.exr")
    assert np.array_equal(values[:, :, order], light.values)
    assert np.allclose(wavelengths[order], light.wavelengths, atol=1e-3)
    cube = spectral.envi.open(str(folder / "spectrum.hdr"))
    assert np.array_equal(np.asarray(cube.load()), light.values)
    assert np.allclose(cube.bands.centers, light.wavelengths)


def test_arrays_are_counted_by_area_time_and_energy():
    sensor = etendue.Sensor(
        "imx183",
        {"quantum_efficiency": 0.5, "system_gain": 0.05, "noise": "none", "black_level": 0, "exposure": 0.01},
    )
    cube = np.full((2, 3, 1), 2e-4) * [[[1.0, 2.0]]]
    light = etendue.Light(cube, wavelengths=[500, 600], unit="W/m2/nm")
    energy = 6.62607015e-34 * 299792458.0
    per_band = [0.5 * (b * b - a * a) * 1e-9 for a, b in [(450, 550), (550, 650)]]
    expected = 2e-4 * 2.4e-6**2 * 0.01 * 0.5 / energy * (per_band[0] + 2 * per_band[1])
    # Half a DN of 20 electrons.
    assert np.abs(light.expose(sensor).raw * 20.0 - expected).max() <= 10.1
    radiance = light.expose(sensor, unit="W/m2/sr/nm", f_number=4)
    assert np.abs(radiance.raw * 20.0 - expected * np.pi / 65).max() <= 10.1
    assert "beyond" in " ".join(radiance.notes)


def test_what_makes_no_sense_raises_with_the_remedy(tmp_path):
    grey = etendue.Light(np.ones((2, 2)))
    with pytest.raises(ValueError, match="does not say in which unit .*\nhint: give unit, 1"):
        grey.expose("imx183")
    with pytest.raises(ValueError, match="f_number N"):
        grey.expose("imx183", unit="W/m2/sr/nm")
    with pytest.raises(ValueError, match="is no unit of light"):
        grey.expose("imx183", unit="lux")
    with pytest.raises(ValueError, match="2 values a pixel"):
        etendue.Light(np.ones((2, 2, 2)))
    with pytest.raises(ValueError, match="did you mean micrometres"):
        etendue.Light(np.ones((2, 2, 2)), wavelengths=[0.5, 0.6])
    with pytest.raises(FileNotFoundError):
        etendue.Light.read(tmp_path / "nothing.exr")
