"""What the Blender add-on does without Blender: the program found, run, watched and cancelled; its meshes read.
Usage: program_test.py PROGRAM SCAN"""

import os
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).parents[2] / "integrations/blender"))

from lamina_surface import program  # noqa: E402

try:
    import numpy as np
    from lamina_surface import ply
except ImportError:
    np = None

PROGRAM, SCAN = (os.path.realpath(name) for name in sys.argv[1:3])


def settled(run, seconds=120):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if run.poll():
            return True
        time.sleep(0.05)
    return False


class Runs(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.volume = str(Path(self.folder.name) / "volume.vdb")

    def start(self, inputs, **options):
        return program.Run(PROGRAM, lambda folder: program.surface_steps(inputs, folder, options))

    def test_the_program_is_found(self):
        self.assertEqual(program.find_program(PROGRAM), PROGRAM)
        with self.assertRaises(program.ProgramError):
            program.find_program(self.volume)
        before = os.environ["PATH"]
        self.addCleanup(os.environ.__setitem__, "PATH", before)
        os.environ["PATH"] = self.folder.name
        with self.assertRaisesRegex(program.ProgramError, "not on the PATH"):
            program.find_program()
        os.symlink(PROGRAM, Path(self.folder.name) / "lamina")
        self.assertEqual(program.find_program(), str(Path(self.folder.name) / "lamina"))

    def test_a_run_leaves_its_results_and_cleans_up(self):
        run = self.start([SCAN], preset="object", volume_file=self.volume, fog=True, keep=0.5, threads=2)
        seen = 0
        while not run.poll():
            self.assertGreaterEqual(run.fraction, seen)
            seen = run.fraction
            time.sleep(0.02)
        self.assertEqual(run.fraction, 1)
        self.assertEqual(program.shift_of(run.folder), (0, 0, 1))
        self.assertTrue(Path(program.result_files(run.folder)["mesh"]).exists())
        self.assertTrue(Path(self.volume).exists())
        run.close()
        self.assertFalse(Path(run.folder).exists())

    def test_progress_is_read_from_what_the_program_says(self):
        run = self.start([SCAN])
        self.addCleanup(run.close)
        run.cancel()
        run.fraction, run._stage = 0, (None, 0)
        for line, fraction in (
            ("lamina: survey  200 k of 200 k samples  100 %  0.00 s", 0.05),
            ("lamina: read  100 k of 200 k samples  50 %  1 s left", 0.1),
            ("lamina: read  200 k of 200 k samples  100 %  1 s", 0.15),
            ("lamina: samples 199978, extent 1.327 x 1.036 x 1.526", 0.15),
            ("lamina: surface  62.5 k of 200 k samples  slab 17 of 41  50 %  2.56 s left", 0.55),
            ("lamina: surface  200 k of 200 k samples  slab 41 of 41  100 %  5 s", 0.95),
        ):
            run._take(line)
            self.assertAlmostEqual(run.fraction, fraction)

    def test_cancelling_leaves_nothing(self):
        def fine(folder):
            steps = program.surface_steps([SCAN], folder, {"volume_file": self.volume})
            return [{**steps[0], "cell": "0.4r"}]  # takes its time

        run = program.Run(PROGRAM, fine)
        while run.fraction <= 0.15:
            self.assertFalse(run.poll())
            time.sleep(0.02)
        run.cancel()
        self.assertEqual(os.listdir(self.folder.name), [])
        self.assertEqual(os.listdir(run.folder), ["job.json"])
        with self.assertRaisesRegex(program.ProgramError, "cancelled"):
            run.poll()
        run.close()
        self.assertFalse(Path(run.folder).exists())

    def test_what_goes_wrong_is_told(self):
        run = self.start([self.volume])
        with self.assertRaisesRegex(program.ProgramError, "volume.vdb is not there"):
            settled(run)
        run.close()

    @unittest.skipIf(np is None, "no NumPy here")
    def test_meshes_are_read(self):
        mesh_file = str(Path(self.folder.name) / "mesh.ply")
        subprocess.run([PROGRAM, "surface", SCAN, "-o", mesh_file, "-q"], check=True)
        mesh = ply.read_mesh(mesh_file)
        told = subprocess.run([PROGRAM, "info", mesh_file], check=True, capture_output=True, text=True).stdout
        self.assertIn(f"mesh of {len(mesh.vertices)} vertices, {len(mesh.triangles)} triangles", told)
        self.assertTrue(np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-3))
        self.assertTrue(0 < mesh.colours[:, :3].min() < mesh.colours[:, :3].max() <= 1)
        corners = mesh.vertices[mesh.triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.assertGreater(np.mean(np.einsum("ij,ij->i", across, mesh.normals[mesh.triangles[:, 0]]) > 0), 0.99)
        whole = Path(mesh_file).read_bytes()
        for broken in (whole[: len(whole) // 2], whole[:-1], whole[:50], b"", whole.replace(b"binary_little", b"ascii")):
            Path(mesh_file).write_bytes(broken)
            with self.assertRaises(ply.PlyError):
                ply.read_mesh(mesh_file)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
