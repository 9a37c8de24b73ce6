"""Error against triangles, of the dragon's clean samples: meshes simplified, and meshes of uniform cells."""
import os
import shutil
import sys

from paper import peers, runs

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from plotter import plotter, save  # noqa: E402  (in scripts)

UNIT = 1e5
MODEL = "dragon"
UNIFORM, FLAT, OURS, ASKED = "uniform cells", "thinned out where flat", "simplified", "as many as asked for"
FINE, MESHLAB = "cells of 0.6 r, simplified", "simplified by MeshLab"
STYLES = {UNIFORM: ("o--", "#808080"), FLAT: ("D-", "#803080"), OURS: ("s-", "#1f5fa8"), FINE: ("^-", "#308040"),
          ASKED: ("*", "#b02050"), MESHLAB: ("x:", "#c06020")}
NAMES = tuple(STYLES)
CELLS = ("0.9r", "1.15r", "1.5r", "2r", "2.7r", "3.6r")
DEVIATIONS = ("default", "0.02", "0.03", "0.05", "0.1")
COUNTS = (850_000, 500_000, 300_000, 200_000, 100_000, 50_000)
FINE_COUNTS = (1_300_000, *COUNTS)
ASKED_COUNTS = (1_300_000, 850_000, 650_000)  # fewer leave cells as they are
KEEP = ["--prune", "0"]  # the truth has small parts
ALL = [*KEEP, "--deviation", "0"]  # with all triangles


def measured(program, cloud, truth, folder, limit, wanted):
    """Rows; `wanted`: is a name?"""
    mesh, fewer = os.path.join(folder, "mesh.ply"), os.path.join(folder, "fewer.ply")
    for cell in CELLS if wanted(UNIFORM) else ():
        cost = runs.surface(program, cloud, mesh, [*ALL, "--cell", cell])
        yield {"name": UNIFORM, "wanted": cell, "cost": cost} | runs.judge(program, mesh, truth)
    for deviation in DEVIATIONS if wanted(FLAT) else ():
        options = KEEP if deviation == "default" else [*KEEP, "--deviation", deviation]
        cost = runs.surface(program, cloud, mesh, options)
        yield {"name": FLAT, "wanted": deviation, "cost": cost} | runs.judge(program, mesh, truth)
    for count in ASKED_COUNTS if wanted(ASKED) else ():
        cost = runs.surface(program, cloud, mesh, [*KEEP, "--triangles", str(count)])
        yield {"name": ASKED, "wanted": count, "cost": cost} | runs.judge(program, mesh, truth)
    meshlab = shutil.which("meshlabserver") and shutil.which("xvfb-run")
    for name, options in ((OURS, []), (MESHLAB, []), (FINE, ["--cell", "0.6r"])):
        if not wanted(name) or (name == MESHLAB and not meshlab):
            continue
        runs.surface(program, cloud, mesh, [*ALL, *options])
        for count in FINE_COUNTS if name == FINE else COUNTS:
            print(f"  {name}, {count}", flush=True)
            row = {"name": name, "wanted": count}
            try:
                if name == MESHLAB:
                    cost = peers.meshlab_decimation(folder, limit)(mesh, fewer, count)
                else:
                    cost = runs.run([program, "simplify", mesh, "-o", fewer, "--triangles", str(count), "--quiet"])
                yield row | {"cost": cost} | runs.judge(program, fewer, truth)
            except runs.RunFailed as reason:
                yield row | {"failed": str(reason)}


def draw(results, folder):
    """error_triangles.png: a panel for each direction."""
    plt = plotter()
    figure, panels = plt.subplots(1, 2, figsize=(9, 4), sharey=True, constrained_layout=True)
    for axes, way, title in zip(panels, ("to_truth", "from_truth"), ("mesh to truth", "truth to mesh")):
        for name, (style, colour) in STYLES.items():
            rows = sorted((c for c in results if c["name"] == name and "cost" in c), key=lambda c: c["triangles"])
            axes.loglog([c["triangles"] for c in rows], [c[way] * UNIT for c in rows], style, color=colour, label=name,
                        markersize=5)
        ticks = [5e4, 1e5, 2e5, 5e5, 1e6]
        axes.set_xticks(ticks, ["50 k", "100 k", "200 k", "500 k", "1 M"])
        axes.set_yticks([2, 3, 5, 10, 20], ["2", "3", "5", "10", "20"])
        axes.minorticks_off()
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("triangles")
        axes.grid(True, which="both", alpha=0.25)
    panels[0].set_ylabel("root mean square distance, 1e-5 of the diagonal")
    panels[1].legend(frameon=False, fontsize=9)
    save(plt, figure, folder, "error_triangles")
