"""All tiles of a folder as one mesh, however many they are: neither points nor mesh are held in memory.

Usage: las_tiles.py FOLDER MESH.ply
"""
import logging
import sys

import lamina

logging.basicConfig(level=logging.INFO, format="%(message)s")  # what the program says


def progress(stage, done, left):
    print(f"{stage}: {100 * done:.0f} %" + ("" if left is None else f", {left:.0f} s left"), file=sys.stderr)


tiles = sys.argv[1] + "/*.la[sz]"
plan = lamina.plan(tiles, preset="aerial")
memory = plan["expected_memory_bytes"] / 1e6
print(f"{plan['samples']} points, about {plan['expected_seconds']:.0f} s and {memory:.0f} MB")
stats = lamina.surface_to_file(tiles, sys.argv[2], preset="aerial", progress=progress)
print(stats["vertices"], "vertices,", stats["triangles"], "triangles")
