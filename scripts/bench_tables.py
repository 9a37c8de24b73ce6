"""Results of scripts/bench as Markdown tables."""
import statistics

# Slowest over fastest run of the same case, by wall clock, that a machine left alone stays below.
QUIET_SPREAD = 1.1

BEGIN, END = "<!-- figures of scripts/bench: begin -->", "<!-- figures of scripts/bench: end -->"


def table(head, rows):
    """A Markdown table, first column to the left, figures to the right, padded to be read as text too."""
    cells = [head] + rows
    widths = [max(len(r[k]) for r in cells) for k in range(len(head))]
    line = lambda r: "| " + " | ".join(  # noqa: E731
        c.ljust(w) if k == 0 else c.rjust(w) for k, (c, w) in enumerate(zip(r, widths))) + " |"
    rule = "|" + "|".join("-" * (w + 2) if k == 0 else "-" * (w + 1) + ":" for k, w in enumerate(widths)) + "|"
    return "\n".join([line(head), rule] + [line(r) for r in rows])


def figures(record):
    m = record["median"]
    n = m["samples"]
    return [record["case"], f"{n * 1e-6:.2f}", f"{n / m['wall_seconds'] * 1e-6:.2f}", f"{n / m['cpu_seconds'] * 1e-6:.2f}",
            f"{m['wall_seconds']:.2f}", f"{m['wall_spread']:.2f}", f"{m['peak_memory_bytes'] * 1e-6:.0f}",
            f"{m['expected_memory_bytes'] * 1e-6:.0f}", f"{m['temporary_disk_bytes'] / n:.1f}",
            f"{m['corners'] / n:.2f}", f"{m['triangles'] / n:.2f}"]


def stage_names(results):
    names = []
    for record in results["cases"]:
        names += [s for s in record["median"]["stage_cpu"] if s not in names]
    return names


def stage_row(record, names):
    m = record["median"]
    per_sample = [m["stage_cpu"].get(s, 0) / m["samples"] * 1e9 for s in names]
    total = m["cpu_seconds"] / m["samples"] * 1e9
    return [record["case"]] + [f"{ns:.0f}" for ns in per_sample + [total - sum(per_sample), total]]


def tables(results):
    """Both tables with a line about where and when."""
    head = ["case", "M samples", "M/s wall", "M/s CPU", "s", "spread", "MB", "MB expected", "disk B/sample",
            "corners/sample", "triangles/sample"]
    names = stage_names(results)
    rows, stages = [], []
    for record in results["cases"]:
        rows.append(figures(record))
        stages.append(stage_row(record, names))
    where = f"{results['date']}, {results['version']}, {results['machine']}; medians of {results['repeat']} runs."
    if statistics.median(r["median"]["wall_spread"] for r in results["cases"]) > QUIET_SPREAD:
        where += " The machine had other work meanwhile: wall clock figures are too slow, CPU figures hold."
    return "\n\n".join([
        where,
        table(head, rows), "CPU nanoseconds per sample and stage:", table(["case"] + names + ["other", "all"], stages)])


def ratios(results):
    """Old over new: above 1 the new program is faster or smaller."""
    names = stage_names(results)
    rows = []
    for record in results["cases"]:
        new, old = record["median"], record["old"]
        quotient = lambda a, b: f"{a / b:.2f}" if b > 1e-4 else "-"  # noqa: E731
        rows.append([record["case"], quotient(old["wall_seconds"], new["wall_seconds"]),
                     quotient(old["cpu_seconds"], new["cpu_seconds"]),
                     quotient(old["peak_memory_bytes"], new["peak_memory_bytes"]),
                     quotient(old["temporary_disk_bytes"], new["temporary_disk_bytes"]),
                     "same" if record["same_mesh"] else "differs"]
                    + [quotient(old["stage_cpu"].get(s, 0), new["stage_cpu"].get(s, 0)) for s in names])
    return "old / new; stages by CPU time\n\n" + table(["case", "wall", "CPU", "memory", "disk", "mesh"] + names, rows)


def check_markers(path):
    """Ends the program unless the file has both markers: asked before measuring, not after."""
    with open(path) as f:
        whole = f.read()
    if whole.count(BEGIN) != 1 or whole.count(END) != 1 or whole.index(BEGIN) > whole.index(END):
        raise SystemExit(f"bench: {path}: wants the lines '{BEGIN}' and '{END}', once each")
    return whole


def write_between_markers(path, text):
    before, rest = check_markers(path).split(BEGIN)
    with open(path, "w") as f:
        f.write(before + BEGIN + "\n\n" + text + "\n\n" + END + rest.split(END)[1])
