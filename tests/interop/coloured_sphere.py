"""Writes oriented points of the unit sphere as PLY, coloured by their position. Usage: coloured_sphere.py OUT.ply"""
import math
import sys

COUNT = 40000
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))

with open(sys.argv[1], "w", encoding="ascii") as out:
    out.write(f"ply\nformat ascii 1.0\nelement vertex {COUNT}\n")
    for name in ("x", "y", "z", "nx", "ny", "nz", "radius"):
        out.write(f"property float {name}\n")
    for name in ("red", "green", "blue"):
        out.write(f"property uchar {name}\n")
    out.write("end_header\n")
    for i in range(COUNT):
        z = 1 - (2 * i + 1) / COUNT
        level = math.sqrt(1 - z * z)
        x, y = level * math.cos(i * GOLDEN_ANGLE), level * math.sin(i * GOLDEN_ANGLE)
        red, green, blue = (round(127.5 * (1 + c)) for c in (x, y, z))
        out.write(f"{x:.7g} {y:.7g} {z:.7g} {x:.7g} {y:.7g} {z:.7g} 0.02 {red} {green} {blue}\n")
