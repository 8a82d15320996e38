#!/usr/bin/env python3
"""How many lens files of other programs are read:

    lens_sets.py count ETENDUE FOLDER...    those in the folders, and why others are not, with their numbers
    lens_sets.py write FOLDER               the lenses that optiland 0.6.3 (from PyPI) brings, as files of four formats

The second wants optiland (`out/optiland/bin/python`, as scripts/lens_opinions.py has it made), and writes each as optiland's JSON
and, where it can, by its exporters as Zemax', CODE V's and OSLO's.
"""

import collections
import importlib
import inspect
import pkgutil
import re
import subprocess
import sys
import warnings
from pathlib import Path

ENDINGS = {".zmx", ".seq", ".len", ".dat", ".txt", ".json"}


def count(etendue, *folders):
    """Prints how many are read, and the reasons of others by how often they are given."""
    outcomes = collections.Counter()
    for file in sorted(path for folder in folders for path in Path(folder).rglob("*")):
        if not file.is_file() or file.suffix.lower() not in ENDINGS:
            continue
        done = subprocess.run([etendue, "lens", file, "--json"], capture_output=True, text=True)
        # Without the file, its place and numbers, so that the same reasons are one.
        why = done.stderr.partition("\n")[0].rpartition(file.name)[2]
        why = re.sub(r"\[[0-9]*\]", "[]", re.sub("line [0-9]*: ", "", why.lstrip(":, ")))
        outcomes[file.suffix.lower()[1:], "read" if done.returncode == 0 else f"refused: {why[:100]}"] += 1
    for (ending, outcome), number in sorted(outcomes.items(), key=lambda row: (row[0][0], -row[1], row[0][1])):
        print(f"{number:7} {ending}\t{outcome}")


def write(folder):
    """Writes the lenses that optiland brings."""
    import optiland.samples
    from optiland.fileio import save_codev_file, save_optiland_file, save_oslo_file, save_zemax_file
    from optiland.optic import Optic

    warnings.simplefilter("ignore")
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    written = {"json": 0, "zmx": 0, "seq": 0, "len": 0}
    savers = {"json": save_optiland_file, "zmx": save_zemax_file, "seq": save_codev_file, "len": save_oslo_file}
    for module in pkgutil.walk_packages(optiland.samples.__path__, "optiland.samples."):
        for name, kind in vars(importlib.import_module(module.name)).items():
            if not (inspect.isclass(kind) and issubclass(kind, Optic) and kind is not Optic):
                continue
            for ending, save in savers.items():
                try:
                    save(kind(), str(folder / f"{name}.{ending}"))
                    written[ending] += 1
                except Exception as error:  # What optiland does not write is no file.
                    print(f"{name}.{ending}: {error}", file=sys.stderr)
    print(written)


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("count", "write"):
        sys.exit(__doc__)
    {"count": count, "write": write}[sys.argv[1]](*sys.argv[2:])
