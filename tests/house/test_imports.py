"""Who imports whom: no file of the package imports, over however many steps, a file that imports it."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import networkx as nx

PACKAGE = Path(__file__).parents[2] / "src" / "volery"
FILES = {
    ".".join(("volery", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): path
    for folder in (PACKAGE, *filter(Path.is_dir, PACKAGE.iterdir()))
    for path in (folder.glob("*.py") if folder == PACKAGE else folder.rglob("*.py"))
}
"""Module → its file; the folders of the package are links, which `rglob` alone does not follow."""


def imported(module: str) -> Iterator[str]:
    """Modules of the package that a file imports anywhere, blocks for type checkers and functions included."""
    package = module if FILES[module].name == "__init__.py" else module.rpartition(".")[0]
    for node in ast.walk(ast.parse(FILES[module].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            above = package.split(".")[: len(package.split(".")) - node.level + 1]
            base = ".".join((*above, *filter(None, [node.module])))
            names = [f"{base}.{alias.name}" for alias in node.names]
            yield from (name if name in FILES else base for name in names)


def test_imports_have_no_circle() -> None:
    """Whoever reads a file can read first what it imports, and so on, and come to an end."""
    assert len(FILES) > 100
    graph = nx.DiGraph((module, other) for module in FILES for other in imported(module) if other != module)
    circles = [circle for circle in nx.strongly_connected_components(graph) if len(circle) > 1]
    assert [sorted(circle) for circle in circles] == []


def test_base_names_do_not_repeat() -> None:
    """A file is known by its name alone, whatever folder it is in."""
    counts = Counter(path.name for path in FILES.values() if path.name != "__init__.py")
    assert [name for name, count in counts.items() if count > 1] == []
