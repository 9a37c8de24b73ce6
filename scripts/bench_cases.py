"""Which clouds scripts/bench makes and which runs it measures on them."""
import collections
import gzip
import os
import shutil
import subprocess

MILLION = 1_000_000

# A cloud is made once by `lamina scatter` and kept in the work folder under its name.
Cloud = collections.namedtuple("Cloud", "shape count colour")
# One measured run; cases of several groups that are the same run are measured once.
# `raw`: with --raw, which chooses nothing, so that a case differs from the others by its options alone.
Case = collections.namedtuple("Case", "group name cloud options threads raw")

DRAGON = "dragon_vrip.ply.gz"


def cases(size, threads, large, data):
    """All cases; `size` multiplies every count, for trials; `data` is the folder of real scans, where there is one."""

    def cloud(shape, millions, colour=False):
        return Cloud(shape, max(1000, int(millions * MILLION * size)), colour)

    middle = cloud("bumpy-sphere", 4)
    coloured = cloud("bumpy-sphere", 4, colour=True)
    scan = "dragon" if os.path.exists(os.path.join(data, DRAGON)) else "statue"
    out = []

    def add(group, name, where, *options, on=threads, raw=True):
        out.append(Case(group, name, where, options, on, raw))

    for millions in (1, 4):
        add("default", f"{scan} {millions} M, no option", cloud(scan, millions), raw=False)
    for millions in (1, 4):
        add("model", f"{scan} {millions} M", cloud(scan, millions))
    for millions in (1, 4, 16) + ((100,) if large else ()):
        add("scale", f"bumpy sphere {millions} M", cloud("bumpy-sphere", millions))
    # The goals that were set for the program are for H = 1.
    add("goal", f"{scan} 4 M, H = 1", cloud(scan, 4), "--blend", "1")
    add("goal", "bumpy sphere 16 M, H = 1", cloud("bumpy-sphere", 16), "--blend", "1")
    add("goal", f"{scan} 4 M, H = 1, --steps 4", cloud(scan, 4), "--blend", "1", "--steps", "4")
    for blend in (1, 1.2, 2, 4, 8):
        add("blend", f"--blend {blend}", cloud("bumpy-sphere", 10), *option("--blend", blend, 1.2))
    for steps in (1, 4):
        add("steps", f"--steps {steps}", middle, *option("--steps", steps, 1))
    for fit in ("sphere", "plane"):
        add("fit", f"--fit {fit}", middle, *option("--fit", fit, "sphere"))
    add("fit", "--diffuse", middle, "--diffuse")
    for mode in ("none", "free", "preserving"):
        add("cluster", f"--cluster {mode}", middle, *option("--cluster", mode, "preserving"))
    add("colour", "without colours", middle)
    add("colour", "with colours", coloured)
    for n in (1, 2):
        add("threads", f"--threads {n}", middle, on=n)
    return out


def option(name, value, default):
    """The option as words; nothing for a default, so that equal runs are recognised."""
    return () if value == default else (name, str(value))


def make_cloud(cloud, program, folder, data):
    """The cloud's file, made unless it is there."""
    path = os.path.join(folder, f"{cloud.shape}_{cloud.count}{'_colour' if cloud.colour else ''}.ply")
    if os.path.exists(path):
        return path
    if cloud.shape == "dragon":
        mesh = os.path.join(folder, "dragon.ply")
        if not os.path.exists(mesh):
            with gzip.open(os.path.join(data, DRAGON), "rb") as packed, open(mesh + ".part", "wb") as plain:
                shutil.copyfileobj(packed, plain)
            os.rename(mesh + ".part", mesh)
        what = [mesh]
    else:
        what = ["--shape", cloud.shape] + (["--colour"] if cloud.colour else [])
    # scatter writes beside its output and renames: an interrupted cloud leaves nothing under this name.
    subprocess.run([program, "scatter", *what, "--count", str(cloud.count), "--quiet", "-o", path], check=True)
    return path
