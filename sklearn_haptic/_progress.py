"""The progress of fits, on one line of text that stays where it is."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from io import TextIOWrapper
from numbers import Integral
from shutil import get_terminal_size
from threading import Lock
from typing import Any

from ._sklearn import (
    Interval,
    close_listener,
    get_context_path,
    open_listener,
    send,
    validate_params,
)

_WIDTH = 8  # of a bar
_PAUSE = 0.1  # seconds between two drawings
_PAUSE_IN_FILES = 60.0  # where each drawing is a line that stays


class ProgressLine:
    """Callback that shows the progress of a fit on one line, with one bar per level.

    A search, for instance, has a bar of its fits and, if wanted, one of the steps of
    the pipeline that is being fitted. scikit-learn's
    :class:`~sklearn.callback.ProgressBar` shows a bar for every fit, below each other,
    and requires the package rich. The line is written to the standard error and erased
    at the end. If that is a file or a pipe, such as the log of a job, a new line is
    written once a minute instead.

    Parameters
    ----------
    n_fits : int, default=1
        How many fits there will be, such as one per fold of a cross-validation of the
        estimator. If there are several, they are counted by a bar of their own.
    max_propagation_depth : int or None, default=0
        How many levels of estimators within the outermost one are shown: with 0, the
        fits of a search or the steps of a pipeline; with 1, also the steps of the
        pipeline that a search fits; None means all.

    Notes
    -----
    `n_fits` counts right where the fits are made by one job. The fits within a search
    may be made by any number. scikit-learn warns where it cannot show a level that is
    asked for, such as what is within a :class:`~sklearn.compose.ColumnTransformer`.

    Examples
    --------
    >>> from sklearn.model_selection import GridSearchCV
    >>> from sklearn_haptic import NNPOM, ProgressLine
    >>> search = GridSearchCV(NNPOM(0), {"alpha": [1, 10]}, cv=2)
    >>> search.set_callbacks(ProgressLine()).fit([[0], [1], [2], [3]], [1, 1, 2, 2])
    GridSearchCV(...)

    While it runs with ``max_propagation_depth=1``, the line looks like this::

        GridSearchCV ░░░░░░░░ 0/2  search ██████░░ 3/4  NNPOM ░░░░░░░░ 15/500
    """

    @validate_params(
        {
            "n_fits": [Interval(Integral, 1, None, closed="left")],
            "max_propagation_depth": [Interval(Integral, 0, None, closed="left"), None],
        },
        prefer_skip_nested_validation=True,
    )
    def __init__(
        self, n_fits: int = 1, *, max_propagation_depth: int | None = 0
    ) -> None:
        self.n_fits = n_fits
        self.max_propagation_depth = max_propagation_depth
        self._n_done = 0
        self._listeners: dict[Any, Any] = {}

    def setup(self, estimator: Any, context: Any) -> None:
        """Begin a line; called by scikit-learn before the outermost fit."""
        above = [("fits", self._n_done % self.n_fits, self.n_fits)]
        line = _Line(above if self.n_fits > 1 else [])
        self._listeners[context.root_uuid] = open_listener(line.update)

    def on_fit_task_begin(self, estimator: Any, context: Any) -> None:
        """Note that a task begins; called by scikit-learn."""
        own = context.parent is None or context.source_estimator_name is not None
        name = context.estimator_name if own else context.task_name
        self._tell(context, name, context.max_subtasks)

    def on_fit_task_end(self, estimator: Any, context: Any) -> None:
        """Note that a task is over; called by scikit-learn."""
        self._tell(context)

    def teardown(self, estimator: Any, context: Any) -> None:
        """Erase the line; called by scikit-learn after the outermost fit."""
        self._n_done += 1
        listener = self._listeners.pop(context.root_uuid)
        send(listener, None)
        close_listener(listener)

    def _tell(self, context, *begun):
        path = tuple(each.task_id for each in get_context_path(context))
        send(self._listeners[context.root_uuid], (path, *begun))


class _Line:
    """A line, and the tasks that it shows: the latest one of each level."""

    drawn = time.monotonic()  # when any line went to a file

    def __init__(self, above):
        self.above = above
        self.tasks = []  # path, name, number of subtasks done and expected
        self.lock = Lock()
        self.in_file = _is_file(sys.stderr)
        self.drawn, self.length = -_PAUSE, 0

    def update(self, message):
        """Note that a task begins (path, name, n_subtasks) or ends (path,), or erase.

        With several jobs, messages come from several threads.
        """
        # A full disk or a broken pipe ends no fit.
        with self.lock, suppress(OSError):
            if message is None:
                return self._write("")
            path, *begun = message
            if begun:
                self.tasks[len(path) - 1 :] = [[path, *begun[:1], 0, *begun[1:]]]
            else:
                self.tasks = [task for task in self.tasks if task[0] != path]
                for task in self.tasks:
                    task[2] += task[0] == path[:-1]
            place, pause = (_Line, _PAUSE_IN_FILES) if self.in_file else (self, _PAUSE)
            if time.monotonic() - place.drawn >= pause:
                place.drawn = time.monotonic()
                self._write(self.text())

    def text(self):
        """Return the line: a bar per level that has several tasks, then the latest."""
        bars = [*self.above, *(task[1:] for task in self.tasks)]
        parts = [_bar(*each) for each in bars if each[2] is None or each[2] > 1]
        parts += [task[1] for task in self.tasks[-1:] if task[3] == 0]
        return "  ".join(parts)

    def _write(self, text):
        if sys.stderr is None:  # of a process without a console
            return
        if self.in_file:
            return print(text, file=sys.stderr, flush=True) if text else None
        text = text[: get_terminal_size().columns - 1]
        erased = "\r" + " " * self.length + "\r"
        sys.stderr.write(erased + text)
        sys.stderr.flush()
        self.length = len(text)


def _is_file(stream):
    """Whether a line that is written stays; the streams of notebooks are others."""
    return isinstance(stream, TextIOWrapper) and not stream.isatty()


def _bar(name, n_done, n_tasks):
    """Return a bar as text.

    Examples
    --------
    >>> from sklearn_haptic._progress import _bar
    >>> _bar("search", 3, 4)
    'search ██████░░ 3/4'
    >>> _bar("search", 3, None)
    'search 3'
    """
    if n_tasks is None:
        return f"{name} {n_done}"
    full = _WIDTH * min(n_done, n_tasks) // n_tasks
    return f"{name} {'█' * full}{'░' * (_WIDTH - full)} {n_done}/{n_tasks}"
