"""Types of lamina; made by scripts/python-stubs. help(lamina.surface) tells what each keyword means."""
import os
from typing import Any, Callable, Iterator, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

Path = Union[str, "os.PathLike[str]"]
Points = Union[NDArray[Any], ArrayLike, Path, Sequence[Path]]
Attributes = Mapping[str, NDArray[Any]]
#: Called with the stage, what is done of it (0 to 1) and the seconds left; False cancels.
Progress = Callable[[str, float, Optional[float]], Optional[bool]]
#: The value of an option: as it would be typed, a number, or numbers.
Value = Union[str, float, bool, Path, Sequence[float], Sequence[str], None]

__version__: str
__all__: list[str]

class Error(RuntimeError):
    exit_code: int
    def __init__(self, message: str, exit_code: int = ...) -> None: ...

class Voxels(NamedTuple):
    values: NDArray[np.float32]
    origin: tuple[float, float, float]
    edge: float

class SparseVoxels(NamedTuple):
    values: NDArray[np.float32]
    indices: NDArray[np.int32]
    origin: tuple[float, float, float]
    edge: float

class Mesh:
    def __init__(
        self, vertices: ArrayLike, faces: ArrayLike, normals: Optional[ArrayLike] = ..., attributes: Attributes = ...
    ) -> None: ...
    @staticmethod
    def from_file(path: Path) -> "Mesh": ...
    def save(self, path: Path) -> None: ...
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def faces(self) -> NDArray[np.uint32]: ...
    @property
    def normals(self) -> Optional[NDArray[np.float32]]: ...
    @property
    def attributes(self) -> dict[str, NDArray[Any]]: ...
    @property
    def colors(self) -> Optional[NDArray[Any]]: ...
    @property
    def stats(self) -> Optional[dict[str, Any]]: ...

class Slab:
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def faces(self) -> NDArray[np.uint32]: ...
    @property
    def normals(self) -> Optional[NDArray[np.float32]]: ...
    @property
    def attributes(self) -> dict[str, NDArray[Any]]: ...
    @property
    def colors(self) -> Optional[NDArray[Any]]: ...
    @property
    def first_vertex(self) -> int: ...

class Stream:
    def __init__(
        self,
        *,
        progress: Optional[Progress] = ...,
        preset: Value = ...,
        columns: Value = ...,
        keep_class: Value = ...,
        drop_class: Value = ...,
        returns: Value = ...,
        resolution: Value = ...,
        where: Value = ...,
        project_degrees: bool = ...,
        ignore_checksums: bool = ...,
        frame: Value = ...,
        bad_samples: Value = ...,
        particlescale: Value = ...,
        density: Value = ...,
        max_radius: Value = ...,
        align: bool = ...,
        keep_poses: bool = ...,
        clip: Value = ...,
        every: Value = ...,
        merge: Value = ...,
        outliers: Value = ...,
        neighbours: Value = ...,
        neighbors: Value = ...,
        strays: bool = ...,
        keep_strays: bool = ...,
        spacing: Value = ...,
        rejected: Value = ...,
        normals: Value = ...,
        k: Value = ...,
        radius: Value = ...,
        viewpoint: Value = ...,
        up: Value = ...,
        flip: bool = ...,
        raw: bool = ...,
        blend: Value = ...,
        refit: Value = ...,
        steps: Value = ...,
        step_tolerance: Value = ...,
        fit: Value = ...,
        diffuse: bool = ...,
        features: Value = ...,
        cell: Value = ...,
        levels: Value = ...,
        boundary: Value = ...,
        trim: Value = ...,
        cluster: Value = ...,
        chord: Value = ...,
        level: bool = ...,
        curvature: bool = ...,
        close_holes: Value = ...,
        bridge: Value = ...,
        filled: bool = ...,
        fill: Value = ...,
        watertight: Value = ...,
        prune: Value = ...,
        prune_size: Value = ...,
        local: bool = ...,
        error: Value = ...,
        triangles: Value = ...,
        ratio: Value = ...,
        deviation: Value = ...,
        vdb: Value = ...,
        vdb_grids: Value = ...,
        vdb_precision: Value = ...,
        vdb_band: Value = ...,
        vdb_voxelsize: Value = ...,
        vdb_levels: bool = ...,
        vdb_split: Value = ...,
        vdb_points: Value = ...,
        window: Value = ...,
        threads: Value = ...,
        tmp_dir: Value = ...,
        max_memory: Value = ...,
    ) -> None: ...
    def __enter__(self) -> "Stream": ...
    def __exit__(self, *what: Any) -> None: ...
    def add(
        self,
        points: ArrayLike,
        normals: Optional[ArrayLike] = ...,
        radius: Union[ArrayLike, float, None] = ...,
        attributes: Attributes = ...,
    ) -> None: ...
    def slabs(self) -> Iterator[Slab]: ...
    def finish(self) -> Mesh: ...
    @property
    def points(self) -> int: ...
    @property
    def stats(self) -> Optional[dict[str, Any]]: ...

def surface(
    points: Points,
    normals: Optional[ArrayLike] = ...,
    radius: Union[ArrayLike, float, None] = ...,
    attributes: Attributes = ...,
    *,
    progress: Optional[Progress] = ...,
    preset: Value = ...,
    columns: Value = ...,
    keep_class: Value = ...,
    drop_class: Value = ...,
    returns: Value = ...,
    resolution: Value = ...,
    where: Value = ...,
    project_degrees: bool = ...,
    ignore_checksums: bool = ...,
    frame: Value = ...,
    bad_samples: Value = ...,
    particlescale: Value = ...,
    density: Value = ...,
    max_radius: Value = ...,
    align: bool = ...,
    keep_poses: bool = ...,
    clip: Value = ...,
    every: Value = ...,
    merge: Value = ...,
    outliers: Value = ...,
    neighbours: Value = ...,
    neighbors: Value = ...,
    strays: bool = ...,
    keep_strays: bool = ...,
    spacing: Value = ...,
    rejected: Value = ...,
    normals: Value = ...,
    k: Value = ...,
    radius: Value = ...,
    viewpoint: Value = ...,
    up: Value = ...,
    flip: bool = ...,
    raw: bool = ...,
    blend: Value = ...,
    refit: Value = ...,
    steps: Value = ...,
    step_tolerance: Value = ...,
    fit: Value = ...,
    diffuse: bool = ...,
    features: Value = ...,
    cell: Value = ...,
    levels: Value = ...,
    boundary: Value = ...,
    trim: Value = ...,
    cluster: Value = ...,
    chord: Value = ...,
    level: bool = ...,
    curvature: bool = ...,
    close_holes: Value = ...,
    bridge: Value = ...,
    filled: bool = ...,
    fill: Value = ...,
    watertight: Value = ...,
    prune: Value = ...,
    prune_size: Value = ...,
    local: bool = ...,
    error: Value = ...,
    triangles: Value = ...,
    ratio: Value = ...,
    deviation: Value = ...,
    vdb: Value = ...,
    vdb_grids: Value = ...,
    vdb_precision: Value = ...,
    vdb_band: Value = ...,
    vdb_voxelsize: Value = ...,
    vdb_levels: bool = ...,
    vdb_split: Value = ...,
    vdb_points: Value = ...,
    window: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> Mesh: ...

def surface_to_file(
    points: Points,
    output: Union[Path, Sequence[Path]],
    normals: Optional[ArrayLike] = ...,
    radius: Union[ArrayLike, float, None] = ...,
    attributes: Attributes = ...,
    *,
    progress: Optional[Progress] = ...,
    preset: Value = ...,
    columns: Value = ...,
    keep_class: Value = ...,
    drop_class: Value = ...,
    returns: Value = ...,
    resolution: Value = ...,
    where: Value = ...,
    project_degrees: bool = ...,
    ignore_checksums: bool = ...,
    frame: Value = ...,
    bad_samples: Value = ...,
    particlescale: Value = ...,
    density: Value = ...,
    max_radius: Value = ...,
    align: bool = ...,
    keep_poses: bool = ...,
    clip: Value = ...,
    every: Value = ...,
    merge: Value = ...,
    outliers: Value = ...,
    neighbours: Value = ...,
    neighbors: Value = ...,
    strays: bool = ...,
    keep_strays: bool = ...,
    spacing: Value = ...,
    rejected: Value = ...,
    normals: Value = ...,
    k: Value = ...,
    radius: Value = ...,
    viewpoint: Value = ...,
    up: Value = ...,
    flip: bool = ...,
    raw: bool = ...,
    blend: Value = ...,
    refit: Value = ...,
    steps: Value = ...,
    step_tolerance: Value = ...,
    fit: Value = ...,
    diffuse: bool = ...,
    features: Value = ...,
    cell: Value = ...,
    levels: Value = ...,
    boundary: Value = ...,
    trim: Value = ...,
    cluster: Value = ...,
    chord: Value = ...,
    level: bool = ...,
    curvature: bool = ...,
    close_holes: Value = ...,
    bridge: Value = ...,
    filled: bool = ...,
    fill: Value = ...,
    watertight: Value = ...,
    prune: Value = ...,
    prune_size: Value = ...,
    local: bool = ...,
    error: Value = ...,
    triangles: Value = ...,
    ratio: Value = ...,
    deviation: Value = ...,
    vdb: Value = ...,
    vdb_grids: Value = ...,
    vdb_precision: Value = ...,
    vdb_band: Value = ...,
    vdb_voxelsize: Value = ...,
    vdb_levels: bool = ...,
    vdb_split: Value = ...,
    vdb_points: Value = ...,
    tiles: Value = ...,
    tiles_plain: bool = ...,
    checkpoint: Value = ...,
    resume: bool = ...,
    window: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> dict[str, Any]: ...

def plan(
    points: Points,
    normals: Optional[ArrayLike] = ...,
    radius: Union[ArrayLike, float, None] = ...,
    attributes: Attributes = ...,
    *,
    progress: Optional[Progress] = ...,
    preset: Value = ...,
    columns: Value = ...,
    keep_class: Value = ...,
    drop_class: Value = ...,
    returns: Value = ...,
    resolution: Value = ...,
    where: Value = ...,
    project_degrees: bool = ...,
    ignore_checksums: bool = ...,
    frame: Value = ...,
    bad_samples: Value = ...,
    particlescale: Value = ...,
    density: Value = ...,
    max_radius: Value = ...,
    align: bool = ...,
    keep_poses: bool = ...,
    clip: Value = ...,
    every: Value = ...,
    merge: Value = ...,
    outliers: Value = ...,
    neighbours: Value = ...,
    neighbors: Value = ...,
    strays: bool = ...,
    keep_strays: bool = ...,
    spacing: Value = ...,
    rejected: Value = ...,
    normals: Value = ...,
    k: Value = ...,
    radius: Value = ...,
    viewpoint: Value = ...,
    up: Value = ...,
    flip: bool = ...,
    raw: bool = ...,
    blend: Value = ...,
    refit: Value = ...,
    steps: Value = ...,
    step_tolerance: Value = ...,
    fit: Value = ...,
    diffuse: bool = ...,
    features: Value = ...,
    cell: Value = ...,
    levels: Value = ...,
    boundary: Value = ...,
    trim: Value = ...,
    cluster: Value = ...,
    chord: Value = ...,
    level: bool = ...,
    curvature: bool = ...,
    close_holes: Value = ...,
    bridge: Value = ...,
    filled: bool = ...,
    fill: Value = ...,
    watertight: Value = ...,
    prune: Value = ...,
    prune_size: Value = ...,
    local: bool = ...,
    error: Value = ...,
    triangles: Value = ...,
    ratio: Value = ...,
    deviation: Value = ...,
    vdb: Value = ...,
    vdb_grids: Value = ...,
    vdb_precision: Value = ...,
    vdb_band: Value = ...,
    vdb_voxelsize: Value = ...,
    vdb_levels: bool = ...,
    vdb_split: Value = ...,
    vdb_points: Value = ...,
    window: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> dict[str, Any]: ...

def normals(
    points: Points,
    normals: Optional[ArrayLike] = ...,
    attributes: Attributes = ...,
    *,
    progress: Optional[Progress] = ...,
    reorient: bool = ...,
    missing: bool = ...,
    preset: Value = ...,
    k: Value = ...,
    radius: Value = ...,
    viewpoint: Value = ...,
    up: Value = ...,
    flip: bool = ...,
    columns: Value = ...,
    keep_class: Value = ...,
    drop_class: Value = ...,
    returns: Value = ...,
    resolution: Value = ...,
    where: Value = ...,
    project_degrees: bool = ...,
    ignore_checksums: bool = ...,
    bad_samples: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> NDArray[np.float32]: ...

def radii(
    points: Points,
    *,
    progress: Optional[Progress] = ...,
    density: Value = ...,
    particlescale: Value = ...,
    minradius: Value = ...,
    maxradius: Value = ...,
    columns: Value = ...,
    keep_class: Value = ...,
    drop_class: Value = ...,
    returns: Value = ...,
    resolution: Value = ...,
    where: Value = ...,
    project_degrees: bool = ...,
    ignore_checksums: bool = ...,
    bad_samples: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> NDArray[np.float32]: ...

def clean(
    points: Points,
    normals: Optional[ArrayLike] = ...,
    radius: Union[ArrayLike, float, None] = ...,
    attributes: Attributes = ...,
    *,
    progress: Optional[Progress] = ...,
    clip: Value = ...,
    every: Value = ...,
    merge: Value = ...,
    outliers: Value = ...,
    neighbours: Value = ...,
    neighbors: Value = ...,
    strays: bool = ...,
    keep_strays: bool = ...,
    spacing: Value = ...,
    columns: Value = ...,
    keep_class: Value = ...,
    drop_class: Value = ...,
    returns: Value = ...,
    resolution: Value = ...,
    where: Value = ...,
    project_degrees: bool = ...,
    ignore_checksums: bool = ...,
    bad_samples: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> NDArray[np.bool_]: ...

def compare(
    mesh: Union[Mesh, Path],
    truth: Union[Mesh, Path],
    *,
    progress: Optional[Progress] = ...,
    count: Value = ...,
    vertices: bool = ...,
    seed: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> dict[str, Any]: ...

def simplify(
    mesh: Union[Mesh, Path],
    *,
    progress: Optional[Progress] = ...,
    error: Value = ...,
    triangles: Value = ...,
    ratio: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> Mesh: ...

def render(
    model: Union[Mesh, NDArray[Any], Path],
    *,
    progress: Optional[Progress] = ...,
    size: Value = ...,
    supersample: Value = ...,
    view: Value = ...,
    views: Value = ...,
    up: Value = ...,
    zoom: Value = ...,
    colour: Value = ...,
    color: Value = ...,
    flat: bool = ...,
    wireframe: bool = ...,
    wire: bool = ...,
    mark_boundary: bool = ...,
    point_radius: Value = ...,
    paint: Value = ...,
    reference: Value = ...,
    paint_range: Value = ...,
    grid: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> NDArray[np.uint8]: ...

def volume(
    mesh: Union[Mesh, Path],
    output: Path,
    *,
    progress: Optional[Progress] = ...,
    voxelsize: Value = ...,
    voxel: Value = ...,
    halfbandvoxels: Value = ...,
    band: Value = ...,
    sign: Value = ...,
    name: Value = ...,
    no_colour: bool = ...,
    no_color: bool = ...,
    half: bool = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> dict[str, Any]: ...

def voxels(
    source: Union[Mesh, Path],
    *,
    grid: str = ...,
    sparse: bool = ...,
    progress: Optional[Progress] = ...,
    voxelsize: Value = ...,
    voxel: Value = ...,
    halfbandvoxels: Value = ...,
    band: Value = ...,
    sign: Value = ...,
    threads: Value = ...,
    tmp_dir: Value = ...,
    max_memory: Value = ...,
) -> Union[Voxels, SparseVoxels]: ...

def check(mesh: Union[Mesh, Path], *, expect: str = ..., threads: int = ...) -> dict[str, Any]: ...
def measure(mesh: Union[Mesh, Path], *, threads: int = ...) -> dict[str, Any]: ...
def save_png(path: Path, picture: NDArray[np.uint8]) -> None: ...
