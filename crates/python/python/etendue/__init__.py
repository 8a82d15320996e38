"""A simulator of computational cameras.

    import etendue
    scene = etendue.load("scene.json")
    scene["camera.f_number"] = 2.8
    shot = scene.render(samples=64)
    shot["depth"], shot.raw, shot.K, shot.pose

Lengths are metres in scenes and millimetres in lenses; poses are OpenCV's (x right, y down, z forward).
What is refused raises ValueError with a sentence that names the place and the remedy, a file that is not there
FileNotFoundError, one that cannot be read or written OSError; Ctrl-C stops all work.

Scenes, lenses, sensors, accelerators and shots may be pickled, and work in forked processes as in spawned ones.
`threads` is how many threads work, None for all processors; give workers of a data loader one each.
"""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from typing import Any, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from . import _core
from ._copies import StoredRendering, TemporaryFolder

__version__ = _core.version()

has_embree: bool = _core.has_embree()
"""Whether Embree is built in. Without it the same numbers come from the tree in pure Rust, more slowly."""

if not has_embree:
    warnings.warn(
        "this wheel of etendue is for older systems: it has the renderer in pure Rust alone, which gives the same numbers "
        "as Embree more slowly",
        RuntimeWarning,
        stacklevel=2,
    )

__all__ = [
    "load",
    "Scene",
    "Frames",
    "Shot",
    "LightField",
    "Lens",
    "Traced",
    "Sensor",
    "Light",
    "Exposed",
    "Accel",
    "Hits",
]

_Path = Union[str, "os.PathLike[str]"]


def _rows(name: str, values: Any, dtype: Any) -> np.ndarray:
    """An array of shape (n, 3), as the core takes it."""
    try:
        array = np.asarray(values)
        if dtype is np.uint32 and array.size:
            if not np.issubdtype(array.dtype, np.integer):
                raise ValueError(f"{name} has the dtype {array.dtype}; whole numbers are needed")
            if array.min() < 0 or array.max() >= 2**32:
                raise ValueError(f"{name} has {array.min()} to {array.max()}; 0 to 4294967295 are needed")
        array = np.ascontiguousarray(array, dtype=dtype)
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from None
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"{name} has the shape {array.shape} instead of (n, 3)")
    return array


def _at_vertices(name: str, values: Any, columns: int) -> Optional[np.ndarray]:
    """An array of shape (n, columns) of what is known at the vertices of a mesh."""
    if values is None:
        return None
    try:
        array = np.ascontiguousarray(values, dtype=np.float32)
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from None
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{name} has the shape {array.shape} instead of (n, {columns})")
    return array


def _threads(threads: Optional[int]) -> int:
    """Threads as the core counts them."""
    if threads is None:
        return 0
    if isinstance(threads, bool) or int(threads) != threads or not 1 <= threads <= 4096:
        raise ValueError(f"threads is {threads!r}; 1 to 4096 are needed, or None for all processors")
    return int(threads)


def load(
    path: Union[_Path, bytes],
    settings: Optional[Mapping[str, Any]] = None,
    *,
    strict: bool = False,
    allow_outside: bool = False,
    memory_limit: Optional[int] = None,
    threads: Optional[int] = None,
) -> "Scene":
    """Opens a scene (.json), or a model to frame by itself (.gltf, .glb, .obj, .ply); bytes are those of a GLB.

    settings: values by path of the scene, such as {"camera.fov": 30}.
    strict: refuse defects of the data instead of noting them.
    allow_outside: let the scene name files outside of its folder.
    memory_limit: the most memory that may be taken, in bytes.
    threads: how many threads work; None for all processors.
    """
    pairs = [(key, json.dumps(value)) for key, value in (settings or {}).items()]
    folder = None
    if isinstance(path, (bytes, bytearray, memoryview)):
        # Kept as long as the scene, which uses the file where it lies.
        folder = TemporaryFolder()
        model = os.path.join(folder.name, "model.glb")
        with open(model, "wb") as file:
            file.write(path)
        path = model
    options = (strict, allow_outside, memory_limit)
    core = _core.Session.open(os.fspath(path), pairs, *options)
    return Scene._of(core, options, threads, folder)


class Scene:
    """A scene that is opened once, changed and rendered often.

    Models, images and the acceleration structure are made when they are first needed and kept; after a
    change only what it touches is made anew. A copy, or what is unpickled, is a scene of its own with the same
    values and meshes, from which the same picture is rendered.
    """

    threads: Optional[int]
    """How many threads work; None for all processors."""
    _core: Any
    _options: Tuple[bool, bool, Optional[int]]
    _folder: Any = None

    def __init__(
        self,
        vertices: Any = None,
        faces: Any = None,
        *,
        uvs: Any = None,
        normals: Any = None,
        colors: Any = None,
        folder: _Path = ".",
        strict: bool = False,
        allow_outside: bool = False,
        memory_limit: Optional[int] = None,
        threads: Optional[int] = None,
        **scene: Any,
    ) -> None:
        """A scene of arrays and of the keys of a scene file (camera, objects, lights, tracer, layers, …).

        vertices: (n, 3) float, metres. faces: (m, 3) int, counter-clockwise from the front. They become the
        mesh "mesh", and an object of it when `objects` says nothing. A mesh of trimesh, or anything else with
        `vertices` and `faces`, may stand for both. uvs, normals, colors: as of `insert_mesh`.
        folder: where files that the scene names lie.
        """
        if faces is None and hasattr(vertices, "vertices") and hasattr(vertices, "faces"):
            vertices, faces = vertices.vertices, vertices.faces
        if (vertices is None) != (faces is None):
            raise ValueError("vertices and faces come together")
        if vertices is not None:
            scene.setdefault("objects", [{"file": "mesh"}])
        _threads(threads)
        self.threads, self._options = threads, (strict, allow_outside, memory_limit)
        self._core = _core.Session.from_json(json.dumps(scene), os.fspath(folder), *self._options)
        if vertices is not None:
            self.insert_mesh("mesh", vertices, faces, uvs=uvs, normals=normals, colors=colors)
        elif not (uvs is None and normals is None and colors is None):
            raise ValueError("uvs, normals and colors belong to vertices, which are not given")

    @classmethod
    def _of(cls, core: Any, options: Any, threads: Optional[int], folder: Any) -> "Scene":
        _threads(threads)
        scene = cls.__new__(cls)
        scene._core, scene._options, scene.threads, scene._folder = core, options, threads, folder
        return scene

    def __reduce__(self) -> Any:
        path, values, inputs = self._do("origin")
        model = None
        if self._folder is not None:
            with open(path, "rb") as file:
                model = file.read()
        # Some are named by no value any more, as the camera's file; all stay guarded.
        origin = (os.path.abspath(path), values, [os.path.abspath(one) for one in inputs], model)
        return type(self)._restored, (origin, self._options, self.threads, self._do("meshes"))

    @classmethod
    def _restored(cls, origin: Any, options: Any, threads: Optional[int], meshes: Any) -> "Scene":
        path, values, inputs, model = origin
        folder = None
        if model is not None:
            folder = TemporaryFolder()
            path = os.path.join(folder.name, os.path.basename(path))
            with open(path, "wb") as file:
                file.write(model)
        scene = cls._of(_core.Session.restore(path, values, inputs, *options), options, threads, folder)
        for name, vertices, faces, at_vertices in meshes:
            scene._do("insert_mesh", name, vertices, faces, at_vertices)
        return scene

    def insert_mesh(
        self,
        name: str,
        vertices: Any,
        faces: Any,
        *,
        uvs: Any = None,
        normals: Any = None,
        colors: Any = None,
    ) -> None:
        """Adds a mesh, or replaces it: objects whose `file` is `name` are made of it.

        vertices: (n, 3) float, metres. faces: (m, 3) int, counter-clockwise from the front. uvs: (n, 2), texture
        coordinates, v down; images that the object's material names are laid by them. normals: (n, 3), shading
        normals. colors: (n, 3) or (n, 4), linear, 0 to 1: of objects without a `material`, whose light grey of 0.8 they
        multiply.
        """
        if colors is not None:
            colors = np.asarray(colors, dtype=np.float32)
            if colors.ndim == 2 and colors.shape[1] == 3:
                colors = np.concatenate([colors, np.ones((len(colors), 1), np.float32)], axis=1)
        at_vertices = (
            _at_vertices("uvs", uvs, 2),
            _at_vertices("normals", normals, 3),
            _at_vertices("colors", colors, 4),
        )
        vertices, faces = _rows("vertices", vertices, np.float64), _rows("faces", faces, np.uint32)
        self._do("insert_mesh", name, vertices, faces, at_vertices)

    def _do(self, what: str, *arguments: Any) -> Any:
        """Calls the core, which is one thread's at a time."""
        try:
            return getattr(self._core, what)(*arguments)
        except RuntimeError as error:
            if "borrowed" not in str(error):
                raise
        raise RuntimeError(
            "the scene is at work in another thread; wait for it, or give each thread a scene of its own"
        )

    def __setitem__(self, path: str, value: Any) -> None:
        """Sets a value of the scene, at any path: scene["camera.f_number"] = 2.8."""
        if isinstance(value, np.generic) or isinstance(value, np.ndarray):
            value = value.tolist()
        self._do("set", path, json.dumps(value))

    def __getitem__(self, path: str) -> Any:
        """The value at a path of the scene; KeyError where it says nothing."""
        value = self.values
        for step in path.replace("[", ".").replace("]", "").split("."):
            try:
                value = value[int(step)] if isinstance(value, list) else value[step]
            except (KeyError, IndexError, ValueError, TypeError):
                raise KeyError(path) from None
        return value

    def __delitem__(self, path: str) -> None:
        """Removes a value of the scene: del scene["camera.f_number"]; KeyError where it says nothing."""
        values = self.values
        *steps, last = path.replace("[", ".").replace("]", "").split(".")
        parent: Any = values
        try:
            for step in steps:
                parent = parent[int(step)] if isinstance(parent, list) else parent[step]
            del parent[int(last) if isinstance(parent, list) else last]
        except (KeyError, IndexError, ValueError, TypeError):
            raise KeyError(path) from None
        self._do("replace", json.dumps(values))

    def __contains__(self, path: object) -> bool:
        """Whether the scene says something at a path."""
        try:
            self[str(path)]
        except KeyError:
            return False
        return True

    def __repr__(self) -> str:
        values = self.values
        camera = values.get("camera")
        kind = camera.get("type") if isinstance(camera, dict) else camera
        objects = len(values.get("objects", []))
        name = os.path.basename(self._do("origin")[0])
        return f"<etendue.Scene {name}: objects {objects}, camera {kind or 'of the model'}>"

    @property
    def values(self) -> Dict[str, Any]:
        """All values of the scene as they are now."""
        return json.loads(self._do("values"))

    def plan(self) -> str:
        """What a render will do, and why."""
        return self._do("plan", _threads(self.threads))

    def render(
        self, samples: Optional[int] = None, progress: Any = False, *, denoise: bool = False
    ) -> "Shot":
        """Renders the scene as it is now, on its `threads` and without Python's lock.

        samples: samples a pixel from now on.
        progress: True prints, a function is called with the stage and the share of it that is done; what it
        raises stops the render and comes out of here.
        denoise: takes the noise out of a picture of light, by Open Image Denoise, which is to be installed: the
        layer "denoised" beside "picture", which keeps its own.
        """
        if samples is not None:
            self["render.samples"] = int(samples)
        told = _print_progress if progress is True else (progress or None)
        shot = Shot(self._do("render", told, _threads(self.threads), bool(denoise)))
        if progress is True:
            print(flush=True)
        return shot

    def frames(self, samples: Optional[int] = None, *, denoise: bool = False) -> "Frames":
        """The frames that the scene's `frames` name, each rendered when it is asked for; one of a scene without.

        samples: samples a pixel from now on. denoise: as of `render`.
        """
        if samples is not None:
            self["render.samples"] = int(samples)
        return Frames(self, denoise)


class Frames(Sequence["Shot"]):
    """The frames of a scene: `len(frames)`, `frames[i]`, `for shot in frames`.

    Each is rendered when it is asked for, and none is kept. Frames are pickled with their scene, so that workers of a
    data loader take each their own; they follow changes of the scene that they are of.
    """

    scene: Scene
    """The scene, which shows the frame that was asked for last until a value of it is set."""

    def __init__(self, scene: Scene, denoise: bool = False) -> None:
        self.scene, self._denoise = scene, bool(denoise)

    def _count(self) -> int:
        """How many the scene names; 0 of a scene without."""
        return self.scene._do("load_frames", _threads(self.scene.threads))

    def __len__(self) -> int:
        return max(self._count(), 1)

    def __getitem__(self, index: Any) -> Any:
        """The shot of frame `index`; negative ones count from the end. Of a slice a list."""
        count = self._count()
        if isinstance(index, slice):
            return [self._shot(number, count) for number in range(*index.indices(max(count, 1)))]
        number = int(index)
        if number < 0:
            number += max(count, 1)
        if not 0 <= number < max(count, 1):
            raise IndexError(f"frame {int(index)}: the scene has the frames 0 to {max(count, 1) - 1}")
        return self._shot(number, count)

    def __iter__(self) -> Iterator["Shot"]:
        count = self._count()
        return (self._shot(number, count) for number in range(max(count, 1)))

    def _shot(self, number: int, count: int) -> "Shot":
        threads = _threads(self.scene.threads)
        if count > 0:
            self.scene._do("show", number, threads)
        return Shot(self.scene._do("render", None, threads, self._denoise))

    def __repr__(self) -> str:
        return f"<etendue.Frames: {len(self)} of {self.scene!r}>"


def _print_progress(stage: str, share: float) -> None:
    print(f"\r{stage:>8} {100 * share:3.0f} %", end="", flush=True)


class Shot(Mapping[str, np.ndarray]):
    """A rendered picture: layers by name as arrays, the sensor's raw image, K and pose.

    shot["depth"] is (h, w), shot["normal"] (h, w, 3); rows from the top. Data layers are float64, and
    +inf (float), 0 (int) or the zero vector (directions) where nothing is hit.

    A shot that was pickled, such as one that another process returns, has all of this but `write`.
    """

    def __init__(self, core: Any) -> None:
        self._core = core
        self._names = {_core.layer_key(name): name for name in core.layers()}
        self._arrays: Dict[str, np.ndarray] = {}
        self._camera = json.loads(core.camera())

    def __reduce__(self) -> Any:
        return Shot, (StoredRendering.of(self._core),)

    def __getitem__(self, key: str) -> np.ndarray:
        name = key if key in self._names.values() else self._names.get(key)
        if name is None:
            raise KeyError(f"{key}: the shot has {', '.join(self._names)}")
        if name not in self._arrays:
            self._arrays[name] = self._core.layer(name)
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @property
    def raw(self) -> Optional[np.ndarray]:
        """Digital numbers of the first exposure, uint16 (h, w) or (h, w, channels); None without a sensor."""
        return self._core.raw(0)

    @property
    def exposures(self) -> List[Tuple[float, int]]:
        """Exposure times (s) and frames that the scene's sensor asks for."""
        return self._core.exposures()

    def raw_of(self, index: int) -> Optional[np.ndarray]:
        """Digital numbers of exposure `index`."""
        return self._core.raw(index)

    @property
    def K(self) -> Optional[np.ndarray]:
        """OpenCV's camera matrix (3, 3) in pixels; None for parallel rays."""
        k = self._camera["K"]
        return None if k is None else np.array(k)

    @property
    def pose(self) -> np.ndarray:
        """Camera to world, (4, 4), metres, OpenCV's axes."""
        return np.array(self._camera["world_from_camera"])

    @property
    def camera(self) -> Dict[str, Any]:
        """The camera as camera.json has it: K, distortion, extrinsics, lens."""
        return self._camera

    @property
    def report(self) -> Dict[str, Any]:
        """What the render did and cost: seconds, rays, memory, fingerprints, notes."""
        return json.loads(self._core.report())

    @property
    def notes(self) -> List[str]:
        """What a user should know."""
        return self.report["notes"]

    def meaning(self, key: str) -> Dict[str, str]:
        """Definition, unit, frame and miss of a layer."""
        return dict(self._core.meaning(self._names.get(key, key)))

    def write(self, folder: _Path, outputs: str = "exr,png,npy,dng") -> List[str]:
        """Writes the files that the command writes; gives their names."""
        return self._core.write(os.fspath(folder), outputs)

    def light_field(self) -> Optional["LightField"]:
        """The set of a light-field camera; None of other cameras. Renders its reference views."""
        with tempfile.TemporaryDirectory() as folder:
            self._core.write(folder, "npy")

            def array(stem: str) -> Optional[np.ndarray]:
                path = os.path.join(folder, f"{stem}.npy")
                return np.load(path) if os.path.exists(path) else None

            path = os.path.join(folder, "geometry.json")
            if not os.path.exists(path):
                return None
            with open(path, encoding="utf-8") as file:
                geometry = json.load(file)
            stems = ["picture", "white", "views", "reference", "central_depth", "central_disparity"]
            return LightField(*map(array, stems), geometry, array("refocused"))

    def _repr_png_(self) -> Optional[bytes]:
        """The picture, or else the first layer, for notebooks; None where it was pickled."""
        name = self._names.get("picture") or next(iter(self._names.values()), None)
        if name is None or isinstance(self._core, StoredRendering):
            return None
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "shot.png")
            self._core.write_png(path, name)
            with open(path, "rb") as file:
                return file.read()

    def __repr__(self) -> str:
        width, height = self._camera["resolution"]
        return f"<etendue.Shot {width} x {height}: {', '.join(self._names)}>"


class LightField(NamedTuple):
    """What a light-field camera leaves, as arrays; None for what it has not."""

    raw: Optional[np.ndarray]
    """(h, w, channels): the picture behind the lenslets; of a light_field_reference its views side by side."""
    white: Optional[np.ndarray]
    """(h, w, 3): the same before a radiance of 1 everywhere."""
    views: Optional[np.ndarray]
    """(n, n, rows, columns, channels): [down, across]; None where geometry["no_views"] says why."""
    reference: Optional[np.ndarray]
    """The same by an ideal lens."""
    depth: Optional[np.ndarray]
    """(rows, columns): z of the middle view, metres."""
    disparity: Optional[np.ndarray]
    """(rows, columns): of the middle view, columns a view."""
    geometry: Dict[str, Any]
    """geometry.json: centres, and the formula of disparities."""
    refocused: Optional[np.ndarray] = None
    """(h, w, channels): sharp at refocus_distance; of a camera without views by its lenslets' patches, unless
    geometry["no_patches"] says why not."""

    def __repr__(self) -> str:
        shapes = [
            f"{name} {value.shape}" for name, value in self._asdict().items() if isinstance(value, np.ndarray)
        ]
        return f"<etendue.LightField: {', '.join(shapes)}>"


class Traced(NamedTuple):
    """Rays behind a lens."""

    positions: np.ndarray
    """(n, 3), mm: on the last element, or where the ray ended."""
    directions: np.ndarray
    """(n, 3): unit vectors."""
    throughput: np.ndarray
    """(n,): what apertures and filters pass."""
    status: np.ndarray
    """(n,) uint8: 0 exited, 1 missed, 2 totally reflected, 3 vignetted."""
    element: np.ndarray
    """(n,) int32: the element that ended the ray, from 0 on the object side; -1 for those that exited."""


class Lens:
    """A lens of a lens file (.json), a Zemax file (.zmx) or a scene. Lengths are millimetres, z = 0 is the
    first element's vertex and +z runs from the object to the sensor."""

    def __init__(
        self, path: _Path, f_number: Optional[float] = None, allow_outside: bool = False
    ) -> None:
        self._arguments = (os.path.abspath(path), f_number, allow_outside)
        self._core = _core.Lens(os.fspath(path), f_number, allow_outside)

    def __reduce__(self) -> Any:
        return Lens, self._arguments

    def __repr__(self) -> str:
        length, number = self.effective_focal_length, self.f_number
        facts = [] if length is None else [f"{length:.4g} mm"]
        facts += [] if number is None else [f"f/{number:.3g}"]
        return f"<etendue.Lens {self.name or os.path.basename(self._arguments[0])}: {', '.join(facts) or 'afocal'}>"

    @property
    def name(self) -> str:
        """What its file calls it."""
        return self._core.name()

    @property
    def notes(self) -> List[str]:
        """What a user should know."""
        return self._core.notes()

    @property
    def wavelength(self) -> float:
        """The main wavelength (nm)."""
        return self._core.wavelength()

    def paraxial(self, wavelength: Optional[float] = None) -> Dict[str, Optional[float]]:
        """Focal lengths, principal planes, pupils (mm) and f-number at a wavelength (nm); None where the lens
        has none."""
        return self._core.paraxial(self.wavelength if wavelength is None else float(wavelength))

    @property
    def effective_focal_length(self) -> Optional[float]:
        """mm, at the main wavelength."""
        return self.paraxial()["effective_focal_length"]

    @property
    def back_focal_length(self) -> Optional[float]:
        """mm, at the main wavelength."""
        return self.paraxial()["back_focal_length"]

    @property
    def f_number(self) -> Optional[float]:
        """Focal length over the entrance pupil's diameter."""
        return self.paraxial()["f_number"]

    def trace(
        self,
        origins: Any,
        directions: Any,
        wavelength: Optional[float] = None,
        *,
        from_sensor: bool = False,
        clip: bool = True,
        threads: Optional[int] = None,
    ) -> Traced:
        """Takes rays through the lens: (n, 3) origins (mm) and directions, a wavelength (nm).

        clip: end rays at rims and stops. threads: how many threads work; None for all processors."""
        wavelength = self.wavelength if wavelength is None else float(wavelength)
        origins = _rows("origins", origins, np.float64)
        directions = _rows("directions", directions, np.float64)
        manner = (from_sensor, clip, _threads(threads))
        return Traced(*self._core.trace(origins, directions, wavelength, manner))


class Sensor:
    """A sensor: a preset ("imx183"), a sensor's JSON file, or that of a scene; settings by path, as on the
    command line: Sensor("imx183", {"temperature": 313.15})."""

    def __init__(self, name: _Path, settings: Optional[Mapping[str, Any]] = None) -> None:
        pairs = [(key, json.dumps(value)) for key, value in (settings or {}).items()]
        self._core = _core.Sensor(os.fspath(name), pairs)
        is_file = os.path.exists(name) or os.fspath(name).endswith(".json")
        self._arguments = (os.path.abspath(name) if is_file else name, dict(settings or {}))

    def __reduce__(self) -> Any:
        return Sensor, self._arguments

    def __repr__(self) -> str:
        facts = self.facts
        (width, height), bits = facts["resolution"], facts["bit_depth"]
        return f"<etendue.Sensor {os.path.basename(self._arguments[0])}: {width} x {height}, {bits} bits>"

    @property
    def facts(self) -> Dict[str, Any]:
        """Resolution, levels (DN), gain (DN/e-), noise (e-), pixel pitch (um); cfa: rows of the colour filter
        array's letters, None without one."""
        return self._core.facts()

    def expose(
        self, electrons: Any, seed: int = 0, exposure: float = 0.01, frame: int = 0
    ) -> np.ndarray:
        """Digital numbers (uint16) of one exposure, (h, w), of mean photo-electrons a pixel: (h, w), or (h, w, 3) of
        red, green and blue, of which each pixel of a colour filter array has that of its filter. The exposure time
        (s) counts for the dark current; another frame has other temporal noise."""
        array = np.asarray(electrons, dtype=np.float64)
        if array.ndim == 3 and array.shape[2] == 3 and array.size:
            array = self._mosaic(array)
        if array.ndim != 2 or array.size == 0:
            raise ValueError(f"electrons has the shape {array.shape} instead of (h, w) or (h, w, 3)")
        return self._core.expose(np.ascontiguousarray(array), float(exposure), int(frame), int(seed))

    def _mosaic(self, colors: np.ndarray) -> np.ndarray:
        """Of each pixel of (h, w, 3) the colour that its filter passes."""
        cfa = self.facts["cfa"]
        if cfa is None:
            raise ValueError(
                "electrons of three colours want a sensor with a colour filter array, and this has none: give (h, w), or "
                'settings {"cfa": "rggb"}'
            )
        unknown = sorted(set("".join(cfa)) - set("rgb"))
        if unknown:
            raise ValueError(
                f"the colour filter array has the filters {', '.join(unknown)} beside r, g and b, whose electrons three "
                "colours do not tell: give (h, w)"
            )
        letters = np.array([["rgb".index(letter) for letter in row] for row in cfa])
        height, width = colors.shape[:2]
        repeats = (-(-height // letters.shape[0]), -(-width // letters.shape[1]))
        channel = np.tile(letters, repeats)[:height, :width]
        return np.take_along_axis(colors, channel[:, :, None], axis=2)[:, :, 0]


class Light:
    """A picture of light from elsewhere: light = Light.read("cube.hdr"), or Light(values, wavelengths).

    Files are EXR (red, green and blue, or spectral by the layout of Fichet et al.), NPY, ENVI cubes (either of
    their two files) and Radiance pictures.
    """

    def __init__(
        self, values: Any, wavelengths: Optional[Sequence[float]] = None, unit: Optional[str] = None
    ) -> None:
        """values: (h, w), (h, w, 3) linear sRGB or, with wavelengths (nm) of the bands' middles, (h, w, bands).
        unit: "1" (1 is full scale), "W/m2/sr/nm" (spectral radiance) or "W/m2/nm" (spectral irradiance on the
        sensor), with mW, uW, cm2, um and the like."""
        array = np.ascontiguousarray(values, dtype=np.float64)
        self._core, self._unit = _core.LightImage.from_array(array, _listed(wavelengths)), unit

    @classmethod
    def read(cls, path: _Path, wavelengths: Optional[Sequence[float]] = None) -> "Light":
        """Reads a file. wavelengths: the middles of the bands (nm) of an array that does not say them."""
        light = cls.__new__(cls)
        light._core = _core.LightImage.open(os.fspath(path), _listed(wavelengths))
        light._unit = None
        return light

    @property
    def values(self) -> np.ndarray:
        """float32 (h, w, bands), or (h, w, 3) of red, green and blue; rows from the top."""
        return self._core.values()

    @property
    def edges(self) -> Optional[np.ndarray]:
        """Edges of the bands (nm), one more than there are bands; None of red, green and blue."""
        edges = self._core.edges()
        return None if edges is None else np.array(edges)

    @property
    def wavelengths(self) -> Optional[np.ndarray]:
        """Middles of the bands (nm); None of red, green and blue."""
        edges = self.edges
        return None if edges is None else 0.5 * (edges[1:] + edges[:-1])

    @property
    def unit(self) -> Optional[str]:
        """The unit of the values, in the words of the file; None where nobody says it."""
        return self._unit or self._core.unit()

    @property
    def notes(self) -> List[str]:
        """What a user should know."""
        return self._core.notes()

    def expose(
        self,
        sensor: Union["Sensor", _Path],
        *,
        unit: Optional[str] = None,
        f_number: Optional[float] = None,
        magnification: float = 0.0,
        seed: Optional[int] = None,
        frame: int = 0,
    ) -> "Exposed":
        """What a sensor makes of it; the sensor's pixels are the picture's.

        unit: that of the values, where the file does not say it. f_number, magnification: of the lens, where they
        are radiance: E = pi L / (1 + 4 N^2 (1 + m)^2). seed: of the noise; None takes that of the render that left
        the file, or else 0. frame: others have noise of their own.
        """
        sensor = sensor if isinstance(sensor, Sensor) else Sensor(sensor)
        number = None if f_number is None else float(f_number)
        return Exposed(
            self._core.expose(sensor._core, unit or self._unit, number, float(magnification), seed, int(frame))
        )

    def __repr__(self) -> str:
        shape, edges = self.values.shape, self.edges
        bands = "" if edges is None else f", {edges[0]:g} to {edges[-1]:g} nm"
        return f"<etendue.Light {shape}{bands}, unit {self.unit}>"


def _listed(wavelengths: Optional[Sequence[float]]) -> Optional[List[float]]:
    return None if wavelengths is None else [float(nm) for nm in wavelengths]


class Exposed:
    """A picture of light on a sensor."""

    def __init__(self, core: Any) -> None:
        self._core = core

    @property
    def raw(self) -> np.ndarray:
        """Digital numbers of the first exposure, uint16 (h, w) or (h, w, channels)."""
        return self._core.raw(0)

    def raw_of(self, index: int) -> np.ndarray:
        """Digital numbers of exposure `index`."""
        return self._core.raw(index)

    @property
    def exposures(self) -> List[Tuple[float, int]]:
        """Exposure times (s) and frames that the sensor asks for."""
        return self._core.exposures()

    @property
    def notes(self) -> List[str]:
        """What a user should know."""
        return self._core.notes()

    def write(self, folder: _Path, outputs: str = "png,npy,dng") -> List[str]:
        """Writes the files that the command writes; gives their names."""
        return self._core.write(os.fspath(folder), outputs)

    def __repr__(self) -> str:
        return f"<etendue.Exposed: {len(self.exposures)} of {self.raw.shape}>"


class Hits(NamedTuple):
    """The closest hits of rays, (n,) each and (n, 3) for the normal."""

    t: np.ndarray
    """In lengths of the ray's direction; +inf for a miss."""
    triangle: np.ndarray
    """int64; -1 for a miss."""
    u: np.ndarray
    """Barycentric coordinate of the second corner."""
    v: np.ndarray
    """Barycentric coordinate of the third corner."""
    normal: np.ndarray
    """Unit geometric normal on the triangle's front; zero for a miss."""


def _accel(vertices: Any, faces: Any, backend: Optional[str], threads: Optional[int]) -> "Accel":
    return Accel(vertices, faces, backend, threads=threads)


class Accel:
    """A ray caster over one mesh: Embree finds, double precision measures."""

    def __init__(
        self, vertices: Any, faces: Any, backend: Optional[str] = None, *, threads: Optional[int] = None
    ) -> None:
        """vertices: (n, 3) float. faces: (m, 3) int. backend: embree, bvh (pure Rust) or exact (slow); the first of
        them that is built in when it is None.
        threads: how many threads work; None for all processors."""
        self.threads, self._backend = threads, backend
        vertices, faces = _rows("vertices", vertices, np.float64), _rows("faces", faces, np.uint32)
        backend = backend or ("embree" if has_embree else "bvh")
        self._core = _core.Accel(vertices, faces, backend, _threads(threads))

    def __reduce__(self) -> Any:
        return _accel, (*self._core.mesh(), self._backend, self.threads)

    def closest(
        self, origins: Any, directions: Any, t_max: Any = None, *, coherent: bool = False
    ) -> Hits:
        """The closest hit of each ray: (n, 3) origins and directions, of any length but 0. t_max: (n,) or one
        number, in lengths of the directions. coherent: neighbours run close together, as a camera's do.
        A ray that is not finite misses."""
        found = self._core.closest(*self._rays(origins, directions, t_max), coherent, _threads(self.threads))
        return Hits(found["t"], found["triangle"], found["u"], found["v"], found["normal"])

    def occluded(
        self, origins: Any, directions: Any, t_max: Any = None, *, coherent: bool = False
    ) -> np.ndarray:
        """Whether anything is in the way of each ray, up to t_max: (n,) bool."""
        return self._core.occluded(*self._rays(origins, directions, t_max), coherent, _threads(self.threads))

    @staticmethod
    def _rays(origins: Any, directions: Any, t_max: Any) -> Tuple[Any, Any, Any]:
        origins = _rows("origins", origins, np.float64)
        return origins, _rows("directions", directions, np.float64), _limits(t_max, len(origins))

    def __repr__(self) -> str:
        return f"<etendue.Accel: {self._core.report()}>"


def _limits(t_max: Any, count: int) -> Optional[np.ndarray]:
    if t_max is None:
        return None
    return np.ascontiguousarray(np.broadcast_to(np.asarray(t_max, dtype=np.float64), (count,)))
