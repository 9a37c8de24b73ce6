"""What is refused, how, and how a run is stopped."""
import logging
import os
import signal
import subprocess
import sys
import threading
import time

import lamina
import numpy as np
import pytest
from conftest import sphere


@pytest.mark.parametrize(
    "points, words",
    [
        (np.zeros((9, 3), int), "dtype int64"),
        (np.zeros((9, 3), ">f8"), "dtype >f8"),
        (np.zeros((9, 3), np.float16), "dtype float16"),
        (np.zeros((9, 3), complex), "dtype complex128"),
        ("text\0".encode(), "dtype"),
    ],
)
def test_other_types_of_points(points, words):
    with pytest.raises(TypeError, match=words):
        lamina.surface(points)


@pytest.mark.parametrize("shape", [(9,), (9, 2), (9, 4), (3, 3, 3), ()])
def test_other_shapes_of_points(shape):
    with pytest.raises(ValueError, match="points has shape"):
        lamina.surface(np.zeros(shape))


def test_other_lengths_and_types_beside_points():
    points = np.zeros((9, 3))
    with pytest.raises(ValueError, match="normals has 8 rows, points has 9"):
        lamina.surface(points, np.zeros((8, 3)))
    with pytest.raises(ValueError, match="radius has shape"):
        lamina.surface(points, radius=np.zeros((9, 1)))
    with pytest.raises(ValueError, match="has 3 rows"):
        lamina.surface(points, attributes={"a": np.zeros(3)})
    with pytest.raises(TypeError, match="int64.*astype"):
        lamina.surface(points, attributes={"a": np.zeros(9, int)})
    with pytest.raises(ValueError, match="a name of its own"):
        lamina.surface(points, attributes={"a": np.zeros((9, 3))})
    with pytest.raises(lamina.Error, match="twice"):
        lamina.surface(points, attributes={"x": np.zeros(9)})
    with pytest.raises(ValueError, match="files have their own"):
        lamina.surface("cloud.ply", points)


def test_keywords():
    points, normals = sphere(100)
    with pytest.raises(TypeError, match="unexpected keyword argument 'blnd'; did you mean 'blend'"):
        lamina.surface(points, normals, blnd=2)
    with pytest.raises(TypeError, match="output"):
        lamina.surface(points, normals, output="a.ply")
    with pytest.raises(TypeError, match="True or False"):
        lamina.surface(points, normals, raw=1)
    for keywords in ({"blend": -1}, {"blend": "wide"}, {"cluster": "all"}, {"threads": -3}):
        with pytest.raises(lamina.Error) as caught:
            lamina.surface(points, normals, **keywords)
        assert caught.value.exit_code == 2
        assert "--" + next(iter(keywords)) in str(caught.value)


def test_exit_codes_are_the_programs(tmp_path, program):
    missing = tmp_path / "missing.ply"
    with pytest.raises(lamina.Error) as caught:
        lamina.surface(missing)
    assert caught.value.exit_code == 3
    assert program("surface", missing, "-o", tmp_path / "m.ply", code=3).strip() == f"lamina: {caught.value}"
    with pytest.raises(lamina.Error) as caught:
        lamina.surface(np.zeros((0, 3)))
    assert caught.value.exit_code in (3, 5)
    with pytest.raises(lamina.Error) as caught:
        lamina.surface(np.full((50, 3), np.nan), np.ones((50, 3)))
    assert caught.value.exit_code == 5
    points, normals = sphere(5000)
    with pytest.raises(lamina.Error) as caught:
        lamina.surface_to_file(points, tmp_path / "no" / "folder.ply", normals)
    assert caught.value.exit_code == 4
    with pytest.raises(lamina.Error) as caught:
        lamina.surface(points, normals, max_memory="1M")
    assert caught.value.exit_code == 4
    assert isinstance(caught.value, RuntimeError)


def test_progress_is_told_and_may_cancel(ball):
    told = []
    lamina.surface(*ball, progress=lambda *what: told.append(what))
    assert told
    for stage, done, left in told:
        assert stage and 0 <= done <= 1 and (left is None or left >= 0)
    with pytest.raises(lamina.Error, match="cancelled") as caught:
        lamina.surface(*sphere(300_000), progress=lambda *what: False)
    assert caught.value.exit_code == 1


def test_what_progress_raises_comes_out():
    def fail(*what):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        lamina.surface(*sphere(100_000), progress=fail)
    with pytest.raises(TypeError, match="callable"):
        lamina.surface(*sphere(100), progress=3)


def test_a_cancelled_run_leaves_nothing(tmp_path):
    with pytest.raises(lamina.Error):
        lamina.surface_to_file(*_swap(sphere(300_000), tmp_path / "mesh.ply"), progress=lambda *what: False)
    assert list(tmp_path.iterdir()) == []


def _swap(cloud, path):
    return cloud[0], path, cloud[1]


INTERRUPTED = """
import sys, lamina, numpy as np
directions = np.random.default_rng(1).normal(size=(1_000_000, 3))
directions /= np.linalg.norm(directions, axis=1)[:, None]
print("ready", flush=True)
try:
    lamina.surface(directions, directions, progress=lambda *w: print("on", flush=True))
except KeyboardInterrupt:
    sys.exit(42)
"""


def test_interrupts_end_a_run():
    run = subprocess.Popen([sys.executable, "-c", INTERRUPTED], stdout=subprocess.PIPE, text=True, env=os.environ)
    assert run.stdout.readline() == "ready\n"
    assert run.stdout.readline() == "on\n"
    run.send_signal(signal.SIGINT)
    run.stdout.read()
    assert run.wait(timeout=60) == 42


def test_other_threads_run_meanwhile(ball):
    expected = lamina.surface(*ball, raw=True)
    meshes, ticks, stop = [], [], threading.Event()

    def tick():
        while not stop.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    ticker = threading.Thread(target=tick)
    runs = [threading.Thread(target=lambda: meshes.append(lamina.surface(*ball, raw=True))) for _ in range(3)]
    ticker.start()
    for run in runs:
        run.start()
    for run in runs:
        run.join()
    stop.set()
    ticker.join()
    assert len(meshes) == 3 and len(ticks) > 3
    for mesh in meshes:
        assert (mesh.vertices == expected.vertices).all() and (mesh.faces == expected.faces).all()


def test_threads_do_not_change_the_mesh(ball):
    one, two = lamina.surface(*ball, threads=1), lamina.surface(*ball, threads=2)
    assert (one.vertices == two.vertices).all() and (one.faces == two.faces).all()


def test_messages_go_to_the_logger(ball, caplog):
    with caplog.at_level(logging.INFO, "lamina"):
        lamina.surface(*ball)
    assert any("samples" in record.message for record in caplog.records)


def test_faces_must_name_vertices():
    with pytest.raises(ValueError, match="face 0 names vertex 7, there are 3"):
        lamina.Mesh(np.zeros((3, 3)), [[0, 1, 7]])
    with pytest.raises(ValueError, match="negative"):
        lamina.Mesh(np.zeros((3, 3)), [[0, 1, -1]])
    with pytest.raises(TypeError, match="integers"):
        lamina.Mesh(np.zeros((3, 3)), [[0, 1, 2.0]])
    with pytest.raises(ValueError, match="2 normals for 3 vertices"):
        lamina.Mesh(np.zeros((3, 3)), [[0, 1, 2]], np.zeros((2, 3)))
    with pytest.raises(lamina.Error) as caught:
        lamina.Mesh.from_file("nowhere.ply")
    assert caught.value.exit_code == 3
