"""Runs one file of the suite for ctest: 0 passed, 77 skipped (all of it, or something it wants is not installed).

Usage: run.py FILE. The environment says where things lie: PYTHONPATH the package lamina, LAMINA_PROGRAM, LAMINA_SOURCE.
"""
import importlib
import sys

SKIPPED = 77


class Count:
    """Which tests ran."""

    def __init__(self):
        self.passed = 0
        self.skipped = 0

    def pytest_runtest_logreport(self, report):
        self.passed += report.when == "call" and report.passed
        self.skipped += report.skipped


def main():
    for name in ("numpy", "pytest", "lamina"):
        try:
            importlib.import_module(name)
        except ModuleNotFoundError as error:
            print(f"skipped: {error}")
            return SKIPPED
    import pytest

    count = Count()
    status = pytest.main(["-q", "-rs", "-p", "no:cacheprovider", sys.argv[1]], plugins=[count])
    if status == pytest.ExitCode.NO_TESTS_COLLECTED or (status == 0 and count.passed == 0):
        return SKIPPED
    return int(status)


if __name__ == "__main__":
    sys.exit(main())
