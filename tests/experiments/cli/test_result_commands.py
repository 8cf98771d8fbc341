"""metrics, plot, export, verify, recover, and which run they mean."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.GifImagePlugin import GifImageFile

from .conftest import Volery


@pytest.mark.parametrize("name", ["short", "last", "runs/short"])
def test_a_run_is_a_name_a_path_or_last(volery: Volery, own_run: Path, name: str) -> None:
    """All three ways mean the same run."""
    assert own_run.is_dir()
    said = volery("metrics", name)
    assert said.code == 0
    assert "as asked: no late frame" in said.out


def test_last_is_the_run_that_began_last(volery: Volery, own_run: Path) -> None:
    """Not the one whose name comes last."""
    older = Path("runs/zzz")
    shutil.copytree(own_run, older)
    began = (own_run / "scenario.yaml").stat().st_mtime_ns
    os.utime(older / "scenario.yaml", ns=(began - 1, began - 1))
    assert volery("plot", "last", "links", "--format", "svg").out.strip() == "runs/short/figures/links.svg"


@pytest.mark.parametrize("command", ["metrics", "plot", "verify", "recover", "status", "watch", "stop"])
def test_a_run_that_does_not_exist(volery: Volery, own_run: Path, command: str) -> None:
    """Exit code 2, and the name that was probably meant."""
    assert own_run.is_dir()
    said = volery(command, "shirt")
    assert said.code == 2
    assert said.error.startswith("error: there is no run 'shirt' in runs (did you mean 'short'?)")


def test_no_run_at_all(volery: Volery) -> None:
    """Where there are no runs the message says how one is made."""
    said = volery("metrics", "last")
    assert said.code == 2
    assert "`volery run SCENARIO`" in said.error


def test_metrics_of_several_runs_as_json(volery: Volery, own_run: Path) -> None:
    """One JSON object, with the metrics of each run under the name of its folder, the same as in its metrics.json."""
    shutil.copytree(own_run, "runs/other")
    (own_run / "metrics.json").unlink()
    found = json.loads(volery("metrics", "short", "other", "--json").out)
    assert list(found) == ["short", "other"]
    assert found["short"] == json.loads((own_run / "metrics.json").read_text("utf-8")) == found["other"]


def test_metrics_with_a_threshold(volery: Volery, own_run: Path) -> None:
    """A run converges sooner to a wider threshold, and never to 0."""
    assert own_run.is_dir()

    def converged(threshold: str) -> float | None:
        found = json.loads(volery("metrics", "last", "--json", "--threshold", threshold).out)
        time_s: float | None = found["short"]["quantities"]["estimate"]["truth_error"]["convergence_s"]
        return time_s

    assert converged("100") is not None
    assert converged("0") is None


def test_plot_prints_the_paths_of_what_it_drew(volery: Volery, own_run: Path) -> None:
    """Only the figures asked for, in the formats and the folder asked for."""
    assert own_run.is_dir()
    said = volery("plot", "last", "links", "disagreement", "--format", "svg", "--out", "here")
    assert said.out.split() == ["here/links.svg", "here/disagreement.svg"]
    assert {str(path) for path in Path("here").iterdir()} == set(said.out.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["pie"], "figure 'pie' is not known: one of estimates, disagreement, links, age, overview"),
        (["links", "--format", "docx"], "figure format 'docx' is not known"),
        (["estimates", "--quantity", "speed"], "nobody reported 'speed'"),
    ],
    ids=["figure", "format", "quantity"],
)
def test_plot_of_what_there_is_not(volery: Volery, own_run: Path, words: list[str], message: str) -> None:
    """Exit code 2, and what there is."""
    assert own_run.is_dir()
    said = volery("plot", "last", *words)
    assert said.code == 2
    assert message in said.error


def test_film_and_stills(volery: Volery, own_run: Path) -> None:
    """A film of the run says how far it is at each tenth, and ends with its path; stills are pictures of instants."""
    assert own_run.is_dir()
    said = volery("plot", "last", "--animate", "--format", "gif", "--out", "here")
    *lines, path = said.out.splitlines()
    assert lines == [f"film: {done} of 11 pictures" for done in range(2, 12)]
    assert path == "here/animation.gif"
    with Image.open(path) as film:
        assert isinstance(film, GifImageFile)
        assert film.n_frames > 1
    said = volery("plot", "last", "--still", "0.4 s", "--still", "0.6s", "--format", "png", "--out", "here")
    assert said.out.split() == ["here/still-0.4s.png", "here/still-0.6s.png"]
    assert Path("here/still-0.4s.png").read_bytes() != Path("here/still-0.6s.png").read_bytes()


def test_space_time_diagram(volery: Volery, own_run: Path) -> None:
    """Alone, or with the figures that are named; of a window and some agents if these are given."""
    assert own_run.is_dir()
    window = ("--from", "0.25s", "--until", "0.35 s", "--agents", "1,2")
    said = volery("plot", "last", "--space-time", *window, "--format", "svg", "--out", "here")
    assert said.out.split() == ["here/space-time.svg"]
    said = volery("plot", "last", "age", "--space-time", "--format", "svg", "--out", "here")
    assert said.out.split() == ["here/space-time.svg", "here/age.svg"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--from", "0.2 s"], "--from and --until are of the diagram and of the film: add --space-time or --animate"),
        (["--agents", "1"], "--agents is of the space-time diagram: add --space-time"),
        (["--speed", "2"], "--fps and --speed are of the film: add --animate"),
        (["--animate", "--fps", "0"], "pictures per second is 0, it must be above 0"),
        (["--animate", "--fps", "9000"], "9,001 pictures, more than 3,000: film a part with --from and --until"),
        (["--animate", "--format", "gif", "--format", "mp4"], "a film is made in one of them at a time"),
        (["--animate", "--still", "0 s", "--format", "gif"], "--format gif is for the film alone"),
        (["--still", "2 s"], "a still at 2 s: the run ends at 1 s"),
        (["--still", "soon"], "--still: 'soon' is not a quantity"),
        (["--space-time", "--agents", "1,7"], "--agents 7: there is none"),
        (["--space-time", "--until", "0 s"], "--until 0 s is not after --from 0 s"),
        (["--space-time", "--format", "docx"], "figure format 'docx' is not known"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_diagrams_and_films_of_what_there_is_not(volery: Volery, own_run: Path, words: list[str], message: str) -> None:
    """Exit code 2, the value and the remedy."""
    assert own_run.is_dir()
    said = volery("plot", "last", *words)
    assert said.code == 2
    assert message in said.error


def test_export_writes_every_format_asked_for(volery: Volery, own_run: Path) -> None:
    """CSV and npz of one run tell of the same number of frames."""
    said = volery("export", "last", "--csv", "--npz")
    assert said.code == 0
    names = ["estimates.csv", "frames.csv", "run.npz"]
    assert said.out.split() == [str(own_run / "export" / name) for name in names]
    frames = len((own_run / "export/frames.csv").read_text("utf-8").splitlines()) - 1
    with np.load(own_run / "export/run.npz") as arrays:
        assert len(arrays["frames.fate"]) == frames > 0
    assert volery("export", "last").code == 2


def test_verify_certifies_a_run_of_the_twin(volery: Volery, own_run: Path) -> None:
    """The twin equals itself, bit for bit."""
    assert own_run.is_dir()
    said = volery("verify", "last")
    assert said.code == 0
    assert said.out.startswith("certified: ")


def test_verify_ends_with_3_where_the_run_departs(volery: Volery, own_run: Path) -> None:
    """Replayed with another seed than it was recorded with, a run is not certified."""
    plan = own_run / "plan.json"
    plan.write_text(plan.read_text("utf-8").replace('"seed": 3', '"seed": 4'), "utf-8")
    said = volery("verify", "last")
    assert said.code == 3
    assert said.out.startswith("not certified: ")


def test_a_damaged_record_is_recovered(volery: Volery, own_run: Path) -> None:
    """A record that was cut off is refused with the remedy, and after that remedy it is evaluated and measured."""
    record = own_run / "record.mcap"
    record.write_bytes(record.read_bytes()[: record.stat().st_size * 3 // 4])
    said = volery("metrics", "last")
    assert said.code == 2
    assert "`volery recover runs/short`" in said.error
    assert volery("recover", "last").code == 0
    assert "this run is not evaluated" in volery("metrics", "last").out
    assert volery("evaluate", "last").code == 0
    assert "not evaluated" not in volery("metrics", "last").out


def test_a_record_that_never_was_one(volery: Volery, own_run: Path) -> None:
    """Nothing can be recovered of another file."""
    (own_run / "record.mcap").write_text("hello", "utf-8")
    said = volery("recover", "last")
    assert said.code == 2
    assert "is no record" in said.error


@pytest.mark.parametrize("command", ["metrics", "plot", "verify", "recover"])
def test_results_of_a_run_that_is_not_over(volery: Volery, own_run: Path, command: str) -> None:
    """Above all, the record of a run that is being written is not mended."""
    info = own_run / "run.json"
    running = {**json.loads(info.read_text("utf-8")), "status": "running", "pid": os.getpid()}
    info.write_text(json.dumps(running), "utf-8")
    said = volery(command, "last")
    assert said.code == 2
    assert said.error.startswith("error: runs/short still runs")
