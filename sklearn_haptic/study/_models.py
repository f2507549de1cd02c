"""The models of a fold: sensors combined, tested with all of them and without each."""

from itertools import product

import numpy as np
import pandas as pd
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.metrics import check_scoring

from ..metrics._trial_scores import predict_and_score, score_trials
from ..model_selection._contributions import FULL_MODEL, fit_holdouts
from ..models import DummyDistribution, SensorFusionNNPOM
from ..ratings._checks import check_ratings
from ._corpus import counts_of, truth_of
from ._features import rotate_features
from ._store import read_table, read_unit

# In place of a start: the network that was chosen, as it was fitted to be chosen.
CHOSEN = -1


def check_models(study, models):
    """Refuse models that could not be fitted, before anything is computed.

    A ValueError says that there are too few objects for the folds, or that ratings are
    not counts.
    """
    for _, procedure, adjective, fold in models:
        if fold == 0:
            trials, _ = read_table(study.folder, ("trials", procedure))
            check_ratings(
                counts_of(trials, adjective), name=f"corpus.ratings[{adjective!r}]"
            )
            study.split_objects(trials["object"].to_numpy(), adjective)


def compute_models(study, procedure, adjective, number):
    """Return the scores of a fold, and a record with its choices and baselines.

    The scores have one row per model and test trial, see `read_study`: first those of
    the combined network from each start, with all sensors and without each; then those
    of each network as it was chosen.
    """
    fold = Fold(study, procedure, adjective, number)
    X, fusion, choices, chosen = choose_sensor_networks(fold)
    combined, choice = fold.choose(
        "combined",
        clone(study.regressor).set_params(estimator=fusion),
        "estimator__final_estimator",
        X,
    )
    validation = for_early_stopping(combined, X, fold.counts, fold.parts)
    refits = []
    for start in range(study.n_starts):
        models = fit_holdouts(
            combined,
            X[fold.parts.train],
            fold.counts[fold.parts.train],
            random_state=study.seed(*fold.name, "start", start),
            **validation,
        )
        for held_out, model in models.items():
            refits.append(fold.test("combined", held_out, start, model, X))
    chosen.append(fold.test("combined", FULL_MODEL, CHOSEN, combined, X))
    truth = truth_of(fold.trials, adjective)[fold.parts.test]
    return pd.concat([*refits, *chosen], ignore_index=True), {
        "choices": [*choices, choice],
        "baselines": score_baselines(fold.counts, fold.parts),
        "truth": score_truth(fold.counts[fold.parts.test], truth),
    }


class Fold:
    """The trials of a fold, on which networks are chosen and tested."""

    def __init__(self, study, procedure, adjective, number):
        self.study = study
        self.name = procedure, adjective, number
        self.trials, _ = read_table(study.folder, ("trials", procedure))
        self.counts = counts_of(self.trials, adjective)
        objects = self.trials["object"].to_numpy()
        self.parts = study.split_objects(objects, adjective)[number]

    def choose(self, name, regressor, network, X):
        """Choose the number of hidden units and the penalty of a network.

        Parameters
        ----------
        name : str
            What the choice is called.
        regressor : DistributionalOrdinalRegressor
        network : str
            Name of the network among the parameters of `regressor`.
        X : ndarray of shape (n_trials, n_features)

        Returns
        -------
        model : DistributionalOrdinalRegressor
            The best candidate, fitted.
        choice : dict
            The name, what was chosen, and the score of the candidate.
        """
        grid = list(product(self.study.n_hidden, self.study.alpha))
        candidates = [
            clone(regressor).set_params(
                **{f"{network}__n_hidden": n_hidden, f"{network}__alpha": alpha},
                random_state=self.study.seed(*self.name, name, n_hidden, alpha),
            )
            for n_hidden, alpha in grid
        ]
        best, score, model = fit_best(
            candidates, X, self.counts, self.parts, self.study.scoring
        )
        n_hidden, alpha = grid[best]
        choice = {"n_hidden": n_hidden, "alpha": alpha, "score": score}
        return model, {"network": name} | choice

    def test(self, network, held_out, start, model, X):
        """Return what a model predicts for each test trial, with its scores."""
        test = self.parts.test
        trials, counts = self.trials.iloc[test], self.counts[test]
        proba, (scores,) = predict_and_score(model, X[test], counts)
        columns = dict(zip(("procedure", "adjective", "fold"), self.name))
        columns |= {"network": network, "held_out": held_out, "start": start}
        columns |= {of: trials[of].to_numpy() for of in ("object", "trial")} | scores
        for name, values in (("proba", proba), ("count", counts)):
            columns |= {f"{name}_{k}": v for k, v in enumerate(values.T, start=1)}
        return pd.DataFrame(columns)


def choose_sensor_networks(fold):
    """Choose a network for each sensor, to be combined.

    Parameters
    ----------
    fold : Fold

    Returns
    -------
    X : ndarray of shape (n_trials, n_features)
        Features of all sensors, side by side, as the networks take them.
    fusion : SensorFusionNNPOM
        Unfitted, with the networks of the sensors frozen.
    choices : list of dict
        What was chosen for each sensor.
    tables : list of DataFrame
        What each sensor's network predicts alone for the test trials: the network
        that was chosen, whose hidden units the combined network takes.
    """
    features, columns, networks, choices, tables = [], {}, {}, [], []
    n_features = 0
    for sensor in fold.study.sensors:
        unit = fold.study.features_unit(fold.name[0], sensor, *fold.name[1:])
        X = read_unit(fold.study.folder, unit)[0]["features"]
        if fold.study.standardise:
            X = rotate_features(X, fold.parts.train)
        X = X.astype(np.float64, copy=False)
        model, choice = fold.choose(sensor, fold.study.regressor, "estimator", X)
        features.append(X)
        columns[sensor] = slice(n_features, n_features + X.shape[1])
        networks[sensor] = FrozenEstimator(model.estimator_)
        choices.append(choice)
        tables.append(fold.test(sensor, FULL_MODEL, CHOSEN, model, X))
        n_features += X.shape[1]
    final = fold.study.regressor.estimator
    fusion = SensorFusionNNPOM(columns, networks, final_estimator=final)
    return np.hstack(features), fusion, choices, tables


def for_early_stopping(regressor, X, counts, parts):
    """Return what ``fit`` takes beside training trials if the regressor stops early."""
    if regressor.estimator.validation_share() == 0:
        return {}
    return {"X_val": X[parts.validation], "y_val": counts[parts.validation]}


def fit_best(candidates, X, counts, parts, scoring):
    """Fit regressors to training trials and keep the best on validation trials.

    Parameters
    ----------
    candidates : list of DistributionalOrdinalRegressor
        Unfitted regressors. Early stopping, if any, is on the validation trials.
    X : ndarray of shape (n_trials, n_features)
    counts : ndarray of shape (n_trials, n_levels)
    parts : Parts
    scoring : str, callable or None
        Score by which to choose, higher being better; None for the regressor's own.

    Returns
    -------
    best : int
        Index of the best candidate, or of the first of several. NaN is worse than
        any score.
    score : float
        Its score.
    model : DistributionalOrdinalRegressor
        The candidate, fitted.

    Raises
    ------
    ValueError
        If every score is NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor
    >>> from sklearn_haptic.study._models import fit_best
    >>> from sklearn_haptic.study._split import Parts
    >>> X = np.array([[0.0], [1.0], [2.0]])
    >>> counts = np.array([[9, 1], [1, 9], [0, 10]])
    >>> candidates = [
    ...     DistributionalOrdinalRegressor(NNPOM(n_hidden=0, alpha=alpha))
    ...     for alpha in (1e6, 1.0)
    ... ]
    >>> parts = Parts(np.array([0, 1]), np.array([2]), np.array([]))
    >>> fit_best(candidates, X, counts, parts, None)[0]
    1
    """
    train = X[parts.train], counts[parts.train]
    validation = for_early_stopping(candidates[0], X, counts, parts)
    best = None
    for i, candidate in enumerate(candidates):
        candidate.fit(*train, **validation)
        scorer = check_scoring(candidate, scoring)
        score = float(scorer(candidate, X[parts.validation], counts[parts.validation]))
        if not np.isnan(score) and (best is None or score > best[1]):
            best = i, score, candidate
    if best is None:
        raise ValueError(
            f"scoring={scoring!r} gives NaN for every network on the validation "
            "trials; give one that is defined for them."
        )
    return best


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
        baselines.append(
            {"strategy": strategy}
            | _mean_scores(counts[parts.test], model.predict_proba(parts.test))
            | {f"proba_{k}": float(p) for k, p in enumerate(model.proba_, start=1)}
        )
    return baselines


def _mean_scores(counts, proba):
    """Return the mean of each score over trials, by its name."""
    return {n: float(score.mean()) for n, score in score_trials(counts, proba).items()}


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
    return [_mean_scores(counts, proba)] if proba.shape[1] else []
