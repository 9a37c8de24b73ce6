"""Every snippet of docs/python.md runs, in order, in one namespace."""
import re

import lamina
import numpy as np
import pytest


def test_snippets(source, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (source / "docs" / "python.md").read_text(encoding="utf-8")
    snippets = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(snippets) > 5
    space = {}
    for number, snippet in enumerate(snippets, 1):
        exec(compile(snippet, f"snippet {number} of docs/python.md", "exec"), space)
    for name in ("egg.ply", "egg.png", "error.png", "egg.vdb"):
        assert (tmp_path / name).stat().st_size > 0


def test_everything_is_documented(source):
    page = (source / "docs" / "python.md").read_text(encoding="utf-8")
    for name in lamina.__all__:
        thing = getattr(lamina, name)
        if callable(thing):
            assert thing.__doc__, name
        if not name.startswith("_") and name[0].islower():
            assert name in page, name
    for line in ("blend : ", "close_holes : ", "threads : "):
        assert line in lamina.surface.__doc__


def test_stubs_are_made_of_the_module(source):
    import ast
    import os
    import subprocess
    import sys

    made = subprocess.run([sys.executable, source / "scripts" / "python-stubs"], capture_output=True, text=True,
                          check=True, env=os.environ).stdout
    kept = (source / "python" / "lamina" / "__init__.pyi").read_text(encoding="utf-8")
    assert kept == made, "PYTHONPATH=build/python scripts/python-stubs > python/lamina/__init__.pyi"
    names = {node.name for node in ast.parse(kept).body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    assert names >= {name for name in lamina.__all__ if not name.startswith("_")}


def test_keywords_are_the_programs_options(source, program):
    said = program("surface", "--help")
    options = set(re.findall(r"--([a-z][a-z0-9-]*)", said))
    page = (source / "docs" / "reference.md").read_text(encoding="utf-8")
    for function, keywords in lamina._lamina._keywords.items():
        for keyword, _ in keywords:
            assert "--" + keyword.replace("_", "-") in page, (function, keyword)
    mine = {keyword.replace("_", "-") for keyword, _ in lamina._lamina._keywords["surface"]}
    other = {"help", "output", "quiet", "stats", "preview", "chunk", "print-tasks", "json", "checkpoint", "resume", "dry-run",
             "tiles", "tiles-plain"}
    assert mine <= options
    assert {name for name in options if name in page} - mine - other <= _mentioned_only(options, mine)


def _mentioned_only(options, mine):
    """Options of other tools that a description mentions."""
    return {name for name in options - mine if name in {"store", "reorient", "grid", "paint", "print-job", "job"}}


def test_version_is_the_programs(program):
    assert program("--version").split()[-1] == lamina.__version__
    assert np.__version__ and pytest.__version__
