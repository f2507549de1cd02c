"""What ProgressLine writes while estimators are fitted."""

import re
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from callback_recorder import Recorder
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import NNPOM, ProgressLine, _progress, make_haptic_pipeline
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.model_selection import cross_val_predict_proba

X, Y = np.arange(12.0)[:, None], np.arange(12) % 3
PIPELINE = make_pipeline(StandardScaler(), NNPOM(0))
SEARCH = GridSearchCV(PIPELINE, {"nnpom__alpha": [1, 10]}, cv=2)


@pytest.fixture(autouse=True)
def every_frame(monkeypatch):
    monkeypatch.setattr(_progress, "_PAUSE", 0)
    monkeypatch.setattr(_progress, "_is_file", lambda stream: False)
    monkeypatch.setenv("COLUMNS", "200")


@pytest.fixture
def frames(capsys):
    """Return what the line showed, one text per drawing."""

    def read():
        out, err = capsys.readouterr()
        assert out == "" and "\n" not in err
        drawn = [each for each in err.split("\r") if each.strip(" ")]
        assert re.search(r"\r *\r$", err)  # the line is empty in the end
        return drawn

    return read


def bars(frame):
    """Return the name, the number done and the number of tasks of each bar."""
    return [
        (name, int(done), int(total), bar)
        for name, bar, done, total in re.findall(r"(\S+) ([█░]+) (\d+)/(\d+)", frame)
    ]


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_one_bar_per_level_of_a_search(frames, n_jobs):
    line = ProgressLine(max_propagation_depth=1)
    search = clone(SEARCH).set_params(n_jobs=n_jobs).set_callbacks(line).fit(X, Y)
    seen = [bars(frame) for frame in frames()]
    for frame in seen:
        names = [name for name, *_ in frame]
        assert names == ["GridSearchCV", "search", "Pipeline"][: len(names)] or (
            names == ["GridSearchCV", "Pipeline"]  # of the best setting
        )
        for _, done, total, bar in frame:
            assert done <= total and bar.count("█") == 8 * done // total
    for name, total in (("GridSearchCV", 2), ("search", 4)):
        done = [d for frame in seen for n, d, t, _ in frame if (n, t) == (name, total)]
        assert sorted(done) == done and max(done) == total
    plain = clone(SEARCH).fit(X, Y)
    np.testing.assert_array_equal(plain.predict_proba(X), search.predict_proba(X))


def test_by_default_the_outermost_level_alone(frames):
    clone(SEARCH).set_callbacks(ProgressLine()).fit(X, Y)
    seen = [bars(frame) for frame in frames()]
    assert {name for frame in seen for name, *_ in frame} == {"GridSearchCV", "search"}


def test_a_whole_model(frames):
    """Without a warning that a ColumnTransformer hands no callbacks on."""
    corpus = make_haptic_corpus(4, 1, sensors=["tdc"], random_state=0)
    model = make_haptic_pipeline(["tdc"], random_state=0).set_callbacks(ProgressLine())
    model.fit(corpus.trials, corpus.ratings["hard"])
    seen = [bars(frame) for frame in frames()]
    assert {name for frame in seen for name, *_ in frame} == {"Pipeline"}


def test_deeper_levels_count_iterations(frames):
    recorder = Recorder()
    network = NNPOM(2, max_iter=40, random_state=0)
    model = make_pipeline(StandardScaler(), network)
    model.set_callbacks(ProgressLine(max_propagation_depth=2), recorder).fit(X, Y)
    seen = [bars(frame) for frame in frames()]
    n_iterations = sum(task.startswith("iteration") for task in recorder.tasks)
    iterations = [f[-1] for f in seen if f and f[-1][0] == "NNPOM"]
    assert max(done for _, done, _, _ in iterations) == n_iterations > 1
    assert {total for _, _, total, _ in iterations} == {40}


def test_fits_of_a_cross_validation_are_counted(frames):
    model = clone(PIPELINE).set_callbacks(ProgressLine(3))
    cross_val_predict_proba(model, X, Y, cv=3)
    seen = [bars(frame)[0] for frame in frames()]
    assert [name for name, *_ in seen] == ["fits"] * len(seen)
    assert list(dict.fromkeys(done for _, done, _, _ in seen)) == [0, 1, 2]


def test_an_error_leaves_no_line_behind(frames):
    model = clone(PIPELINE).set_callbacks(ProgressLine())
    with pytest.raises(ValueError, match="NaN"):
        model.fit(np.where(X == 3, np.nan, X), Y)
    assert frames()
    model.fit(X, Y)  # and the callback can be used again
    assert frames()


def test_a_narrow_terminal_and_few_drawings(frames, monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    line = ProgressLine(max_propagation_depth=1)
    clone(SEARCH).set_callbacks(line).fit(X, Y)
    assert max(map(len, frames())) == 29
    monkeypatch.setattr(_progress, "_PAUSE", 1000)
    clone(SEARCH).set_callbacks(ProgressLine()).fit(X, Y)
    assert len(frames()) == 1


def test_a_file_gets_few_whole_lines(tmp_path, monkeypatch):
    monkeypatch.undo()
    monkeypatch.setattr(_progress._Line, "drawn", time.monotonic())
    with open(tmp_path / "log", "w", encoding="utf-8") as log:
        monkeypatch.setattr("sys.stderr", log)
        clone(SEARCH).set_callbacks(ProgressLine()).fit(X, Y)
        assert log.tell() == 0
        monkeypatch.setattr(_progress, "_PAUSE_IN_FILES", 0)
        clone(SEARCH).set_callbacks(ProgressLine()).fit(X, Y)
    lines = (tmp_path / "log").read_text("utf-8").splitlines()
    assert "GridSearchCV ░░░░░░░░ 0/2  search ██████░░ 3/4" in lines
    assert all(lines) and "\r" not in "".join(lines)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full disk at hand")
def test_a_log_that_cannot_be_written_ends_no_fit(monkeypatch):
    monkeypatch.setattr(_progress, "_PAUSE_IN_FILES", 0)
    with suppress(OSError), open("/dev/full", "w", encoding="utf-8") as log:
        monkeypatch.setattr("sys.stderr", log)
        search = clone(SEARCH).set_callbacks(ProgressLine()).fit(X, Y)
        monkeypatch.undo()
    assert search.n_splits_ == 2


def test_a_process_without_a_console_fits_all_the_same(monkeypatch):
    monkeypatch.setattr("sys.stderr", None)
    model = clone(PIPELINE).set_callbacks(ProgressLine()).fit(X, Y)
    np.testing.assert_array_equal(
        model.predict_proba(X), clone(PIPELINE).fit(X, Y).predict_proba(X)
    )
