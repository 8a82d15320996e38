"""Reads the spectral files of a render with others' readers, and writes files with others' writers.

    spectral_readers.py FOLDER

FOLDER has layers.exr, spectrum.hdr, spectrum.img, spectrum.npy and picture.npy; theirs.exr and theirs-bsq.hdr,
theirs-bil.hdr, theirs-bip.hdr with their numbers are made of spectrum.npy.
"""

import os
import sys
import warnings

warnings.simplefilter("ignore")

import colour
import numpy as np
import OpenEXR
import OpenImageIO
import spectral

os.chdir(sys.argv[1])
cube = np.load("spectrum.npy")
picture = np.load("picture.npy")
rows, columns, bands = cube.shape

# colour-science: the layout's own reader.
components, specification = colour.read_spectral_image_Fichet2021("layers.exr", additional_data=True)
assert list(components) == ["S0"] and specification.is_emissive, components.keys()
assert not specification.is_polarised and not specification.is_bispectral
wavelengths, values = components["S0"]
order = np.argsort(wavelengths)
assert np.array_equal(values[:, :, order], cube), "the bands are others"
attributes = {attribute.name: attribute.value for attribute in specification.attributes}
assert attributes["spectralLayoutVersion"] == "1.0", attributes
assert attributes["emissiveUnits"] == sys.argv[2], attributes["emissiveUnits"]

# OpenImageIO and OpenEXR still open the picture and its other layers.
image = OpenImageIO.ImageBuf("layers.exr")
names = image.spec().channelnames
assert names[:3] == ("R", "G", "B"), names
rgb = image.get_pixels(OpenImageIO.FLOAT)[:, :, [names.index(name) for name in "RGB"]]
assert np.array_equal(rgb, picture), "the picture is another"
with OpenEXR.File("layers.exr", separate_channels=True) as file:
    channels = file.channels()
    assert np.array_equal(channels["R"].pixels, picture[:, :, 0])
    spectral_names = [name for name in channels if name.startswith("S0.")]
    assert len(spectral_names) == bands and all("," in name for name in spectral_names), spectral_names

# spectral (SPy): the ENVI cube.
envi = spectral.envi.open("spectrum.hdr")
assert np.array_equal(np.asarray(envi.load()), cube), "the ENVI cube is another"
assert np.allclose(envi.bands.centers, wavelengths[order], atol=1e-3), envi.bands.centers
assert envi.bands.band_unit.lower() == "nanometers", envi.bands.band_unit
assert envi.metadata["data units"] == sys.argv[2], envi.metadata
widths = np.array(envi.bands.bandwidths)
assert widths.shape == (bands,) and (widths > 0).all()

# What they write, for the command to read.
emissive = colour.io.fichet2021.Specification_Fichet2021(is_emissive=True)
black = lambda components, specification: (np.zeros((rows, columns, 3), np.float32), [])
colour.write_spectral_image_Fichet2021(
    {"S0": (wavelengths[order], cube)}, "theirs.exr", specification=emissive, components_to_RGB_callable=black
)
for interleave in ["bsq", "bil", "bip"]:
    metadata = {
        "wavelength": [nm / 1000 for nm in envi.bands.centers],
        "wavelength units": "Micrometers",
        "fwhm": list(widths / 1000),
        "data units": sys.argv[2],
    }
    spectral.envi.save_image(
        f"theirs-{interleave}.hdr", cube, interleave=interleave, metadata=metadata, force=True,
        byteorder=1 if interleave == "bil" else 0, dtype=np.float32,
    )
print("read and written")
