"""Pictures of what the tables say, in the way of the paper's figures 3 and 5."""
import os
import subprocess

PLACE = "0.28,0.62,0.5,0.022"  # of the zoomed view: a share of the box along x, y, z, and a radius in diagonals
RANGE = 1e-4                   # the last colour of painted distances, in diagonals


def structure(program, cloud, box, folder, work):
    """How the triangles lie: isosurface, clustered, diffused; one picture each."""
    low, high, diagonal = box
    share = [float(v) for v in PLACE.split(",")]
    place = [a + s * (b - a) for a, b, s in zip(low, high, share)] + [share[3] * diagonal]
    variants = {"none": ["--cluster", "none"], "free": ["--cluster", "free"], "preserving": [],
                "diffused": ["--diffuse"]}
    for name, options in variants.items():
        mesh = os.path.join(work, "picture.ply")
        subprocess.run([program, "surface", cloud, "-o", mesh, "--quiet", *options], check=True)
        _render(program, [mesh, "-o", os.path.join(folder, f"paper_structure_{name}.png"), "--size", "480x480", "--wireframe",
                          "--flat", "--zoom", ",".join(f"{v:.6g}" for v in place)])


def distances(program, clouds, true_mesh, diagonal, folder, work):
    """The distance to the truth painted on the whole model, from clean and from noisy samples."""
    for name, cloud in clouds.items():
        mesh = os.path.join(work, "picture.ply")
        subprocess.run([program, "surface", cloud, "-o", mesh, "--quiet"], check=True)
        _render(program, [mesh, "-o", os.path.join(folder, f"paper_distance_{name}.png"), "--size", "900x640", "--paint",
                          "distance", "--reference", true_mesh, "--paint-range", f"0,{RANGE * diagonal:.6g}"])


def _render(program, words):
    subprocess.run([program, "render", *words, "--quiet"], check=True)
