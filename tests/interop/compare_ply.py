"""Two PLY meshes, one written by Lamina and one by another program from it: the same vertices, normals, colours and
triangles, in the same order. Usage: compare_ply.py OURS THEIRS"""
import struct
import sys

CODES = {"char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H",
         "uint16": "H", "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f",
         "double": "d", "float64": "d"}


def read(path):
    """Vertex columns by name, and the number of faces."""
    with open(path, "rb") as file:
        assert file.readline().strip() == b"ply"
        assert file.readline().split()[1] == b"binary_little_endian", path
        names, codes, element, counts = [], "<", "", {}
        while (words := file.readline().decode().split()) != ["end_header"]:
            if words[0] == "element":
                element = words[1]
                counts[element] = int(words[2])
            elif words[0] == "property" and element == "vertex":
                names.append(words[2])
                codes += CODES[words[1]]
        rows = struct.iter_unpack(codes, file.read(counts["vertex"] * struct.calcsize(codes)))
        return dict(zip(names, zip(*rows))), counts["face"]


ours, our_faces = read(sys.argv[1])
theirs, their_faces = read(sys.argv[2])
assert our_faces == their_faces, (our_faces, their_faces)
for name, most in [*((n, 1e-6) for n in ("x", "y", "z", "nx", "ny", "nz")),
                   *((n, 0) for n in ("red", "green", "blue"))]:
    assert name in theirs, (name, sorted(theirs))
    worst = max(abs(a - b) for a, b in zip(ours[name], theirs[name], strict=True))
    assert worst <= most, (name, worst)
print(f"interop: {len(ours['x'])} vertices, {our_faces} triangles, normals and colours unchanged")
