"""pip makes a wheel of a finished build and installs it in a fresh environment, module and program."""
import os
import subprocess
import sys
import venv

import pytest


@pytest.fixture(scope="module")
def environment(tmp_path_factory, source):
    pytest.importorskip("pip")
    build = os.path.dirname(os.environ["LAMINA_PROGRAM"])
    place = tmp_path_factory.mktemp("env")
    venv.create(place, system_site_packages=True, with_pip=False, symlinks=True)
    settings = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    settings["LAMINA_BUILD"] = build
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-cache-dir"]
    made = subprocess.run([*pip, "wheel", "--no-index", "--no-deps", "-w", place, source], env=settings,
                          capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr
    wheel = next(place.glob("lamina-*.whl"))
    done = subprocess.run([*pip, "--python", place / "bin" / "python", "install", "--no-index", wheel], env=settings,
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return place, settings


def test_module_and_program(environment):
    place, settings = environment
    code = "import lamina; print(lamina.__version__, lamina.__file__)"
    done = subprocess.run([place / "bin" / "python", "-c", code], env=settings, capture_output=True, text=True, cwd=place)
    version, file = done.stdout.split()
    assert file.startswith(str(place))
    said = subprocess.run([place / "bin" / "lamina", "--version"], env=settings, capture_output=True, text=True)
    assert said.stdout.split()[-1] == version
    assert list(place.glob("share/man/man1/lamina*.1"))
    assert list(place.glob("lib/python*/site-packages/lamina/py.typed"))
