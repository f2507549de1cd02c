"""Early stopping: which trials validate, by what error, and when to stop."""

import numpy as np

from ..ratings._distributions import macro_error
from ..utils._folds import validation_split, warn_of_no_groups
from ._observations import of_each_adjective

_VALIDATION_INTERVAL = 10  # iterations between two looks at the validation error


def hold_out_trials(estimator, n_trials, groups, fraction, random_state):
    """Split off validation trials; return the indices of both parts.

    Whole objects validate if the trials' `groups` are given; else a warning names the
    estimator, whose ``fit`` calls this. `fraction` is the share of the objects, or of
    the trials, that validates; at least one does. If nothing would be left to train on,
    a ValueError says so.
    """
    split = validation_split(n_trials, groups, fraction, random_state)
    if groups is None:
        warn_of_no_groups(estimator, stacklevel=6)
    return split


def validation_error(network, X, positions, level, weight):
    """Return the error of a network on validation trials.

    It is the absolute error of the most probable level, averaged over the levels that
    occur in a trial, over trials by weight, and over adjectives. The validation trials
    are given as to `NNPOM.fit_with_positions`.
    """
    errors = []
    for i, (at, true, counted) in enumerate(
        of_each_adjective(positions, level, weight)
    ):
        own = X[:, i] if X.ndim == 4 else X
        predicted = network.adjective(i).predict_proba(own, at)[:, :, 0].argmax(axis=-1)
        error = macro_error(predicted, true, counted > 0)
        errors.append(np.average(error, weights=counted.max(axis=1)))
    return np.mean(errors)


class Monitor:
    """Callback of a solver that records the costs and keeps the best parameters.

    Parameters
    ----------
    validation_error : callable or None
        Returns the validation error of parameters; None for no early stopping.
    patience : int
        Number of iterations without a smaller error after which the search stops.
    on_iteration : callable or None
        Called with the number of each iteration; the search stops if it returns true.
    """

    def __init__(self, validation_error, patience, on_iteration):
        self.validation_error = validation_error
        self.patience = patience
        self.on_iteration = on_iteration
        self.costs = []
        self.best_error, self.best_params, self.best_iter = np.inf, None, 0

    def __call__(self, params, cost):
        self.costs.append(float(cost))
        iteration = len(self.costs)
        if self.on_iteration is not None and self.on_iteration(iteration):
            return True
        if self.validation_error is None or iteration % _VALIDATION_INTERVAL:
            return False
        error = self.validation_error(params)
        if error < self.best_error:
            self.best_error, self.best_iter = error, iteration
            self.best_params = params.copy()
        return iteration - self.best_iter >= self.patience


# More rows than this make scikit-learn's histogram boosting stop early by itself.
_AUTO_EARLY_STOPPING = 10_000


def validates_on_rows(estimator, n_rows):
    """Return whether an estimator, or a step of it, validates on some of its rows."""
    params = estimator.get_params()
    for name, fraction in params.items():
        step = name.removesuffix("validation_fraction")
        if step == name or fraction is None:
            continue
        patient = params.get(f"{step}n_iter_no_change") is not None
        early = params.get(f"{step}early_stopping", patient)
        if early is True or (early == "auto" and n_rows > _AUTO_EARLY_STOPPING):
            return True
    return False
