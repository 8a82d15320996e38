"""Reads what the test wrote with OpenEXR, OpenImageIO, numpy and xxhash, and compares it with the raw values.

Called with a folder that holds `expected.json`, the files it names, and `NAME.raw` of each channel.
"""

import json
import pathlib
import sys

import numpy
import OpenEXR
import OpenImageIO
import xxhash

folder = pathlib.Path(sys.argv[1])
expected = json.loads((folder / "expected.json").read_text(encoding="utf-8"))
shape = (expected["height"], expected["width"])


def raw(name):
    """The values of a channel as the test had them in memory."""
    channel = expected["channels"][name]
    return numpy.fromfile(folder / f"{name}.raw", dtype="<" + channel["type"]).reshape(shape)


def same(what, found, wanted):
    """Equal in type, shape and every bit."""
    assert found.dtype == wanted.dtype, f"{what}: {found.dtype} instead of {wanted.dtype}"
    assert found.shape == wanted.shape, f"{what}: {found.shape} instead of {wanted.shape}"
    assert found.tobytes() == wanted.tobytes(), f"{what}: other values"


for name in expected["exr"]:
    with OpenEXR.File(str(folder / name), separate_channels=True) as file:
        assert len(file.parts) == 1, f"{name}: {len(file.parts)} parts"
        channels = file.channels()
        wanted = set(expected["channels"])
        assert set(channels) == wanted, f"{name}: {sorted(channels)} instead of {sorted(wanted)}"
        for channel, found in channels.items():
            stored = numpy.dtype(expected["channels"][channel]["stored"])
            same(f"{name}: {channel}", found.pixels, raw(channel).astype(stored))
        header = file.header()
        for key, text in expected["attributes"].items():
            assert header[key] == text, f"{name}: {key} is {header[key]!r} instead of {text!r}"
            if text.startswith("{"):
                json.loads(text)

    # As OpenImageIO reads by default: all channels of the file as floats.
    image = OpenImageIO.ImageBuf(str(folder / name))
    names = list(image.spec().channelnames)
    assert sorted(names) == sorted(wanted), f"{name}: OpenImageIO names {names}"
    pixels = image.get_pixels(OpenImageIO.FLOAT)
    for channel, told in expected["channels"].items():
        if told["stored"] == "float32":
            found = numpy.ascontiguousarray(pixels[:, :, names.index(channel)])
            same(f"{name} by OpenImageIO: {channel}", found, raw(channel).astype("<f4"))

depth = raw("Depth.Z")
assert numpy.isposinf(depth).any(), "the test has no miss"

for name, channels in expected["npy"].items():
    planes = [raw(channel) for channel in channels]
    wanted = planes[0] if len(planes) == 1 else numpy.stack(planes, axis=-1)
    same(name, numpy.load(folder / name), wanted)

state = xxhash.xxh3_128()
state.update(b"etendue image 1\0")
state.update(numpy.array(shape[::-1], dtype="<u8").tobytes())
for name in sorted(expected["channels"], key=lambda name: name.encode()):
    state.update(name.encode() + b"\0" + expected["channels"][name]["type"].encode() + b"\0")
    state.update(raw(name).tobytes())
assert state.hexdigest() == expected["hash"], f"hash {state.hexdigest()}"

print("read back:", len(expected["exr"]), "EXR,", len(expected["npy"]), "NPY, hash", expected["hash"])
