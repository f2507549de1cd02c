"""The models of a fold: sensors combined, tested with all of them and without each."""

from itertools import chain

import numpy as np
import pandas as pd
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator

from ..metrics._trial_scores import predict_and_score, score_trials
from ..model_selection._contributions import FULL_MODEL, fit_holdouts
from ..models import DummyDistribution, SensorFusionNNPOM
from ..ratings._checks import check_ratings
from ._choice import choose_network, for_early_stopping
from ._features import rotate_features
from ._store import read_unit, unit_path
from ._trials import counts_of, truth_of


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

    The scores have one row per model and test trial, see `read_study`; those of the
    combined network come first, under the name "combined" in the column ``network``.
    """
    name = procedure, adjective, fold
    trials, _ = read_unit(study.folder, ("trials", procedure))
    counts = counts_of(trials, adjective)
    parts = study.split_objects(trials["object"].to_numpy(), adjective)[fold]
    X, fusion, choices, singly = choose_sensor_networks(study, name, counts, parts)
    combined, choice = choose_network(
        study,
        (*name, "combined"),
        clone(study.regressor).set_params(estimator=fusion),
        "estimator__final_estimator",
        X,
        counts,
        parts,
    )
    holdouts = predict_holdouts(study, name, combined, X, counts, parts)
    tested, true = trials.iloc[parts.test], counts[parts.test]
    tables = [
        pd.DataFrame(
            {
                "procedure": procedure,
                "adjective": adjective,
                "fold": fold,
                "network": network,
                "held_out": held_out,
                "start": start,
                "object": tested["object"].to_numpy(),
                "trial": tested["trial"].to_numpy(),
                **scores,
                **{f"proba_{k}": p for k, p in enumerate(proba.T, start=1)},
                **{f"count_{k}": c for k, c in enumerate(true.T, start=1)},
            }
        )
        for network, start, held_out, (proba, scores) in chain(holdouts, singly)
    ]
    return pd.concat(tables, ignore_index=True), {
        "choices": [*choices, choice],
        "baselines": score_baselines(counts, parts),
        "truth": score_truth(true, truth_of(tested, adjective)),
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
        Features of all sensors, side by side, as the networks take them.
    fusion : SensorFusionNNPOM
        Unfitted, with the networks of the sensors frozen.
    choices : list of dict
        What was chosen for each sensor.
    singly : list of (sensor, start, held_out, (proba, scores))
        What each sensor's network predicts alone for the test trials: the network
        that was chosen, whose hidden units the combined network takes.
    """
    features, columns, networks, choices, singly = [], {}, {}, [], []
    true = counts[parts.test]
    n_features = 0
    for sensor in study.sensors:
        unit = study.features_unit(name[0], sensor, *name[1:])
        X = read_unit(study.folder, unit)[0]["features"]
        if study.standardise:
            X = rotate_features(X, parts.train)
        X = X.astype(np.float64, copy=False)
        model, choice = choose_network(
            study, (*name, sensor), study.regressor, "estimator", X, counts, parts
        )
        features.append(X)
        columns[sensor] = slice(n_features, n_features + X.shape[1])
        networks[sensor] = FrozenEstimator(model.estimator_)
        choices.append(choice)
        proba, (scores,) = predict_and_score(model, X[parts.test], true)
        singly.append((sensor, 0, FULL_MODEL, (proba, scores)))
        n_features += X.shape[1]
    final = study.regressor.estimator
    fusion = SensorFusionNNPOM(columns, networks, final_estimator=final)
    return np.hstack(features), fusion, choices, singly


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
    network : str
        "combined".
    start : int
    held_out : str
        The sensor left out, or "none".
    predicted : tuple of (proba, scores)
        What it predicts for the test trials, and the scores of that.
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
            proba, (scores,) = predict_and_score(
                model, X[parts.test], counts[parts.test]
            )
            yield "combined", start, held_out, (proba, scores)


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


def score_truth(counts, proba):
    """Score the distribution of the whole population, where it is known.

    Parameters
    ----------
    counts : ndarray of shape (n_test, n_levels)
        Ratings of each test trial's object.
    proba : ndarray of shape (n_test, n_levels) or (n_test, 0)
        Probability of each level in the population of which the raters are a sample.

    Returns
    -------
    truth : list of dict
        One, with the mean of each score over the trials; none without ``proba``.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._models import score_truth
    >>> (truth,) = score_truth(np.array([[3, 1]]), np.array([[0.75, 0.25]]))
    >>> truth["emd"], truth["rps"]
    (0.0, 0.1875)
    >>> score_truth(np.array([[3, 1]]), np.empty((1, 0)))
    []
    """
    if proba.shape[1] == 0:
        return []
    scores = score_trials(counts, proba)
    return [{name: float(score.mean()) for name, score in scores.items()}]
