"""The knobs of `speed_accuracy.py`: what each value changes in features and head."""

from typing import NamedTuple

import mord
import numpy as np
from sklearn.base import BaseEstimator, clone

from sklearn_haptic import (
    NNPOM,
    PAPER_2020,
    DistributionalOrdinalRegressor,
    DummyDistribution,
)

# Window in time samples and number of atoms, as in the 2020 paper.
SIZES = {"pac": (22, 40), "pdc": (50, 25), "tac": (50, 25), "tdc": (50, 10)}
SENSORS = (*SIZES, "electrodes")


class Setting(NamedTuple):
    """A model and its features, as far as they differ from the base."""

    features: dict = {}  # noqa: RUF012
    model: BaseEstimator = DistributionalOrdinalRegressor(NNPOM(n_hidden=0, alpha=10.0))
    alphas: tuple = ()  # from which to choose by the training trials


def features(**changes):
    """Other features, the base's head."""
    return Setting(changes)


def head(**changes):
    """The base's features, another head."""
    return Setting(model=clone(Setting().model).set_params(**changes))


def network(**changes):
    """The base with ten hidden units."""
    defaults = {"n_hidden": 10, "alpha": 10.0, "random_state": 0}
    return head(estimator=NNPOM(**defaults | changes))


def searched(setting, alphas):
    """The same, but its penalty is chosen by grouped folds of the training trials."""
    return setting._replace(alphas=tuple(alphas))


def duplicates(n_duplicates):
    """Another number of observations per trial, with the penalty in proportion."""
    alpha = 10.0 * n_duplicates / 15
    return head(n_duplicates=n_duplicates, estimator__alpha=alpha)


def vary(make, name, values):
    return {str(value): make(**{name: value}) for value in values}


def coded(n_nonzero_coefs, max_iter, max_train, cells):
    """The head of the presets; dictionaries learned with more or less care."""
    changes = {
        "cells": cells,
        "n_nonzero_coefs": n_nonzero_coefs,
        "max_iter": max_iter,
        "max_train": max_train,
    }
    return head(estimator__alpha=3.0)._replace(features=changes)


BASE = Setting()
FEATURE_KNOBS = {
    "temporal pooling": {
        " ".join(map(str, cells)): features(cells=cells)
        for cells in [
            (16, 8, 4, 2, 1),
            (1,),
            (4, 2, 1),
            (8, 4, 2, 1),
            (16,),
            (32, 16, 8, 4, 2, 1),
        ]
    },
    "atoms": {
        "40, 25, 25, 10, 10": BASE,
        "half": features(atoms=0.5),
        "double": features(atoms=2),
    },
    "sparsity": vary(features, "n_nonzero_coefs", [4, 1, 2, 8]),
    "K-SVD iterations": vary(features, "max_iter", [50, 0, 5, 20, 100]),
    "training windows": vary(features, "max_train", [20_000, 2000, 5000, 50_000]),
    "update": vary(features, "update", ["approximate", "exact"]),
    "precision": vary(features, "dtype", ["float32", "float64"]),
    "spatial pooling": {
        " ".join(map(str, cells)): features(spatial_cells=cells)
        for cells in [(3, 2, 1), (1,), (2, 1), (3,)]
    },
    "mean removed": {
        "none": BASE,
        "pac, electrodes": features(mean_removed=("pac", "electrodes")),
        "every sensor": features(mean_removed=SENSORS),
    },
    "sensors": {
        "all": BASE,
        **{f"{s} alone": features(sensors=(s,)) for s in SENSORS},
        **{
            f"without {s}": features(sensors=tuple(t for t in SENSORS if t != s))
            for s in SENSORS
        },
    },
}
FEATURE_KNOBS["dictionaries"] = {
    "base": BASE,
    "slow": coded(4, 50, 20_000, (8, 4, 2, 1)),
    "medium": coded(4, 20, 5000, (4, 2, 1)),
    "quick": coded(2, 5, 5000, (4, 2, 1)),
}
HEAD_KNOBS = {
    "n_duplicates": {str(n): duplicates(n) for n in (15, 3, 5, 50)},
    "sampling": vary(head, "sampling", ["level", "lattice", "stratified", "random"]),
    "p_transform": vary(head, "p_transform", ["logit", None]),
    "balance": vary(head, "balance", [None, "macro"]),
    "monotone": vary(head, "monotone", [False, True]),
    "decoding": {
        "mixture": BASE,
        "quantile 99, median": head(decode="quantile"),
        "quantile 99, argmax": head(decode="quantile", rule="argmax"),
        "quantile 9, median": head(decode="quantile", n_quantiles=9),
    },
    "alpha": {
        "10": BASE,
        "searched": searched(BASE, np.logspace(-2, 2, 9)),
        **{
            f"{alpha:g}": head(estimator__alpha=alpha)
            for alpha in (0.01, 0.1, 1.0, 3.0, 30.0, 100.0, 1000.0)
        },
    },
    "scale_features": {
        "True": BASE,
        "False, alpha searched": searched(
            head(estimator__scale_features=False), np.logspace(0, 5, 11)
        ),
        "True, 10 hidden units": network(),
        "False, 10 hidden units, alpha searched": searched(
            network(scale_features=False, max_iter=100), np.logspace(0, 4, 5)
        ),
    },
    "max_iter": vary(head, "estimator__max_iter", [500, 10, 25, 75, 200]),
    "tol": vary(head, "estimator__tol", [1e-4, 1e-5, 1e-3, 1e-2]),
    "solver": vary(head, "estimator__solver", ["lbfgs", "irprop+"]),
    "hidden units": {
        "0": BASE,
        **vary(network, "n_hidden", [1, 5, 10, 20, 30]),
    },
    "max_iter, 10 hidden units": vary(network, "max_iter", [500, 25, 75, 200]),
    "early stopping, 10 hidden units": {
        "none": network(),
        **{
            f"patience {n}": network(early_stopping=True, n_iter_no_change=n)
            for n in (20, 150)
        },
    },
    "tol, 10 hidden units": vary(network, "tol", [1e-4, 1e-5, 1e-3]),
    "solver, 10 hidden units": vary(network, "solver", ["lbfgs", "irprop+"]),
    "model": {
        "base": BASE,
        "mord LogisticAT, lattice, alpha searched": searched(
            head(estimator=mord.LogisticAT(), sampling="lattice"), np.logspace(0, 5, 6)
        ),
        "counts, no p": Setting(model=NNPOM(n_hidden=0, alpha=10.0)),
        "paper's settings": Setting(
            model=DistributionalOrdinalRegressor(**PAPER_2020, random_state=0)
        ),
        "marginal": Setting(model=DummyDistribution("marginal")),
        "W1 barycentre": Setting(model=DummyDistribution("barycentre")),
    },
}
KNOBS = FEATURE_KNOBS | HEAD_KNOBS
