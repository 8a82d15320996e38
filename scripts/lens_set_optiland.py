"""The lenses that optiland 0.6.3 (from PyPI) brings, as files of four formats.

    out/optiland/bin/python scripts/lens_set_optiland.py FOLDER

writes each as optiland's JSON and, where it can, by its exporters as Zemax', CODE V's and OSLO's. `scripts/lens-sets.sh`
counts which of them are read."""

import importlib
import inspect
import pkgutil
import sys
import warnings
from pathlib import Path

import optiland.samples
from optiland.fileio import save_codev_file, save_optiland_file, save_oslo_file, save_zemax_file
from optiland.optic import Optic

warnings.simplefilter("ignore")
folder = Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
written = {"json": 0, "zmx": 0, "seq": 0, "len": 0}
for module in pkgutil.walk_packages(optiland.samples.__path__, "optiland.samples."):
    for name, kind in vars(importlib.import_module(module.name)).items():
        if not (inspect.isclass(kind) and issubclass(kind, Optic) and kind is not Optic):
            continue
        for ending, save in [("json", save_optiland_file), ("zmx", save_zemax_file), ("seq", save_codev_file),
                             ("len", save_oslo_file)]:
            try:
                save(kind(), str(folder / f"{name}.{ending}"))
                written[ending] += 1
            except Exception as error:  # What optiland does not write is no file.
                print(f"{name}.{ending}: {error}", file=sys.stderr)
print(written)
