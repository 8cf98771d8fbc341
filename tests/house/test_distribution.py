"""What is built holds what the checkout holds."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOT_SHIPPED = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist", "runs", "tests", "docs")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel made from the sdist made from a clean copy, as a release is, with what is installed and no network."""
    copy = tmp_path_factory.mktemp("source") / "volery"
    built = tmp_path_factory.mktemp("dist")
    shutil.copytree(ROOT, copy, symlinks=True, ignore=NOT_SHIPPED)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(built), str(copy)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    (path,) = built.glob("*.whl")
    return path


def test_wheel_holds_every_file_of_the_package(wheel: Path) -> None:
    """Through sdist and wheel, symlinks and data files included, nothing is lost and nothing generic is added."""
    source = ROOT / "src"
    folders = [source / "volery", *(path for path in (source / "volery").iterdir() if path.is_symlink())]
    files = (path for folder in folders for path in folder.rglob("*") if path.is_file())
    expected = {path.relative_to(source).as_posix() for path in files if "__pycache__" not in path.parts}
    shipped = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert shipped == expected


def test_wheel_declares_command_and_licence(wheel: Path) -> None:
    """Who installs the wheel gets the command `volery` and the text of the licence."""
    with zipfile.ZipFile(wheel) as archive:
        texts = {name.partition(".dist-info/")[2]: archive.read(name).decode() for name in archive.namelist()}
    assert "volery = volery.experiments.cli.app:main" in texts["entry_points.txt"]
    assert "Apache License" in texts["licenses/LICENSE"]
