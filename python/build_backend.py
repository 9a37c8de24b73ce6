"""Builds the wheel of lamina (PEP 517) with CMake: module, program and manual pages.

It wants Python's own library alone, so that `pip install .` needs no network. The compiled files are made in build-wheel/,
or taken from the folder of a finished build that the environment's LAMINA_BUILD names.
"""
import base64
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent


def version():
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    return re.search(r"project\(Lamina VERSION ([0-9.]+)", text).group(1)


def metadata():
    head = {
        "Metadata-Version": "2.1",
        "Name": "lamina",
        "Version": version(),
        "Summary": "Streaming surface reconstruction from oriented points",
        "License": "Apache-2.0",
        "Requires-Python": ">=3.9",
        "Requires-Dist": "numpy",
        "Description-Content-Type": "text/markdown",
    }
    lines = [f"{name}: {value}" for name, value in head.items()]
    return "\n".join(lines) + "\n\n" + (ROOT / "docs" / "python.md").read_text(encoding="utf-8")


def compiled():
    """The folder of a build that has the module and the program."""
    if os.environ.get("LAMINA_BUILD"):
        return pathlib.Path(os.environ["LAMINA_BUILD"]).resolve()
    build = ROOT / "build-wheel"
    configure = ["cmake", "-S", ROOT, "-B", build, "-DCMAKE_BUILD_TYPE=Release", "-DLAMINA_TESTS=OFF", "-DLAMINA_PYTHON=ON"]
    configure += [f"-DPython3_EXECUTABLE={sys.executable}"]
    if shutil.which("ninja"):
        configure += ["-G", "Ninja"]
    subprocess.run(configure, check=True)
    targets = ["lamina_python", "lamina_program"]
    subprocess.run(["cmake", "--build", build, "--parallel", "--target", *targets], check=True)
    return build


def digest(data):
    return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


class Wheel:
    """A wheel being written, with the record of its files."""

    def __init__(self, path, info):
        self.zip = zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED)
        self.info = info
        self.record = []

    def add(self, name, data, mode=0o644):
        entry = zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0))
        entry.external_attr = (0o100000 | mode) << 16
        entry.compress_type = zipfile.ZIP_DEFLATED
        self.zip.writestr(entry, data)
        self.record.append(f"{name},{digest(data)},{len(data)}")

    def close(self):
        name = f"{self.info}/RECORD"
        self.zip.writestr(name, "\n".join([*self.record, f"{name},,", ""]))
        self.zip.close()


def get_requires_for_build_wheel(config_settings=None):
    return []


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    build = compiled()
    modules = list((build / "python" / "lamina").glob("_lamina" + sysconfig.get_config_var("EXT_SUFFIX")))
    if not modules or not (build / "lamina").is_file():
        raise RuntimeError(f"{build}: has no module for this Python, or no program; is pybind11-dev installed?")
    platform = re.sub(r"[-.]", "_", sysconfig.get_platform())
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    name = f"lamina-{version()}"
    file = f"{name}-{python}-{python}-{platform}.whl"
    wheel = Wheel(pathlib.Path(wheel_directory) / file, f"{name}.dist-info")
    for source in sorted((ROOT / "python" / "lamina").iterdir()):
        if source.is_file():
            wheel.add(f"lamina/{source.name}", source.read_bytes())
    wheel.add(f"lamina/{modules[0].name}", modules[0].read_bytes(), 0o755)
    wheel.add(f"{name}.data/scripts/lamina", (build / "lamina").read_bytes(), 0o755)
    for page in sorted((build / "share" / "man").glob("*.1")):
        wheel.add(f"{name}.data/data/share/man/man1/{page.name}", page.read_bytes())
    wheel.add(f"{wheel.info}/LICENSE", (ROOT / "LICENSE").read_bytes())
    wheel.add(f"{wheel.info}/METADATA", metadata().encode())
    tags = f"Wheel-Version: 1.0\nGenerator: lamina\nRoot-Is-Purelib: false\nTag: {python}-{python}-{platform}\n"
    wheel.add(f"{wheel.info}/WHEEL", tags.encode())
    wheel.close()
    return file


def build_sdist(sdist_directory, config_settings=None):
    name = f"lamina-{version()}"
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    with tarfile.open(pathlib.Path(sdist_directory) / f"{name}.tar.gz", "w:gz") as archive:
        for file in files.split("\0"):
            if file:
                archive.add(ROOT / file, f"{name}/{file}")
    return f"{name}.tar.gz"
