"""The other functions: what they give is true, and is the program's."""
import json

import lamina
import numpy as np
import pytest
from conftest import columns_of, read_ply, sphere, write_ply


@pytest.fixture(scope="module")
def mesh():
    points, normals = sphere(20_000)
    colour = (127.5 * (points + 1)).astype(np.uint8)
    return lamina.surface(points, normals, attributes={"colors": colour, "height": points[:, 2].astype(np.float32)})


def test_normals_face_outwards_and_are_the_programs(tmp_path, program, ball):
    points, truth = ball
    found = lamina.normals(points)
    assert found.shape == points.shape and found.dtype == np.float32
    assert np.einsum("ij,ij->i", found, truth).min() > 0.98
    write_ply(tmp_path / "bare.ply", {name: points[:, i] for i, name in enumerate("xyz")})
    program("normal", tmp_path / "bare.ply", "-o", tmp_path / "found.ply")
    written = read_ply(tmp_path / "found.ply")
    assert (found == np.stack([written[c] for c in ("nx", "ny", "nz")], -1)).all()
    turned = lamina.normals(points, truth * np.random.default_rng(1).choice([-1, 1], (len(points), 1)), reorient=True)
    assert np.allclose(turned, truth, atol=1e-5)
    assert (lamina.normals(tmp_path / "bare.ply") == found).all()


def test_rows_of_bad_points_stay_empty(ball):
    points = ball[0].copy()
    points[[3, 77]] = np.nan
    found = lamina.normals(points)
    assert len(found) == len(points) and (found[[3, 77]] == 0).all() and (found[4:77] != 0).any(axis=1).all()
    radii = lamina.radii(points)
    assert (radii[[3, 77]] == 0).all() and (np.delete(radii, [3, 77]) > 0).all()
    stays = lamina.clean(points, merge=0)
    assert not stays[[3, 77]].any() and stays.sum() == len(points) - 2


def test_radii_are_the_programs(tmp_path, program, ball):
    points, _ = ball
    write_ply(tmp_path / "bare.ply", {name: points[:, i] for i, name in enumerate("xyz")})
    program("radius", tmp_path / "bare.ply", "-o", tmp_path / "found.ply", "--particlescale", 2)
    assert (lamina.radii(points, particlescale=2) == read_ply(tmp_path / "found.ply")["radius"]).all()


def test_clean_tells_who_stays(ball):
    points, normals = ball
    far = np.array([[3, 0, 0], [0, -4, 0]], np.float32)
    cloud = np.concatenate([points, far, points[:10]])
    stays = lamina.clean(cloud, merge=0, outliers=3)
    assert stays.dtype == bool and stays.shape == (len(cloud),)
    assert not stays[len(points) :].any() and stays[: len(points)].mean() > 0.98
    half = lamina.clean(points, normals, clip=[-2, -2, 0, 2, 2, 2])
    assert (half == (points[:, 2] >= 0)).all()
    assert (np.flatnonzero(lamina.clean(points, every=3)) == np.arange(0, len(points), 3)).all()


def test_check_measure_compare_are_the_programs(tmp_path, program, mesh):
    mesh.save(tmp_path / "mesh.ply")
    said = json.loads(program("check", tmp_path / "mesh.ply", "--json"))
    told = lamina.check(mesh)
    assert told == {name: value for name, value in said.items() if name != "mesh"} and told["closed"]
    said = json.loads(program("measure", tmp_path / "mesh.ply", "--json"))
    told = lamina.measure(mesh)
    assert told == {name: value for name, value in said.items() if name != "mesh"}
    assert abs(told["volume"] - 4 / 3 * np.pi) < 0.02
    coarse = lamina.simplify(mesh, ratio=0.25)
    coarse.save(tmp_path / "coarse.ply")
    told = lamina.compare(coarse, mesh, count=5000)
    said = json.loads(program("compare", tmp_path / "coarse.ply", tmp_path / "mesh.ply", "--count", 5000, "--json"))
    assert told["a_to_b"] == said["a_to_b"] and told["b_to_a"]["max"] < 0.02
    assert lamina.compare(tmp_path / "coarse.ply", str(tmp_path / "mesh.ply"), count=5000) == told
    with pytest.raises(lamina.Error) as caught:
        lamina.check(lamina.Mesh(mesh.vertices, mesh.faces[1:]), expect="closed")
    assert caught.value.exit_code == 6
    with pytest.raises(lamina.Error) as caught:
        lamina.measure(lamina.Mesh(mesh.vertices, np.zeros((0, 3), int)))
    assert caught.value.exit_code == 3


def test_simplify_is_the_programs(tmp_path, program, mesh):
    mesh.save(tmp_path / "mesh.ply")
    program("simplify", tmp_path / "mesh.ply", "--ratio", "0.25", "-o", tmp_path / "program.ply")
    before = mesh.vertices.copy()
    coarse = lamina.simplify(mesh, ratio=0.25)
    same = lamina.Mesh.from_file(tmp_path / "program.ply")
    assert (coarse.vertices == same.vertices).all() and (coarse.faces == same.faces).all()
    assert (coarse.normals == same.normals).all()
    assert (mesh.vertices == before).all() and len(coarse.faces) <= 0.25 * len(mesh.faces)
    with pytest.raises(lamina.Error) as caught:
        lamina.simplify(mesh)
    assert caught.value.exit_code == 2


def test_render_is_the_programs(tmp_path, program, mesh):
    mesh.save(tmp_path / "mesh.ply")
    program("render", tmp_path / "mesh.ply", "-o", tmp_path / "program.png", "--size", "160x120", "--view", "10,-5")
    picture = lamina.render(mesh, size=(160, 120), view=[10, -5])
    assert picture.shape == (120, 160, 3) and picture.dtype == np.uint8
    lamina.save_png(tmp_path / "mine.png", picture)
    assert (tmp_path / "mine.png").read_bytes() == (tmp_path / "program.png").read_bytes()
    assert (lamina.render(tmp_path / "mesh.ply", size="160x120", view="10,-5") == picture).all()
    assert (lamina.render(mesh, size=(160, 120), paint="height") != picture).any()
    cloud = lamina.render(np.asarray(mesh.vertices), size=(80, 80))
    assert cloud.shape == (80, 80, 3) and cloud.std() > 5
    with pytest.raises(lamina.Error) as caught:
        lamina.render(mesh, size=(0, 5))
    assert caught.value.exit_code == 2


def test_volume_and_voxels(tmp_path, program, mesh):
    mesh.save(tmp_path / "mesh.ply")
    program("volume", tmp_path / "mesh.ply", "-o", tmp_path / "program.vdb", "--voxelsize", "0.1")
    written = lamina.volume(mesh, tmp_path / "mine.vdb", voxelsize=0.1)
    assert (tmp_path / "mine.vdb").read_bytes() == (tmp_path / "program.vdb").read_bytes()
    block = lamina.voxels(mesh, voxelsize=0.1)
    assert block.edge == pytest.approx(0.1) and block.values.dtype == np.float32
    at = np.stack(np.meshgrid(*(o + block.edge * np.arange(n) for o, n in zip(block.origin, block.values.shape)),
                              indexing="ij"), -1)
    truth = np.linalg.norm(at, axis=-1) - 1
    near = np.abs(truth) < 0.25
    assert np.allclose(block.values[near], truth[near], atol=0.01)
    assert (block.values[truth < -0.35] < 0).all()
    sparse = lamina.voxels(tmp_path / "mine.vdb", sparse=True)
    assert len(sparse.values) == written["voxels"] and sparse.indices.dtype == np.int32
    places = np.asarray(sparse.origin) + sparse.edge * sparse.indices
    assert np.allclose(sparse.values, np.linalg.norm(places, axis=1) - 1, atol=0.01)
    with pytest.raises(lamina.Error) as caught:
        lamina.voxels(tmp_path / "missing.vdb")
    assert caught.value.exit_code == 3


def test_stream_is_surface(tmp_path, ball):
    points, normals = ball
    height = points[:, 2].astype(np.float64)
    whole = lamina.surface(points, normals, attributes={"height": height}, blend=1.5)
    whole.save(tmp_path / "whole.ply")
    with lamina.Stream(blend=1.5) as stream:
        for part in np.array_split(np.arange(len(points)), 7):
            stream.add(points[part], normals[part], attributes={"height": height[part]})
        assert stream.points == len(points)
        mesh = stream.finish()
    mesh.save(tmp_path / "stream.ply")
    assert (tmp_path / "stream.ply").read_bytes() == (tmp_path / "whole.ply").read_bytes()


def test_slabs_are_the_mesh(ball):
    points, normals = ball
    whole = lamina.surface(points, normals, raw=True)
    with lamina.Stream(raw=True) as stream:
        stream.add(points, normals)
        assert stream.stats is None
        slabs = list(stream.slabs())
    assert len(slabs) > 3
    assert (np.concatenate([slab.vertices for slab in slabs]) == whole.vertices).all()
    assert (np.concatenate([slab.faces for slab in slabs]) == whole.faces).all()
    assert [slab.first_vertex for slab in slabs][:2] == [0, len(slabs[0].vertices)]
    assert stream.stats["vertices"] == len(whole.vertices)


def test_streams_end_early_and_refuse(ball):
    points, normals = ball
    with lamina.Stream() as stream:
        stream.add(points, normals)
        with pytest.raises(ValueError, match="same arrays"):
            stream.add(points)
        assert len(next(iter(stream.slabs())).vertices) > 0
        with pytest.raises(lamina.Error, match="finished"):
            stream.add(points, normals)
    with pytest.raises(lamina.Error) as caught:
        lamina.Stream().slabs()
    assert caught.value.exit_code == 5
    with lamina.Stream(progress=lambda *what: False) as stream:
        stream.add(*sphere(200_000))
        with pytest.raises(lamina.Error, match="cancelled"):
            stream.finish()
    assert columns_of(points, normals)
