"""Trials held out of training, on which early stopping judges."""

import warnings

from .._folds import validation_split


def hold_out_trials(estimator, n_trials, groups, fraction, random_state):
    """Hold out trials for early stopping, whole objects if these are given.

    Parameters
    ----------
    estimator : estimator object
        Whose ``fit`` calls this.
    n_trials : int
    groups : ndarray of shape (n_trials,), or None
        The object of each trial.
    fraction : float
        Share of the objects, or of the trials, that is held out; at least one.
    random_state : RandomState instance

    Returns
    -------
    train, held_out : ndarray of int
        Indices of trials.

    Raises
    ------
    ValueError
        If nothing would be left to train on.

    Warns
    -----
    UserWarning
        If there are no groups.
    """
    split = validation_split(n_trials, groups, fraction, random_state)
    if groups is None:
        name = type(estimator).__name__
        warnings.warn(
            "Early stopping holds out single trials, since fit was given no groups: "
            "trials of an object may be on both sides, and then it stops too late. "
            "Call fit(..., groups=objects), with range(n_trials) if each trial is of "
            "another object. Searches and cross-validation pass groups on after\n"
            "    sklearn.set_config(enable_metadata_routing=True)\n"
            f"    {name}(...).set_fit_request(groups=True)",
            UserWarning,
            stacklevel=4,  # beyond this, fit, and its decorator
        )
    return split


# More rows than this make scikit-learn's histogram boosting stop early by itself.
_AUTO_EARLY_STOPPING = 10_000


def validates_on_rows(estimator, n_rows):
    """Whether an estimator, or a step of it, holds out some rows to stop early."""
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
