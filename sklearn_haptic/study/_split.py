"""Trials divided into parts of distinct objects: training, validation and test."""

from typing import NamedTuple

import numpy as np
from sklearn.utils import check_random_state

from ..utils._folds import ObjectKFold, validation_split

_SHARE_OF_TEST = 0.1  # of the objects, in the paper's split
_SHARE_OF_VALIDATION = 1 / 9  # of the objects that are not test objects


class Parts(NamedTuple):
    """Ascending indices of the trials of one fold."""

    train: np.ndarray
    validation: np.ndarray
    test: np.ndarray


def split_objects(objects, split, *, n_splits, n_repeats, seed):
    """Divide trials into training, validation and test trials of distinct objects.

    Parameters
    ----------
    objects : ndarray of shape (n_trials,)
        The object of each trial.
    split : {"group_kfold", "paper"}
        How to divide them, see `run_study`.
    n_splits, n_repeats : int
        Number of folds of "group_kfold", and how often it divides the objects.
    seed : int
        Seed of the random divisions.

    Returns
    -------
    folds : list of Parts
        The objects of each part depend on which objects there are, but not on the
        order of the trials.

    Raises
    ------
    ValueError
        If there are too few objects for a part.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._split import split_objects
    >>> objects = np.repeat(np.arange(60), 10)
    >>> (parts,) = split_objects(objects, "paper", n_splits=5, n_repeats=2, seed=0)
    >>> [len(np.unique(objects[part])) for part in parts]
    [48, 6, 6]
    """
    n_objects = len(np.unique(objects))
    n_required = 3 if split == "paper" else n_splits if n_splits > 2 else 4
    if n_objects < n_required:
        raise ValueError(
            f"The corpus has {n_objects} object{'s' * (n_objects > 1)}, but "
            f"split={split!r} with n_splits={n_splits} requires {n_required} or more, "
            "to train, validate and test on different ones; give more objects or "
            'another n_splits or split="paper".'
        )
    rng = check_random_state(seed)
    order = np.argsort(objects, kind="stable")  # the order of trials changes no fold
    objects = objects[order]
    if split == "paper":
        outer = [validation_split(len(objects), objects, _SHARE_OF_TEST, rng)]
    else:
        kfold = ObjectKFold(n_splits, shuffle=True, random_state=rng)
        outer = [
            fold
            for _ in range(n_repeats)
            for fold in kfold.split(objects, groups=objects)
        ]
    folds = []
    for rest, test in outer:
        train, validation = validation_split(
            len(rest), objects[rest], _SHARE_OF_VALIDATION, rng
        )
        parts = rest[train], rest[validation], test
        folds.append(Parts(*(np.sort(order[part]) for part in parts)))
    return folds
