"""Runs a program, takes its time and memory, and judges the mesh it made."""
import json
import os
import signal
import subprocess
import threading
import time


class RunFailed(Exception):
    """Why a program gave no result, in a few words for a table."""


def run(command, environment=None, limit=None):
    """Wall and CPU seconds and peak bytes of a command and what it starts. RunFailed when it fails or takes more seconds
    than the limit."""
    begin = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
                               env={**os.environ, **(environment or {})}, errors="replace")
    watchdog = _Watchdog(process, limit)
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    watchdog.stop()
    process.returncode = os.waitstatus_to_exitcode(status)
    if watchdog.bit:
        raise RunFailed(f"more than {limit}")
    if process.returncode != 0:
        print(f"paper-tables: {command[0]}: exit code {process.returncode}: {errors.strip()[-300:]}")
        raise RunFailed("failed")
    return {"wall": time.monotonic() - begin, "cpu": usage.ru_utime + usage.ru_stime, "memory": usage.ru_maxrss * 1024}


class _Watchdog:
    """Kills the whole group of a process that takes too long; `bit` tells whether it had to."""

    def __init__(self, process, limit):
        self.process, self.bit = process, False
        self.timer = threading.Timer(limit, self._bite) if limit else None
        if self.timer:
            self.timer.start()

    def _bite(self):
        self.bit = True
        os.killpg(self.process.pid, signal.SIGKILL)

    def stop(self):
        if self.timer:
            self.timer.cancel()


def surface(program, cloud, mesh, options):
    """A run of lamina surface: `run` with the counts of --stats."""
    stats = mesh + ".json"
    cost = run([program, "surface", cloud, "-o", mesh, "--quiet", "--stats", stats, *options])
    with open(stats) as f:
        cost["stats"] = json.load(f)
    os.remove(stats)
    return cost


def ask(program, *words):
    """What a tool prints as JSON; the exit code does not matter, a mesh may be as bad as it likes."""
    printed = subprocess.run([program, *words, "--json"], capture_output=True, text=True)
    return json.loads(printed.stdout)


def distances(program, mesh, true_mesh, *words):
    """Root mean squares and means over the diagonal of the truth."""
    sides = ask(program, "compare", mesh, true_mesh, *words)
    return {to: {kind: sides[of]["relative"][kind] for kind in ("rms", "mean")}
            for to, of in (("to_truth", "a_to_b"), ("from_truth", "b_to_a"))}


def judge(program, mesh, true_mesh):
    """Distances over the diagonal of the truth, both ways, and what kind of mesh it is."""
    if not os.path.exists(mesh):
        raise RunFailed("no mesh")
    check = ask(program, "check", mesh)
    if check["non_finite_vertices"] > 0:  # some programs leave a few
        finite = mesh + ".finite.ply"
        subprocess.run([program, "convert", mesh, "-o", finite, "--quiet"], check=True)
        os.replace(finite, mesh)
    distance = ask(program, "compare", mesh, true_mesh)
    measure = ask(program, "measure", mesh)
    return {"to_truth": distance["a_to_b"]["relative"]["rms"], "from_truth": distance["b_to_a"]["relative"]["rms"],
            "max": max(distance[way]["relative"]["max"] for way in ("a_to_b", "b_to_a")),
            "triangles": check["triangles"], "manifold": check["manifold"], "components": check["components"],
            "holes": check["boundary_loops"], "boundary_edges": check["boundary_edges"],
            "main_boundary_edges": check["largest_component_boundary_edges"],
            "edge": measure["edge_length"]["mean"] / distance["diagonal"]}
