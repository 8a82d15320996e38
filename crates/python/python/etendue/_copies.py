"""What pickled objects are made of in the process that takes them."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from typing import Any, Dict, List, Optional, Tuple

import numpy as np


class TemporaryFolder:
    """A temporary folder that goes with its owner, in the process that made it: a forked child leaves it."""

    def __init__(self) -> None:
        self.name = tempfile.mkdtemp(prefix="etendue-")
        weakref.finalize(self, _remove, self.name, os.getpid())


def _remove(folder: str, process: int) -> None:
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)


class StoredRendering:
    """A rendering as arrays: what the core's has, without the scene that it writes files from."""

    _layers: Dict[str, np.ndarray]
    _meanings: Dict[str, List[Tuple[str, str]]]
    _exposures: List[Tuple[float, int]]
    _raw: List[np.ndarray]
    _report: str
    _camera: str
    _counts: Dict[str, int]

    @classmethod
    def of(cls, core: Any) -> "StoredRendering":
        if isinstance(core, cls):
            return core
        stored = cls()
        stored._layers = {name: core.layer(name) for name in core.layers()}
        stored._meanings = {name: core.meaning(name) for name in core.layers()}
        stored._exposures = core.exposures()
        stored._raw = [core.raw(index) for index in range(len(stored._exposures))]
        stored._report, stored._camera, stored._counts = core.report(), core.camera(), core.counts()
        return stored

    def layers(self) -> List[str]:
        return list(self._layers)

    def layer(self, name: str) -> Optional[np.ndarray]:
        return self._layers.get(name)

    def meaning(self, name: str) -> List[Tuple[str, str]]:
        return self._meanings.get(name, [])

    def exposures(self) -> List[Tuple[float, int]]:
        return self._exposures

    def raw(self, index: int) -> Optional[np.ndarray]:
        return self._raw[index] if index < len(self._raw) else None

    def report(self) -> str:
        return self._report

    def camera(self) -> str:
        return self._camera

    def counts(self) -> Dict[str, int]:
        return self._counts

    def write(self, folder: str, outputs: str) -> List[str]:
        raise ValueError("a shot that was pickled is arrays alone; write it in the process that rendered it")
