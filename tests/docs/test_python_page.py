"""The example of docs/python.md, as a script and as a notebook."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbclient
import nbformat
import pytest

import volery

from .conftest import blocks

(EXAMPLE,) = blocks("python.md", "python")
SCRIPT = f"""{EXAMPLE}
twin = volery.run(ring, agents={{"kind": Averager, "rate": "10 Hz"}}, engine="twin", name="twin")
assert twin.samples().estimate.tobytes() == run.samples().estimate.tobytes()
for line in run.verify().lines:
    print(line)
"""


def test_the_example_is_short() -> None:
    """Agent, scenario, run and what it shows."""
    assert len(EXAMPLE.splitlines()) <= 40


def test_the_example_as_a_script(tmp_path: Path) -> None:
    """Over Zenoh and in the twin it is the same run; it is certified, and read where the script is not."""
    (tmp_path / "averager.py").write_text(SCRIPT, "utf-8")
    command = [sys.executable, "averager.py"]
    done = subprocess.run(command, cwd=tmp_path, env=surroundings(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    first, estimate, _folder, verdict = done.stdout.splitlines()
    assert first == "Run scenario: finished, zenoh lockstep, 8 agents, 5 s"
    assert estimate.startswith("Samples of 'number': 50 samples of 8 agents; ")
    assert verdict.startswith("certified: 400 estimates and 800 frame fates of 8 agents")
    assert volery.load(tmp_path / "runs" / "twin").samples().disagreement[-1] < 1.0


@pytest.mark.long
def test_the_example_as_a_notebook(tmp_path: Path) -> None:
    """The class of a cell runs over Zenoh; table and figures are shown, the data are in pandas and xarray."""
    *definitions, ring, run, _print = EXAMPLE.strip().rsplit("\n", 3)
    cells = [
        "\n".join(definitions),
        f"{ring}\n{run}\nrun",
        'run.plot("estimates")',
        "frame = run.samples().to_dataframe()\nframe[frame.agent == '3'].shape",
        "run.to_xarray().sizes.mapping",
        "again = await volery.run_async(ring, agents=Averager, engine='twin')\nagain.problems",
        "print(*run.verify().lines)",
        "print(run.folder)",
    ]
    shown = executed(cells, tmp_path)
    assert shown[1]["text/html"].startswith("<b>Run scenario: finished, zenoh lockstep, 8 agents, 5 s</b><table>")
    assert shown[2]["text/html"].startswith('<img src="data:image/png;base64,')
    assert shown[3]["text/plain"] == "(50, 6)"
    assert shown[4]["text/plain"] == "{'time': 50, 'agent': 8}"
    assert shown[5]["text/plain"] == "()"
    assert shown[6]["text"].startswith("certified: 400 estimates")
    folder = tmp_path / shown[7]["text"].strip()
    assert (folder / "sources" / "__main__.py").read_text("utf-8").rstrip() == cells[0].rstrip()


def executed(cells: list[str], folder: Path) -> list[Any]:
    """What each cell of a notebook shows last, by type, once it was run in a folder."""
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    client = nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": folder}})
    client.execute(env=surroundings())
    outputs = [cell.outputs[-1] if cell.outputs else {} for cell in notebook.cells]
    return [output.get("data", output) for output in outputs]


def surroundings() -> dict[str, str]:
    """The environment, in which this checkout is what is imported."""
    return {**os.environ, "PYTHONPATH": str(Path(volery.__file__).resolve().parents[1])}
