"""Results of scripts/paper-tables as Markdown."""
import math

from paper import published

UNIT = 1e5  # distances are printed in 1e-5 of the diagonal


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" + "---:|" * (len(head) - 1)]
    return "\n".join(lines + ["| " + " | ".join(str(c) for c in row) + " |" for row in rows])


def two_sided(case):
    return math.sqrt((case["to_truth"] ** 2 + case["from_truth"] ** 2) / 2)


def cost_cells(cost):
    return [f"{cost['wall']:.1f}", f"{cost['cpu']:.1f}", f"{cost['memory'] / 1e6:.0f}"]


def quality_cells(q):
    return [f"{q['triangles'] / 1e3:.0f}", f"{q['to_truth'] * UNIT:.2f}", f"{q['from_truth'] * UNIT:.2f}",
            f"{q['max'] * UNIT:.0f}", "yes" if q["manifold"] else "no", q["holes"], q["main_boundary_edges"], q["components"]]


QUALITY = ["k triangles", "mesh to truth", "truth to mesh", "max", "manifold", "holes", "boundary edges, main part", "parts"]


def diffusion_and_clustering(results):
    """Table 1: each row's ratios are to the plain isosurface, ours and the paper's."""
    rows = []
    base = next(c for c in results if not c["diffuse"] and c["cluster"] == "none")
    base_paper = published.TABLE1[False, "none"]
    for c in results:
        theirs = published.TABLE1[c["diffuse"], c["cluster"]]
        cost, samples = c["cost"], c["cost"]["stats"]["samples"]
        rows.append(["yes" if c["diffuse"] else "no", c["cluster"], *cost_cells(cost), f"{c['edge'] * UNIT:.1f}",
                     f"{c['triangles'] / 1e3:.0f}", f"{cost['cpu'] / base['cost']['cpu']:.2f}",
                     f"{theirs[0] / base_paper[0]:.2f}", f"{c['triangles'] / base['triangles']:.2f}",
                     f"{theirs[2] / base_paper[2]:.2f}", f"{samples / cost['wall'] / 1e3:.0f}",
                     f"{published.TABLE1_SAMPLES / theirs[0] / 1e3:.0f}"])
    return table(["diffusion", "clustering", "s", "CPU s", "MB", "edge length", "k triangles", "time ratio", "paper",
                  "triangle ratio", "paper", "k samples/s", "paper"], rows)


def blending(results):
    """Table 2."""
    rows = []
    for c in results:
        theirs = published.TABLE2[c["blend"]]
        cost, samples = c["cost"], c["cost"]["stats"]["samples"]
        rows.append([c["blend"], *cost_cells(cost), f"{samples / cost['wall'] / 1e3:.0f}", f"{theirs[0]:.1f}",
                     f"{cost['memory'] / results[0]['cost']['memory']:.2f}", f"{theirs[1] / published.TABLE2[1][1]:.2f}"])
    return table(["H", "s", "CPU s", "MB", "k samples/s", "paper", "memory over H = 1", "paper"], rows)


def accuracy(results):
    """Table 3. The paper gives ratios to another method only, so both are shown over their own first row, too."""
    rows = []
    first = {(c["model"], c["noisy"]): two_sided(c) for c in results if c["name"] == "N = 1"}
    for c in results:
        case = c["model"], c["noisy"]
        theirs = published.TABLE3.get(c["name"], {}).get(c["model"])
        base = published.TABLE3["N = 1"].get(c["model"])
        paper = f"{theirs[c['noisy']] / base[c['noisy']]:.2f}" if theirs else "-"
        rows.append([c["model"], "noisy" if c["noisy"] else "clean", c["name"], f"{c['to_truth'] * UNIT:.2f}",
                     f"{c['from_truth'] * UNIT:.2f}", f"{two_sided(c) * UNIT:.2f}", f"{c['triangles'] / 1e3:.0f}",
                     f"{two_sided(c) / first[case]:.2f}" if case in first else "-", paper])
    return table(["model", "samples", "method", "mesh to truth", "truth to mesh", "both", "k triangles", "over N = 1",
                  "paper"], rows)


def against_peers(results):
    """One table per model and kind of samples; below it our figures over the best peer's of each column."""
    parts = []
    for model, noisy in dict.fromkeys((c["model"], c["noisy"]) for c in results):
        cases = [c for c in results if (c["model"], c["noisy"]) == (model, noisy)]
        cases.sort(key=lambda c: c["peer"])
        rows = [[c["name"], *(cost_cells(c["cost"]) + quality_cells(c) if "cost" in c else [c["failed"]] + ["-"] * 10)]
                for c in cases]
        parts.append(f"{model}, {'noisy' if noisy else 'clean'}:\n\n" + table(["", "s", "CPU s", "MB"] + QUALITY, rows)
                     + "\n\n" + _ratios(cases))
    return "\n\n".join(parts)


COMPARED = {"s": lambda c: c["cost"]["wall"], "CPU s": lambda c: c["cost"]["cpu"], "MB": lambda c: c["cost"]["memory"],
            "mesh to truth": lambda c: c["to_truth"], "truth to mesh": lambda c: c["from_truth"],
            "max": lambda c: c["max"]}


def _ratios(cases):
    peers = [c for c in cases if c["peer"] and "cost" in c]
    if not peers:
        return "No peer came to an end."
    best = {column: min(peers, key=of) for column, of in COMPARED.items()}
    rows = [["best peer", *(c["name"] for c in best.values())]]
    for c in cases:
        if not c["peer"]:
            rows.append([c["name"], *(f"{of(c) / of(best[column]):.2f}" for column, of in COMPARED.items())])
    return "Over the best peer of each column; below 1 the peer loses:\n\n" + table(["", *COMPARED], rows)


def cells(results):
    """Projection's error (that of vertices which chord compensation left alone) and the whole, in root mean squares and in means, which rare places hardly move."""
    rows = []
    for c in results:
        figures = [f"{c[of][kind] * UNIT:.2f}" for kind in ("rms", "mean") for of in ("vertices", "to_truth", "from_truth")]
        rows.append([c["model"], f"{c['blend']:g}", f"{c['cell']:g}", f"{c['cell'] * c['blend']:.2f}",
                     f"{c['triangles'] / 1e3:.0f}", *figures, c["open"]])
    return table(["model", "H", "cell, R", "cell, r", "k triangles", "RMS: vertices to truth", "mesh to truth", "truth to mesh",
                  "mean: vertices to truth", "mesh to truth", "truth to mesh", "boundary edges, main part"], rows)


def edges(results):
    rows = [[c["model"], c["name"], *(cost_cells(c["cost"]) + quality_cells(c) if "cost" in c else [c["failed"]] + ["-"] * 10)]
            for c in results]
    return table(["", "", "s", "CPU s", "MB"] + QUALITY, rows)


def fewer(results):
    return table(["", "", "s", "CPU s", "MB"] + QUALITY,
                 [[c["name"], c["wanted"], *(cost_cells(c["cost"]) + quality_cells(c) if "cost" in c else [c["failed"]] + ["-"] * 10)]
                  for c in results])


SHAPE = {"k triangles": lambda c: f"{c['triangles'] / 1e3:.0f}", "parts": lambda c: c["parts"], "loops": lambda c: c["loops"],
         "ragged": lambda c: f"{c['ragged']:.2f}", "turn": lambda c: f"{c['turn']:.0f}"}
SURVEY = {"CD": lambda c: f"{c['chamfer']:.1f}", "accuracy": lambda c: f"{c['accuracy']:.1f}",
          "completeness": lambda c: f"{c['completeness']:.1f}", "NC": lambda c: f"{c['normal_consistency']:.3f}"}
SCENE = {"error": lambda c: f"{c['error']:.3f}", "missing, %": lambda c: f"{100 * c['missing']:.2f}",
         "invented, %": lambda c: f"{100 * c['invented']:.1f}", "normals": lambda c: f"{c['normals']:.1f}",
         "flipped, %": lambda c: f"{100 * c['flipped']:.1f}", "folds, %": lambda c: f"{100 * c['folds']:.2f}"}


def scans(results):
    """The survey's benchmark; below each object what its authors' meshes have."""
    return _by_scene(results, SURVEY | SHAPE, lambda scene: [
        [scene, name, "-", "-", cd] + ["-"] * (len(SURVEY) + len(SHAPE) - 1) for name, cd in zip(
            ("screened Poisson of the survey", "best of the survey's methods"), published.SURVEY.get(scene, ()))])


def scenes(results):
    return _by_scene(results, SCENE | SHAPE, lambda scene: [])


def _by_scene(results, columns, more):
    rows = []
    for scene in dict.fromkeys(c["scene"] for c in results):
        for c in results:
            if c["scene"] == scene and "failed" in c:
                rows.append([scene, c["name"], c["failed"], "-"] + ["-"] * len(columns))
            elif c["scene"] == scene:
                cost = [f"{c['cost']['cpu']:.1f}", f"{c['cost']['memory'] / 1e6:.0f}"]
                rows.append([scene, c["name"], *cost, *(of(c) for of in columns.values())])
        rows += more(scene)
    return table(["", "", "CPU s", "MB", *columns], rows)
