"""The house keeps its shape: folders at the root, one import name, small files, two commands."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "src" / "volery"
CODE_FOLDERS = sorted(path.parent.name for path in ROOT.glob("*/__init__.py"))
LONGEST_FILE = 500
LAYERS = {"docs", "end_to_end", "house", "rotations", "twin"}


def python_files() -> list[Path]:
    """Every Python file of the repository; the links in src/volery are not followed, so none counts twice."""
    folders = [ROOT / name for name in (*CODE_FOLDERS, "src", "tests", "benchmarks")]
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


@pytest.mark.parametrize("folder", [*CODE_FOLDERS, "scenarios"])
def test_folder_at_the_root_is_part_of_the_package(folder: str) -> None:
    """Each code folder, and the scenarios, is reached through a relative symlink in src/volery."""
    assert (PACKAGE / folder).is_symlink()
    assert (PACKAGE / folder).readlink() == Path("..", "..", folder)


def test_package_has_no_folder_or_link_of_its_own() -> None:
    """A folder made inside src/volery, or a link that leads nowhere, would escape the rules for the root."""
    inside = {path.name for path in PACKAGE.iterdir() if path.is_dir() or path.is_symlink()} - {"__pycache__"}
    assert inside == {*CODE_FOLDERS, "scenarios"}


def test_no_file_is_too_long() -> None:
    """A file of more than 500 lines probably holds two subjects: look at it again."""
    lengths = {str(path.relative_to(ROOT)): len(path.read_text("utf-8").splitlines()) for path in python_files()}
    assert {name: length for name, length in lengths.items() if length > LONGEST_FILE} == {}


def test_tests_mirror_the_folders_of_the_package() -> None:
    """Beside the layers that go across folders; the name of a test file stands once."""
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    folders = {path.parent.relative_to(ROOT / "tests") for path in files}
    assert {str(folder) for folder in folders if not (PACKAGE / folder).is_dir()} == LAYERS
    assert sorted({path.name for path in files}) == sorted(path.name for path in files)


@pytest.mark.parametrize("command", ["make demo", "make test"])
def test_readme_names_the_two_commands(command: str) -> None:
    """A newcomer finds both commands in the README."""
    assert command in (ROOT / "README.md").read_text("utf-8")
