"""Lamina turns point clouds into triangle meshes.

    import lamina
    mesh = lamina.surface(points, normals)      # NumPy arrays of shape (n, 3), or a path
    mesh.save("mesh.ply")

Keywords are the options of the program `lamina`, with _ for -. Lengths are in the units of the points.
Messages go to the logger "lamina" of the module logging.
"""
from typing import NamedTuple


class Error(RuntimeError):
    """What the library refuses or cannot do, in one line that names the file, the place and the remedy.

    exit_code is the program's: 1 internal or cancelled, 2 usage, 3 unreadable input, 4 memory, disk or output,
    5 nothing came out, 6 a mesh that is not as expected.
    """

    def __init__(self, message, exit_code=1):
        super().__init__(message, exit_code)
        self.exit_code = exit_code

    def __str__(self):
        return self.args[0]


class Voxels(NamedTuple):
    """Values of all voxels of a box."""

    values: "numpy.ndarray"  #: (nx, ny, nz) float32
    origin: "tuple[float, float, float]"  #: centre of values[0, 0, 0], in the units of the mesh
    edge: float  #: of a voxel


class SparseVoxels(NamedTuple):
    """Values of active voxels."""

    values: "numpy.ndarray"  #: (n,) float32
    indices: "numpy.ndarray"  #: (n, 3) int32; the centre of a voxel is origin + edge * indices
    origin: "tuple[float, float, float]"
    edge: float


from ._lamina import (  # noqa: E402  (the extension raises Error)
    Mesh,
    Slab,
    Stream,
    __version__,
    check,
    clean,
    compare,
    measure,
    normals,
    plan,
    radii,
    render,
    save_png,
    simplify,
    surface,
    surface_to_file,
    volume,
    voxels,
)

__all__ = [
    "Error",
    "Mesh",
    "Slab",
    "SparseVoxels",
    "Stream",
    "Voxels",
    "__version__",
    "check",
    "clean",
    "compare",
    "measure",
    "normals",
    "plan",
    "radii",
    "render",
    "save_png",
    "simplify",
    "surface",
    "surface_to_file",
    "volume",
    "voxels",
]
