"""lamina.surface: arrays and files give the program's bytes, and nothing is copied."""
import pathlib

import lamina
import numpy as np
import pytest
from conftest import columns_of, read_ply, sphere, write_ply


def test_sphere_is_where_it_is(ball):
    mesh = lamina.surface(*ball)
    assert np.allclose(np.linalg.norm(mesh.vertices, axis=1), 1, atol=0.01)
    assert mesh.faces.max() == len(mesh.vertices) - 1
    corners = mesh.vertices[mesh.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("ij,ij->i", outward, corners[:, 0]) > 0).mean() > 0.999
    assert abs(np.linalg.norm(outward, axis=1).sum() / 2 - 4 * np.pi) < 0.05


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_arrays_are_the_program(tmp_path, program, dtype):
    points, normals = sphere(20_000)
    points, normals = points.astype(dtype), normals.astype(np.float32)
    colour = (127.5 * (points + 1)).astype(np.uint8)
    height = points[:, 2].astype(np.float64)
    named = columns_of(points, normals, red=colour[:, 0], green=colour[:, 1], blue=colour[:, 2], height=height)
    write_ply(tmp_path / "cloud.ply", named)
    program("surface", tmp_path / "cloud.ply", "-o", tmp_path / "program.ply", "--blend", "1.5")
    program("surface", tmp_path / "cloud.ply", "-o", tmp_path / "program.obj", "--blend", "1.5")
    attributes = {"colors": colour, "height": height}
    mesh = lamina.surface(points, normals, attributes=attributes, blend=1.5)
    mesh.save(tmp_path / "saved.ply")
    mesh.save(tmp_path / "saved.obj")
    lamina.surface_to_file(points, tmp_path / "streamed.ply", normals, attributes=attributes, blend=1.5)
    lamina.surface(tmp_path / "cloud.ply", blend=1.5).save(tmp_path / "from_file.ply")
    expected = (tmp_path / "program.ply").read_bytes()
    for name in ("saved.ply", "streamed.ply", "from_file.ply"):
        assert (tmp_path / name).read_bytes() == expected, name
    assert (tmp_path / "saved.obj").read_bytes() == (tmp_path / "program.obj").read_bytes()
    written = read_ply(tmp_path / "program.ply")
    assert (mesh.vertices == np.stack([written[c] for c in "xyz"], -1)).all()
    assert mesh.attributes["height"].dtype == np.float64
    assert (mesh.attributes["height"] == written["height"]).all()
    assert mesh.colors.dtype == np.uint8
    assert (mesh.colors[:, 1] == written["green"]).all()


def test_the_demo_scan_with_every_choice_left_to_the_program(tmp_path, program, source):
    scan = source / "data" / "amphora_scan.ply"
    program("surface", scan, "-o", tmp_path / "program.ply", "--every", "4")
    columns = read_ply(scan)
    points = np.stack([columns[c] for c in "xyz"], -1)
    normals = np.stack([columns["n" + c] for c in "xyz"], -1)
    attributes = {name: columns[name] for name in ("red", "green", "blue", "confidence")}
    mesh = lamina.surface(points, normals, attributes=attributes, every=4)
    mesh.save(tmp_path / "saved.ply")
    assert (tmp_path / "saved.ply").read_bytes() == (tmp_path / "program.ply").read_bytes()


def test_normals_are_found(tmp_path, program, ball):
    points, _ = ball
    write_ply(tmp_path / "bare.ply", {name: points[:, i] for i, name in enumerate("xyz")})
    program("surface", tmp_path / "bare.ply", "-o", tmp_path / "program.ply")
    lamina.surface(points).save(tmp_path / "saved.ply")
    assert (tmp_path / "saved.ply").read_bytes() == (tmp_path / "program.ply").read_bytes()


def test_any_layout_is_read_where_it_lies(tmp_path, ball):
    points, normals = ball
    lamina.surface(points, normals, raw=True).save(tmp_path / "c.ply")
    rows = np.zeros((len(points), 8), np.float32)
    rows[:, 1:4], rows[:, 4:7] = points, normals
    lamina.surface(rows[:, 1:4], rows[:, 4:7], raw=True).save(tmp_path / "strided.ply")
    lamina.surface(np.asfortranarray(points), np.asfortranarray(normals), raw=True).save(tmp_path / "fortran.ply")
    backwards = points[::-1].copy()[::-1]
    assert backwards.strides[0] < 0
    lamina.surface(backwards, normals, raw=True).save(tmp_path / "backwards.ply")
    for name in ("strided.ply", "fortran.ply", "backwards.ply"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "c.ply").read_bytes(), name


def test_radius_is_an_array_or_a_number(tmp_path, ball):
    points, normals = ball
    lamina.surface(points, normals, 0.06, raw=True).save(tmp_path / "number.ply")
    lamina.surface(points, normals, np.full(len(points), 0.06), raw=True).save(tmp_path / "array.ply")
    assert (tmp_path / "number.ply").read_bytes() == (tmp_path / "array.ply").read_bytes()


def test_paths_of_every_kind(tmp_path, ball):
    points, normals = ball
    for name, part in (("a.ply", slice(0, 9000)), ("b.ply", slice(9000, None))):
        write_ply(tmp_path / name, columns_of(points[part], normals[part]))
    whole = lamina.surface(points, normals, raw=True)
    for paths in ([tmp_path / "a.ply", str(tmp_path / "b.ply")], str(tmp_path), str(tmp_path / "?.ply")):
        mesh = lamina.surface(paths, raw=True)
        assert (mesh.vertices == whole.vertices).all()
        assert (mesh.faces == whole.faces).all()
    assert isinstance(tmp_path, pathlib.Path)


def test_arrays_own_the_memory_of_the_mesh(ball, address):
    mesh = lamina.surface(*ball, attributes={"height": ball[0][:, 2]}, raw=True)
    arrays = [mesh.vertices, mesh.faces, mesh.normals, mesh.attributes["height"]]
    again = [mesh.vertices, mesh.faces, mesh.normals, mesh.attributes["height"]]
    for first, second in zip(arrays, again):
        assert address(first) == address(second)
        assert first.flags.writeable and first.flags.c_contiguous
    kept = arrays[0].copy()
    del mesh, again
    assert (arrays[0] == kept).all()
    arrays[0][0] = 5
    assert arrays[0][0, 0] == 5


def test_changes_in_place_are_saved(tmp_path, ball):
    mesh = lamina.surface(*ball, raw=True)
    mesh.vertices[:] += 1e6
    mesh.save(tmp_path / "far.ply")
    assert (lamina.Mesh.from_file(tmp_path / "far.ply").vertices == mesh.vertices).all()


def test_statistics_and_plan(ball):
    stats = lamina.surface(*ball).stats
    assert stats["samples"] == len(ball[0]) and stats["triangles"] > 0
    told = lamina.plan(*ball)
    assert told["dry_run"] and told["vertices"] == 0 and told["expected_memory_bytes"] > 0


def test_where_selects_by_attribute(ball):
    points, normals = ball
    upper = lamina.surface(points, normals, attributes={"side": (points[:, 2] > 0).astype(np.uint8)},
                           where=["side>0", "z<0.5"], raw=True)
    assert upper.vertices[:, 2].min() > -0.1 and upper.vertices[:, 2].max() < 0.6


def test_from_file_and_back(tmp_path):
    mesh = lamina.Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], np.array([[0, 1, 2]]),
                       attributes={"colors": np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], np.uint8)})
    mesh.save(tmp_path / "one.ply")
    back = lamina.Mesh.from_file(tmp_path / "one.ply")
    assert (back.vertices == mesh.vertices).all() and (back.faces == [[0, 1, 2]]).all()
    assert (back.colors == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]).all() and back.colors.dtype == np.uint8
    assert back.normals is None and repr(back) == "<lamina.Mesh: 3 vertices, 1 faces>"
