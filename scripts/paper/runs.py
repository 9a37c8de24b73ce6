"""Runs a program, takes its time and memory, and judges the mesh it made."""
import json
import os
import signal
import subprocess
import time

TIME_LIMIT = 1800  # seconds a peer may take


def run(command, environment=None, limit=TIME_LIMIT):
    """Wall and CPU seconds and peak bytes of a command and what it starts; None when it failed or took too long."""
    begin = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
                               env={**os.environ, **(environment or {})}, errors="replace")
    watchdog = _Watchdog(process, limit)
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    watchdog.stop()
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        print(f"paper-tables: {command[0]}: exit code {process.returncode}: {errors.strip()[-300:]}")
        return None
    return {"wall": time.monotonic() - begin, "cpu": usage.ru_utime + usage.ru_stime, "memory": usage.ru_maxrss * 1024}


class _Watchdog:
    """Kills the whole group of a process that takes too long."""

    def __init__(self, process, limit):
        import threading
        self.timer = threading.Timer(limit, lambda: os.killpg(process.pid, signal.SIGKILL))
        self.timer.start()

    def stop(self):
        self.timer.cancel()


def surface(program, cloud, mesh, options):
    """A run of lamina surface: `run` with the counts of --stats."""
    stats = mesh + ".json"
    cost = run([program, "surface", cloud, "-o", mesh, "--quiet", "--stats", stats, *options])
    if cost is None:
        return None
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
    distance = ask(program, "compare", mesh, true_mesh)
    check = ask(program, "check", mesh)
    measure = ask(program, "measure", mesh)
    return {"to_truth": distance["a_to_b"]["relative"]["rms"], "from_truth": distance["b_to_a"]["relative"]["rms"],
            "max": max(distance[way]["relative"]["max"] for way in ("a_to_b", "b_to_a")),
            "triangles": check["triangles"], "manifold": check["manifold"], "components": check["components"],
            "holes": check["boundary_loops"], "boundary_edges": check["boundary_edges"],
            "main_boundary_edges": check["largest_component_boundary_edges"],
            "edge": measure["edge_length"]["mean"] / distance["diagonal"]}
