"""Real scans with a reference, and scanned scenes: what paper-tables runs on them, and how the meshes are judged.

The scans are those of the survey's benchmark in the folder of real scans. The scenes lie in a folder of their own: scan_NAME.ply,
the points; gt_NAME.*, the truth; seen_NAME.ply, places of the truth that the scanner saw; scan_NAME.json, which tells the distance
of neighbouring rays where they hit ("px").
"""
import glob
import json
import os
import subprocess
import sys

from paper import models, peers, runs

HERE = os.path.dirname(os.path.abspath(__file__))
# Points and reference, in the folder of real scans.
SCANS = {"tap": ("tap.ply", "tap_reference.ply"), "bowl": ("bowl.ply", "bowl_reference.ply"),
         "murex": ("murex_noise.ply", "murex_truth.ply"), "part": ("part_missing.ply", "part_truth.ply")}
# No option, and all closed.
CHOICES = {"lamina": [], "lamina --fill all": ["--fill", "all"]}
DEPTHS = {"scans": (8, 9), "scenes": (9, 10)}  # of Poisson's octrees, after the sizes of the clouds
FIRST_SCENES = ("dragon", "heavy", "armadillo", "facade", "room", "cad", "plate")
MAKER = "lamina_scenes"


class Case:
    """A cloud and its truth. `judge` tells of a mesh file what the table shows; `beside` is the mesh that is drawn beside ours."""

    def __init__(self, name, cloud, folder):
        self.name, self.cloud = name, cloud
        self.folder = os.path.join(folder, name)
        os.makedirs(self.folder, exist_ok=True)

    def mesh(self, method):
        return os.path.join(self.folder, method.replace(" ", "_").replace(",", "") + ".ply")

    def plain(self, program, path, name):
        """A copy as the metrics read it: finite, binary, triangles. Kept where a name is given."""
        result = os.path.join(self.folder, f"{name or 'judged'}.ply")
        if not name or not os.path.exists(result):
            subprocess.run([program, "convert", path, "-o", result, "--quiet"], check=True)
        return result


class Scan(Case):
    beside = f"Open3D Poisson, depth {DEPTHS['scans'][0]}, trimmed"

    def __init__(self, name, cloud, reference, folder):
        super().__init__(name, cloud, folder)
        self.reference = reference

    def judge(self, program, path):
        return _metrics("survey", self.plain(program, path, None), self.plain(program, self.reference, "reference"),
                        self.plain(program, self.cloud, "cloud"))


class Scene(Case):
    beside = f"Open3D Poisson, depth {DEPTHS['scenes'][0]}, trimmed"

    def __init__(self, name, scenes, folder):
        super().__init__(name, os.path.join(scenes, f"scan_{name}.ply"), folder)
        self.seen = os.path.join(scenes, f"seen_{name}.ply")
        self.truth = next(iter(glob.glob(os.path.join(scenes, f"gt_{name}.*"))), None)
        with open(os.path.join(scenes, f"scan_{name}.json")) as f:
            self.spacing = json.load(f)["px"]

    def judge(self, program, path):
        return _metrics("scene", self.plain(program, path, None), self.plain(program, self.truth, "truth"), self.seen,
                        repr(self.spacing))


def _metrics(*words):
    """In a process of its own: this one stays small, as the peak memory of what it starts is never less than its own."""
    done = subprocess.run([sys.executable, os.path.join(HERE, "scan_metrics.py"), *words], capture_output=True, text=True)
    if done.returncode != 0:
        print(f"paper-tables: scan_metrics: {done.stderr.strip()[-300:]}")
        raise runs.RunFailed("not judged")
    return json.loads(done.stdout)


def real_scans(data, folder):
    for name, (cloud, reference) in SCANS.items():
        paths = [os.path.join(data, "scans", file) for file in (cloud, reference)]
        if all(map(os.path.exists, paths)):
            yield Scan(name, *paths, folder)
        else:
            print(f"paper-tables: {name}: not in {data}/scans, passed over")


def scenes(source, folder):
    found = [os.path.basename(path)[len("scan_"):-len(".ply")] for path in glob.glob(os.path.join(source, "scan_*.ply"))]
    for name in sorted(found, key=lambda n: (FIRST_SCENES.index(n) if n in FIRST_SCENES else len(FIRST_SCENES), n)):
        yield Scene(name, source, folder)


def make_scenes(build, target, data, folder):
    """Scans the project's own scenes, those of its tests with sixteen times the samples; and the dragon, where it can be had."""
    subprocess.run(["cmake", "--build", build, "--target", MAKER], check=True)
    os.makedirs(target, exist_ok=True)
    dragon = models.truth("dragon", folder, data)
    subprocess.run([os.path.join(build, "tests", "scenes", MAKER), target, *([dragon] if dragon else [])], check=True)


def measured(case, program, found, wanted, known):
    """Rows of a case: Lamina's, then the peers'. `wanted(name)`: which; `known`: rows of peers that are not to be run again."""
    knows_fill = "--fill" in subprocess.run([program, "surface", "--help"], capture_output=True, text=True).stdout
    for name, options in CHOICES.items():
        if wanted(name) and (knows_fill or "--fill" not in options):
            yield _row(case, program, name, False, lambda mesh: _lamina(program, case.cloud, mesh, options))
    kept = {(row["scene"], row["name"]) for row in known}
    due = {name: peer for name, peer in found.items() if wanted(name) and (case.name, name) not in kept}
    if not due:
        return
    own = case.mesh("lamina")
    if not os.path.exists(own):
        _lamina(program, case.cloud, own, [])
    size = runs.ask(program, "measure", own)
    resolution = peers.grid_resolution(size["triangles"], size)
    cloud = models.with_normals(case.cloud, os.path.join(case.folder, "with_normals.ply"))
    for name, peer in due.items():
        yield _row(case, program, name, True, lambda mesh: peer(cloud, mesh, True, resolution))


def _lamina(program, cloud, mesh, options):
    cost = runs.surface(program, cloud, mesh, options)
    del cost["stats"]
    return cost


def _row(case, program, name, is_peer, run):
    print(f"  {name}", flush=True)
    row, mesh = {"scene": case.name, "name": name, "peer": is_peer}, case.mesh(name)
    if os.path.exists(mesh):
        os.remove(mesh)
    try:
        row["cost"] = run(mesh)
        if not os.path.exists(mesh):
            raise runs.RunFailed("no mesh")
        return row | case.judge(program, mesh)
    except runs.RunFailed as reason:
        return {key: row[key] for key in ("scene", "name", "peer")} | {"failed": str(reason)}
