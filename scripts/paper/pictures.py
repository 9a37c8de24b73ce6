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
        subprocess.run([program, "surface", cloud, "-o", mesh, "--raw", "--quiet", *options], check=True)
        _render(program, [mesh, "-o", os.path.join(folder, f"paper_structure_{name}.png"), "--size", "480x480", "--wireframe",
                          "--flat", "--zoom", ",".join(f"{v:.6g}" for v in place)])


def distances(program, clouds, true_mesh, diagonal, folder, work):
    """The distance to the truth painted on the whole model, from clean and from noisy samples."""
    for name, cloud in clouds.items():
        mesh = os.path.join(work, "picture.ply")
        subprocess.run([program, "surface", cloud, "-o", mesh, "--raw", "--quiet"], check=True)
        _render(program, [mesh, "-o", os.path.join(folder, f"paper_distance_{name}.png"), "--size", "900x640", "--paint",
                          "distance", "--reference", true_mesh, "--paint-range", f"0,{RANGE * diagonal:.6g}"])


# What is drawn of scans and scenes: the camera, to see what differs.
SCANNED = {"tap": ["--view", "30,40", "--up", "z"], "bowl": ["--view", "30,40", "--up", "z"],
           "part": ["--view", "30,40", "--up", "z", "--color", "none"], "dragon": ["--view", "30,15"],
           "heavy": ["--view", "30,15"], "facade": ["--view", "20,15"],
           "room": ["--zoom", "3,0.55,1.7,0.95", "--view", "200,20"],
           "KnotBadlyScanned": ["--view", "30,35"], "Facade": ["--view", "20,15"],
           "Room": ["--zoom", "2.2,0.7,1.6,1.2", "--view", "200,20"], "Terraces": ["--view", "30,35", "--up", "z"]}
BESIDE = ("lamina", "poisson")


def scanned(program, case, folder):
    """Ours and Poisson's mesh of a scan, their boundaries in red; only those meshes that an earlier run left."""
    for word, method in zip(BESIDE, ("lamina", case.beside)) if case.name in SCANNED else ():
        if os.path.exists(case.mesh(method)):
            _render(program, [case.mesh(method), "-o", _scanned_picture(folder, case.name, word), "--size", "480x360",
                              "--mark-boundary", *SCANNED[case.name]])


def scanned_table(folder, link):
    """The pictures that are there, side by side, as Markdown; `link`: the folder as the page names it."""
    rows = [name for name in SCANNED if all(os.path.exists(_scanned_picture(folder, name, word)) for word in BESIDE)]
    lines = [f"| {name} | " + " | ".join(f"![{name}, {word}]({_scanned_picture(link, name, word)})" for word in BESIDE) + " |"
             for name in rows]
    return "\n".join(["| | lamina | Open3D's Poisson, trimmed |", "|---|---|---|", *lines]) if rows else ""


def _scanned_picture(folder, name, word):
    return os.path.join(folder, f"scanned_{name}_{word}.png")


def _render(program, words):
    subprocess.run([program, "render", *words, "--quiet"], check=True)
