"""Files are written whole or not at all."""

from __future__ import annotations

from pathlib import Path

import pytest

from volery.experiments.whole_files import whole_file, write_whole


def _fail_half_way(path: Path) -> None:
    with whole_file(path) as unfinished:
        unfinished.write_bytes(b"half")
        raise ZeroDivisionError


def test_a_file_that_fails_half_way_leaves_what_was_there(tmp_path: Path) -> None:
    """The old content stays until the new one is whole; nothing else is left in the folder."""
    path = tmp_path / "run.json"
    write_whole(path, "ä\n")
    with pytest.raises(ZeroDivisionError):
        _fail_half_way(path)
    assert path.read_bytes() == "ä\n".encode()
    write_whole(path, b"\x00\r\n")
    assert path.read_bytes() == b"\x00\r\n"
    assert list(tmp_path.iterdir()) == [path]
