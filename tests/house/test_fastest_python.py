"""Which interpreter `make` takes: the first on the path, unless another one of its version is much faster."""

from __future__ import annotations

import os
import runpy
import shutil
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / ".ci" / "fastest_python.py"
VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"


@pytest.mark.parametrize(
    ("others", "taken"),
    [("echo 0.9", "python3"), ("echo 0.5", f"python{VERSION}"), ("exit 1", "python3")],
    ids=["little gain", "much faster", "makes no environments"],
)
def test_the_fastest_is_taken(
    others: str, taken: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Interpreters that say how long they took, first on the path."""
    for name, body in (("python3", "echo 1.0"), (f"python{VERSION}", others)):
        (tmp_path / name).write_text(f"#!/bin/sh\n{body}\n", "utf-8")
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(shutil, "which", lambda name, which=shutil.which: None if "/" in name else which(name))
    runpy.run_path(str(SCRIPT), run_name="__main__")
    said = capsys.readouterr()
    assert said.out == f"{tmp_path / taken}\n"
    assert said.err.startswith(f"Python {VERSION}, {tmp_path / taken}")
