"""The program `lamina`: found, given a job, watched and cancelled. Knows nothing of Blender."""

import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
import threading
from pathlib import Path

# How far a run is, as a whole, when a stage of it is done. Most of the time goes into the last.
STAGE_ENDS = {
    "survey": 0.05,
    "read": 0.15,
    "grid normals": 0.3,
    "normals": 0.4,
    "signs": 0.45,
    "sort": 0.5,
    "radii": 0.5,
    "surface": 0.95,
}
PROGRESS = re.compile(r"^lamina: (?P<stage>[a-z][a-z ]*?)  .*?(?P<percent>\d+) %")
SECONDS_TO_UNWIND = 10


class ProgramError(Exception):
    """What went wrong, in a line for the user."""


def find_program(preferred=""):
    """The program: the one preferred, one beside this file (bin/lamina), or one on the PATH."""
    if preferred:
        if os.access(preferred, os.X_OK) and os.path.isfile(preferred):
            return preferred
        raise ProgramError(f"{preferred} is no program; change the add-on's preferences")
    bundled = Path(__file__).parent / "bin" / ("lamina.exe" if os.name == "nt" else "lamina")
    if os.access(bundled, os.X_OK):
        return str(bundled)
    found = shutil.which("lamina")
    if not found:
        raise ProgramError("the program lamina is not on the PATH; name it in the add-on's preferences")
    return found


class Run:
    """A job in the background. `poll()` now and then tells how far it is; nothing here blocks but `cancel()`.

    `make_steps(folder)` returns the steps of the job; files that only this run needs go into the folder, which is gone
    after `close()`.
    """

    def __init__(self, program, make_steps):
        self.folder = tempfile.mkdtemp(prefix="lamina_")
        self.fraction = 0.0
        self.text = "starting"
        self.messages = []
        self._stage = (None, 0.0)
        job = Path(self.folder) / "job.json"
        try:
            job.write_text(json.dumps({"lamina_job": 1, "steps": make_steps(Path(self.folder))}, indent=2))
            self._process = subprocess.Popen(
                [program, "run", str(job)],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                text=True, encoding="utf-8", errors="replace",
            )  # fmt: skip
        except OSError as error:
            self.close()
            raise ProgramError(f"{program}: {error.strerror}") from error
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self):
        with self._process.stderr as lines:
            for line in lines:
                self._take(line.rstrip())

    def _take(self, line):
        progress = PROGRESS.match(line)
        if not progress:
            self.messages.append(line)
            return
        stage = progress["stage"]
        if self._stage[0] != stage:
            self._stage = (stage, self.fraction)
        begin = self._stage[1]
        end = max(STAGE_ENDS.get(stage, begin), begin)
        self.fraction = begin + (end - begin) * int(progress["percent"]) / 100
        self.text = f"{stage} {progress['percent']} %"

    def poll(self):
        """True when the program has ended well. Throws ProgramError where it has not."""
        code = self._process.poll()
        if code is None:
            return False
        self._reader.join()
        if code != 0:
            raise ProgramError(self.messages[-1] if self.messages else f"lamina ended with code {code}")
        self.fraction, self.text = 1.0, "done"
        return True

    def wait(self):
        """Until the program has ended, well or not."""
        self._process.wait()

    def cancel(self):
        """The program unwinds at SIGINT and takes its temporary files with it; what was there before stays."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM if os.name == "nt" else signal.SIGINT)
            try:
                self._process.wait(SECONDS_TO_UNWIND)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._reader.join()

    def close(self):
        """Removes what only this run needed."""
        shutil.rmtree(self.folder, ignore_errors=True)


def surface_steps(inputs, folder, options):
    """The steps from points to a mesh, in files of `folder` named by `result_files()`.

    Coordinates are written less a shift, which the statistics name: Blender computes in floats.
    """
    files = result_files(folder)
    surface = {
        "tool": "surface",
        "input": inputs,
        "output": [files["mesh"]],
        "local": True,
        "stats": files["stats"],
        "tmp-dir": str(folder),
    }
    for key in ("preset", "blend", "threads"):
        if options.get(key):
            surface[key] = options[key]
    steps = [surface]
    volume = options.get("volume_file")
    if volume and options.get("fog"):
        surface["vdb"] = files["level_set"]
        steps.append({"tool": "convert", "input": files["level_set"], "fog": True, "output": volume})
    elif volume:
        surface["vdb"] = volume
    if options.get("keep", 1) < 1:
        steps.append({"tool": "simplify", "input": files["mesh"], "ratio": options["keep"], "output": files["mesh"]})
    return steps


def result_files(folder):
    return {name: str(Path(folder) / file) for name, file in
            {"mesh": "mesh.ply", "stats": "stats.json", "level_set": "level_set.vdb"}.items()}  # fmt: skip


def shift_of(folder):
    """What was taken off the coordinates, as doubles."""
    return tuple(json.loads(Path(result_files(folder)["stats"]).read_text())["shift"])
