"""Characterises the series named on the command line and prints the results as JSON."""

import json
import logging
import sys

from emva1288.process.data import Data1288
from emva1288.process.loader import LoadImageData
from emva1288.process.parser import ParseEmvaDescriptorFile
from emva1288.process.results import Results1288


def characterised(descriptor):
    quiet = logging.ERROR
    parsed = ParseEmvaDescriptorFile(descriptor, loglevel=quiet)
    loaded = LoadImageData(parsed.images, loglevel=quiet)
    data = Data1288(loaded.data, loglevel=quiet)
    results = Results1288(data.data, loglevel=quiet)
    return {
        "system_gain": results.K,
        "quantum_efficiency": results.QE / 100,
        "dark_noise": results.sigma_d,
        "dark_current_by_mean": results.u_I_mean,
        "dark_current_by_variance": results.u_I_var,
        "dsnu": results.DSNU1288,
        "prnu": results.PRNU1288 / 100,
        "linearity_error": [results.LE_min, results.LE_max],
        "saturation": results.u_e_sat,
    }


def plain(value):
    value = value() if callable(value) else value
    return [float(v) for v in value] if isinstance(value, list) else float(value)


if __name__ == "__main__":
    results = characterised(sys.argv[1])
    print(json.dumps({key: plain(value) for key, value in results.items()}))
