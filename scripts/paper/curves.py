"""The curve that the size of cells was chosen from: error over the ratio of cell to influence radius, by model."""
import math
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from plotter import plotter, save  # noqa: E402  (in scripts)

UNIT = 1e5
DEFAULT = 0.9  # --cell, in R
PARTS = (("vertices", "o-", "#1f5fa8", "projection: vertices to truth"),
         ("to_truth", "s-", "#c06020", "with triangulation: mesh to truth"),
         ("from_truth", "^:", "#308040", "truth to mesh"))


def draw(results, folder, blend=1.2):
    """cell_error.png: a panel for each model; mean distances, which the few places that no lattice resolves hardly move."""
    plt = plotter()
    names = list(dict.fromkeys(c["model"] for c in results))
    figure, panels = plt.subplots(1, len(names), figsize=(3.2 * len(names), 3.6), squeeze=False)
    for axes, name in zip(panels[0], names):
        rows = [c for c in results if c["model"] == name and c["blend"] == blend]
        ratios = [c["cell"] for c in rows]
        for part, style, colour, label in PARTS:
            axes.plot(ratios, [c[part]["mean"] * UNIT for c in rows], style, color=colour, label=label, markersize=4)
        added = [math.sqrt(max(0, c["to_truth"]["mean"] ** 2 - c["vertices"]["mean"] ** 2)) * UNIT for c in rows]
        axes.plot(ratios, added, "--", color="#808080", label="what triangles add, squares apart")
        axes.axvline(DEFAULT, color="#808080", linewidth=0.8, alpha=0.6)
        axes.set_title(name, fontsize=10)
        axes.set_xlabel("largest cell, R")
        axes.set_ylim(bottom=0)
        axes.grid(True, alpha=0.25)
        share = axes.twinx()
        share.plot(ratios, [c["triangles"] / 1e6 for c in rows], "-", color="#000000", alpha=0.25, linewidth=1)
        share.set_ylim(bottom=0)
        share.set_ylabel("M triangles (grey)", fontsize=7)
        share.tick_params(labelsize=7)
    panels[0][0].set_ylabel("mean distance, 1e-5 of the diagonal")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.tight_layout(rect=(0, 0.07, 1, 1))
    figure.legend(handles, labels, ncols=4, fontsize=8, frameon=False, loc="lower center")
    save(plt, figure, folder, "cell_error")
