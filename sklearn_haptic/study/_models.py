"""The models of a fold: sensors combined, tested with all of them and without each."""

import numpy as np
import pandas as pd
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

from .._check_ratings import check_ratings
from .._holdouts import fit_holdouts
from .._trial_scores import score_trials
from ..models import DummyDistribution, SensorFusionNNPOM
from ._choice import choose_network, for_early_stopping
from ._features import rotate_features
from ._store import read_unit, unit_path
from ._trials import counts_of


def check_models(study, models):
    """Refuse models that could not be fitted or kept, before anything is computed.

    Parameters
    ----------
    study : Study
    models : list of tuple
        The units.

    Raises
    ------
    ValueError
        If there are too few objects for the folds, ratings are not counts, or an
        adjective cannot be part of the name of a file.
    """
    for _, procedure, adjective, fold in models:
        unit_path(study.folder, ("models", procedure, adjective, fold))
        if fold == 0:
            trials, _ = read_unit(study.folder, ("trials", procedure))
            check_ratings(
                counts_of(trials, adjective), name=f"corpus.ratings[{adjective!r}]"
            )
            study.split_objects(trials["object"].to_numpy(), adjective)


def compute_models(study, procedure, adjective, fold):
    """Return the scores of a fold, and a record with its choices and baselines.

    The scores have one row per model and test trial, see `read_study`.
    """
    name = procedure, adjective, fold
    trials, _ = read_unit(study.folder, ("trials", procedure))
    objects, counts = trials["object"].to_numpy(), counts_of(trials, adjective)
    parts = study.split_objects(objects, adjective)[fold]
    X, fusion, choices = choose_sensor_networks(study, name, counts, parts)
    combined, choice = choose_network(
        study,
        (*name, "combined"),
        clone(study.regressor).set_params(estimator=fusion),
        "estimator__final_estimator",
        X,
        counts,
        parts,
    )
    tables = [
        pd.DataFrame(
            {
                "procedure": procedure,
                "adjective": adjective,
                "fold": fold,
                "held_out": held_out,
                "start": start,
                "object": objects[parts.test],
                "trial": trials["trial"].to_numpy()[parts.test],
                **score_trials(counts[parts.test], proba),
                **{f"proba_{k}": p for k, p in enumerate(proba.T, start=1)},
                **{f"count_{k}": c[parts.test] for k, c in enumerate(counts.T, 1)},
            }
        )
        for start, held_out, proba in predict_holdouts(
            study, name, combined, X, counts, parts
        )
    ]
    return pd.concat(tables, ignore_index=True), {
        "choices": [*choices, choice],
        "baselines": score_baselines(counts, parts),
    }


def choose_sensor_networks(study, name, counts, parts):
    """Choose a network for each sensor, and combine them.

    Parameters
    ----------
    study : Study
    name : tuple
        Procedure, adjective and fold.
    counts : ndarray of shape (n_trials, n_levels)
    parts : Parts

    Returns
    -------
    X : ndarray of shape (n_trials, n_features)
        Rotated features of all sensors, side by side.
    fusion : SensorFusionNNPOM
        Unfitted, with the networks of the sensors frozen.
    choices : list of dict
        What was chosen for each sensor.
    """
    features, columns, networks, choices = [], {}, {}, []
    n_features = 0
    for sensor in study.sensors:
        arrays, _ = read_unit(study.folder, ("features", name[0], sensor))
        X = rotate_features(arrays["features"], parts.train)
        model, choice = choose_network(
            study, (*name, sensor), study.regressor, "estimator", X, counts, parts
        )
        features.append(X)
        columns[sensor] = slice(n_features, n_features + X.shape[1])
        networks[sensor] = FrozenEstimator(model.estimator_)
        choices.append(choice)
        n_features += X.shape[1]
    final = study.regressor.estimator
    fusion = SensorFusionNNPOM(columns, networks, final_estimator=final)
    return np.hstack(features), fusion, choices


def predict_holdouts(study, name, combined, X, counts, parts):
    """Predict the test trials from each start, with all sensors and without each.

    Parameters
    ----------
    study : Study
    name : tuple
        Procedure, adjective and fold.
    combined : DistributionalOrdinalRegressor
        The combined model, which is fitted again from each start.
    X : ndarray of shape (n_trials, n_features)
    counts : ndarray of shape (n_trials, n_levels)
    parts : Parts

    Yields
    ------
    start : int
    held_out : str
        The sensor left out, or "none".
    proba : ndarray of shape (n_test, n_levels)
    """
    validation = for_early_stopping(combined, X, counts, parts)
    for start in range(study.n_starts):
        models = fit_holdouts(
            combined,
            X[parts.train],
            counts[parts.train],
            random_state=study.seed(*name, "start", start),
            **validation,
        )
        for held_out, model in models.items():
            yield start, held_out, model.predict_proba(X[parts.test])


def score_baselines(counts, parts):
    """Score the distributions that one would predict without touching the objects.

    Parameters
    ----------
    counts : ndarray of shape (n_trials, n_levels)
    parts : Parts
        Baselines know the ratings of training and validation trials.

    Returns
    -------
    baselines : list of dict
        For each strategy of `DummyDistribution`: its name, the mean of each score
        over the test trials, and the probability of each level.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._models import score_baselines
    >>> from sklearn_haptic.study._split import Parts
    >>> counts = np.array([[3, 1], [1, 3], [1, 3], [0, 4]])
    >>> parts = Parts(np.array([0, 1]), np.array([2]), np.array([3]))
    >>> [round(each["proba_2"], 3) for each in score_baselines(counts, parts)]
    [0.583, 0.75]
    """
    known = np.concatenate((parts.train, parts.validation))
    baselines = []
    for strategy in ("marginal", "barycentre"):
        model = DummyDistribution(strategy).fit(known[:, np.newaxis], counts[known])
        proba = model.predict_proba(parts.test)
        scores = score_trials(counts[parts.test], proba)
        baselines.append(
            {"strategy": strategy}
            | {name: float(score.mean()) for name, score in scores.items()}
            | {f"proba_{k}": float(p) for k, p in enumerate(model.proba_, start=1)}
        )
    return baselines
