"""What each sensor contributes to predicted distributions of ratings.

A *holdout* is a `SensorFusionNNPOM` whose combined network was trained again with the
activations of one sensor set to zero. How much worse it predicts than the full model is
what the sensor contributes. A *start* is one draw of all random weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.stats import kruskal, wilcoxon
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils import check_random_state, indexable
from sklearn.utils.parallel import Parallel, delayed

from .._check_ratings import check_ratings
from .._folds import make_splitter
from .._sklearn import (
    CrossValidator,
    Interval,
    RandomState,
    Trials,
    _safe_indexing,
    validate_params,
)
from .._validation import check_groups, check_numbers
from ..metrics import (
    earth_movers_distance,
    log_score,
    macro_mae,
    ranked_probability_score,
)
from ..models._distributional import DistributionalOrdinalRegressor
from ..models._fusion import SensorFusionNNPOM

# What `held_out` is for the full model.
FULL_MODEL = "none"


# What tells the predictions of one model apart, as far as a table has it.
_UNIT = ("adjective", "procedure", "start", "fold", "object", "trial")


def score_trials(counts, proba):
    """Every score of each predicted distribution; lower is better in all of them.

    Parameters
    ----------
    counts : array-like of shape (n_trials, n_levels)
        How many people gave each trial's object each rating.
    proba : array-like of shape (n_trials, n_levels)
        Predicted probability of each rating.

    Returns
    -------
    scores : dict of str to ndarray of shape (n_trials,)
        "macro_mae", "emd" and "rps" in levels, "log_score" in nats, and "rps_1", …,
        one for each threshold between levels k and k + 1: the ranked probability
        score (RPS) of the ratings reduced to at most k or more. They sum to "rps".

    Raises
    ------
    ValueError
        If a row of ``proba`` is no distribution, a trial has no ratings, or the
        shapes differ.

    Examples
    --------
    >>> from sklearn_haptic.model_selection._contributions import score_trials
    >>> scores = score_trials([[1, 1, 2]], [[0.25, 0.5, 0.25]])
    >>> for name, score in scores.items():
    ...     print(name, score.round(4))
    macro_mae [0.1701]
    emd [0.25]
    rps [0.5]
    log_score [1.213]
    rps_1 [0.1875]
    rps_2 [0.3125]
    """
    counts, proba = np.asarray(counts), np.asarray(proba)
    scores = {
        "macro_mae": macro_mae(counts, proba, average=False),
        "emd": earth_movers_distance(counts, proba, average=False),
        "rps": ranked_probability_score(counts, proba, average=False),
        "log_score": log_score(counts, proba, average=False),
    }
    for k in range(1, counts.shape[1]):
        scores[f"rps_{k}"] = ranked_probability_score(
            _at_most(k, counts), _at_most(k, proba), average=False
        )
    return scores


def _at_most(k, weights):
    """Weights of two levels: the first k levels, and those above."""
    return np.column_stack((weights[:, :k].sum(axis=1), weights[:, k:].sum(axis=1)))


def fit_holdouts(regressor, X, y, *, random_state, groups=None, X_val=None, y_val=None):
    """Fit the full model and one holdout a sensor, from one start.

    The networks of the sensors are fitted once, with the full model, and shared.

    Parameters
    ----------
    regressor : DistributionalOrdinalRegressor
        Its estimator is a `SensorFusionNNPOM`; it is cloned.
    X : array-like of shape (n_trials, n_features)
        Features of each trial.
    y : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people gave the trial's object each rating, or one rating.
    random_state : int
        The start.
    groups, X_val, y_val : array-like, default=None
        As in :meth:`DistributionalOrdinalRegressor.fit`.

    Returns
    -------
    models : dict of str to DistributionalOrdinalRegressor
        The fitted models by the sensor held out; first ``"none"``, the full model.

    Raises
    ------
    ValueError
        If a sensor is called "none".

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import DistributionalOrdinalRegressor, SensorFusionNNPOM
    >>> from sklearn_haptic.model_selection._contributions import fit_holdouts
    >>> X, y = np.random.default_rng(0).normal(size=(8, 3)), [1, 1, 2, 2, 3, 3, 3, 3]
    >>> fusion = SensorFusionNNPOM({"pac": [0, 1], "tdc": [2]})
    >>> regressor = DistributionalOrdinalRegressor(fusion)
    >>> list(fit_holdouts(regressor, X, y, random_state=0))
    ['none', 'pac', 'tdc']
    """

    def fit(**params):
        model = clone(regressor).set_params(random_state=random_state, **params)
        return model.fit(X, y, groups=groups, X_val=X_val, y_val=y_val)

    full = fit()
    networks = full.estimator_.sensor_networks_
    if FULL_MODEL in networks:
        raise ValueError(
            f"A sensor is called {FULL_MODEL!r}, which stands for the full model; "
            "rename it."
        )
    frozen = {name: FrozenEstimator(network) for name, network in networks.items()}
    return {FULL_MODEL: full} | {
        name: fit(estimator__estimator=frozen, estimator__held_out=name)
        for name in networks
    }


@validate_params(
    {
        "n_repeats": [Interval(Integral, 1, None, closed="left")],
        "random_state": ["random_state"],
    },
    prefer_skip_nested_validation=False,
)
def sensor_contributions(
    model: DistributionalOrdinalRegressor | Pipeline,
    X: Trials,
    y: ArrayLike,
    *,
    groups: ArrayLike | None = None,
    cv: CrossValidator = None,
    n_repeats: int = 10,
    random_state: RandomState = None,
    n_jobs: int | None = None,
) -> pd.DataFrame:
    """Hold out one sensor after the other from a model that combines them.

    For each fold, and each of several random starts, the full model and one holdout a
    sensor are fitted and predict the test trials [1]_. Networks of the sensors are
    fitted once a start and shared by all its models.

    Parameters
    ----------
    model : DistributionalOrdinalRegressor or Pipeline
        A regressor whose ``estimator`` is a :class:`~sklearn_haptic.SensorFusionNNPOM`,
        or a Pipeline that ends in one and passes DataFrames on to it, so that it can
        tell the sensors by the names of their columns. Networks of sensors that are
        frozen are not fitted again; only the combined network then has random starts.
    X : DataFrame or array-like of shape (n_trials, n_columns)
        The trials.
    y : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people gave the trial's object each rating, or one rating.
    groups : array-like of shape (n_trials,), default=None
        The object of each trial; by default each trial is one of its own. Goes to
        the splitter and to ``fit``, which may need it to stop early.
    cv : int, splitter or iterable of (train, test), default=None
        The folds. An int, or None for 5, is a number of folds: of whole objects if
        ``groups`` are given, else as in
        :class:`~sklearn.model_selection.GridSearchCV`. For given training and test
        trials pass ``[(train, test)]``.
    n_repeats : int, default=10
        Number of random starts; at least 2 are required for a summary.
    random_state : int, RandomState instance or None, default=None
        Seed of the starts, in place of the random states of the regressor and its
        networks. Pass an int for the same table in every call. The other steps of a
        Pipeline keep theirs.
    n_jobs : int, default=None
        Number of jobs; one fits and scores all models of one start on one fold. The
        table is the same for any number.

    Returns
    -------
    scores : DataFrame
        A row for each model and test trial. Columns: ``held_out``, the sensor, or
        "none" for the full model; ``start`` and ``fold``, counted from 0; ``object``;
        ``trial``, the row of ``X``; and the scores, lower being better: ``macro_mae``,
        ``emd`` and ``rps`` in levels, ``log_score`` in nats, and ``rps_1``, …, the
        terms of the ranked probability score (RPS) at the thresholds between levels
        k and k + 1, which sum to ``rps``.

    Raises
    ------
    TypeError
        If ``model`` does not end in a regressor of a ``SensorFusionNNPOM``.
    ValueError
        If ``model`` holds a sensor out already, or a sensor is called "none".

    See Also
    --------
    contribution_summary : Differences between the models, and tests of them.
    sensor_subsets : Which sensors any model does best with, and in what time.
    sklearn_haptic.plotting.SensorContributionsDisplay : Look at the scores.

    Notes
    -----
    A holdout tells what a sensor adds to all others: nothing, if another one tells
    the same.

    References
    ----------
    .. [1] B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
       distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020,
       section 2.3.3. :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    Vibration tells how people rate these objects, temperature does not.

    >>> import numpy as np
    >>> from sklearn_haptic import DistributionalOrdinalRegressor, SensorFusionNNPOM
    >>> from sklearn_haptic.model_selection import (
    ...     contribution_summary,
    ...     sensor_contributions,
    ... )
    >>> rng = np.random.default_rng(0)
    >>> X = rng.normal(size=(60, 4))
    >>> y = rng.poisson(3 * np.exp(np.outer(X[:, 0], [-1, 0, 1]))) + 1
    >>> fusion = SensorFusionNNPOM({"pac": [0, 1], "tdc": [2, 3]})
    >>> scores = sensor_contributions(
    ...     DistributionalOrdinalRegressor(fusion), X, y, n_repeats=2, random_state=0
    ... )
    >>> summary = contribution_summary(scores, metric="rps").set_index("held_out")
    >>> (summary["difference"] > 0.05).to_dict()
    {'pac': True, 'tdc': False}
    """
    features, regressor = _split_model(model)
    X, y = indexable(X, y)
    groups = check_groups(groups, X)
    counts, _ = check_ratings(y, regressor.levels)
    objects = np.arange(len(counts)) if groups is None else groups
    splitter = make_splitter(regressor, y, groups, cv)
    starts = check_random_state(random_state).randint(
        np.iinfo(np.int32).max, size=n_repeats
    )
    folds = list(splitter.split(X, y, groups))
    parallel = Parallel(n_jobs=n_jobs)
    features_of = parallel(
        delayed(_compute_features)(features, X, y, train, test) for train, test in folds
    )
    tables = parallel(
        delayed(_score_start)(
            regressor,
            *features_of[fold],
            counts[train],
            counts[test],
            random_state=int(seed),
            groups=None if groups is None else objects[train],
            start=start,
            fold=fold,
            object=objects[test],
            trial=test,
        )
        for fold, (train, test) in enumerate(folds)
        for start, seed in enumerate(starts)
    )
    return pd.concat(tables, ignore_index=True)


def _split_model(model):
    """Return what computes the features, and the regressor of the fusion model."""
    features, regressor = FunctionTransformer(), model
    if isinstance(model, Pipeline):
        regressor = model[-1]
        features = model[:-1] if len(model) > 1 else features
    fusion = getattr(regressor, "estimator", None)
    if not (
        isinstance(regressor, DistributionalOrdinalRegressor)
        and isinstance(fusion, SensorFusionNNPOM)
    ):
        raise TypeError(
            "model must end in a DistributionalOrdinalRegressor of a "
            "SensorFusionNNPOM, whose sensors can be held out, but it ends in a "
            f"{type(regressor).__name__} of a {type(fusion).__name__}; use "
            "sensor_subsets for it."
        )
    if fusion.held_out is not None:
        raise ValueError(
            f"model has held_out={fusion.held_out!r} already; set it to None, so that "
            "the model is the full one."
        )
    return features, regressor


def _compute_features(transformer, X, y, train, test):
    """Features of the training and of the test trials of one fold."""
    transformer = clone(transformer)
    Z_train = transformer.fit_transform(
        _safe_indexing(X, train), _safe_indexing(y, train)
    )
    return Z_train, transformer.transform(_safe_indexing(X, test))


def _score_start(
    regressor, X_train, X_test, y_train, y_test, *, random_state, groups, **columns
):
    """Scores of the full model and the holdouts of one start on one fold."""
    models = fit_holdouts(
        regressor, X_train, y_train, random_state=random_state, groups=groups
    )
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "held_out": held_out,
                    **columns,
                    **score_trials(y_test, model.predict_proba(X_test)),
                }
            )
            for held_out, model in models.items()
        ]
    )


def contribution_summary(
    scores: pd.DataFrame,
    *,
    metric: str = "macro_mae",
    by: str | Sequence[str] | None = None,
) -> pd.DataFrame:
    """Summarise how much worse a model predicts without each sensor, and test it.

    Parameters
    ----------
    scores : DataFrame
        What `sensor_contributions` returned, or one with the further columns
        ``adjective`` and ``procedure``.
    metric : str, default="macro_mae"
        Name of the score.
    by : str or list of str, default=None
        Columns of ``scores``, for each of whose values there is a summary, such as
        ``"object"`` or ``["adjective", "procedure"]``. ``"threshold"`` is k in the
        terms of the ranked probability score, which then take the place of ``metric``:
        does a sensor help to tell ratings of at most k from higher ones?

    Returns
    -------
    summary : DataFrame
        A row for each sensor held out (and value of ``by``). Columns: those of ``by``;
        ``held_out``; ``full`` and ``full_sd``, the score of the full model, averaged
        over trials, its mean over starts and its standard deviation; ``holdout`` and
        ``holdout_sd``, the same without the sensor; ``difference`` and
        ``difference_sd`` of the two, positive if the sensor helps; ``H`` and
        ``p_starts`` of a Kruskal–Wallis test whether the scores of the starts differ;
        ``p_objects`` of a Wilcoxon signed-rank test whether the objects' differences,
        averaged over starts and trials, are centred at zero. There is no ``p_objects``
        by object.

    Raises
    ------
    ValueError
        If the metric or a column is unknown, there is no full model or no holdout,
        models are not scored on the same trials or some twice, there are fewer than two
        starts, a score is not finite, or ``by`` has "held_out" or "start".

    See Also
    --------
    sklearn_haptic.plotting.SensorContributionsDisplay : The same as a figure.

    Notes
    -----
    The Kruskal–Wallis test is the paper's [1]_. It asks whether another start might
    have made the difference, on the same objects. It ignores that other objects could
    have been chosen: on any few objects a useless sensor makes some difference by
    chance, and the more starts, the surer that is found. Starts share the networks of
    the sensors with the full model, which makes the test cautious.

    To say that a sensor helps with objects not seen yet, use ``p_objects``, for which
    each object is one observation; of fewer than six it is never below 0.05. It ignores
    that the objects of a cross-validation share training trials. Look at the sign of
    the difference too: a sensor that tells nothing often makes a model truly worse.

    No p is corrected for the number of rows: of twenty useless sensors, one is expected
    below 0.05.

    References
    ----------
    .. [1] B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
       distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020,
       section 3.2 and figure 12. :doi:`10.3389/fnbot.2019.00116`

    W. H. Kruskal and W. A. Wallis, "Use of ranks in one-criterion variance analysis",
    JASA 47, 583–621, 1952. :doi:`10.1080/01621459.1952.10483441`

    F. Wilcoxon, "Individual comparisons by ranking methods", Biometrics Bulletin 1,
    80–83, 1945. :doi:`10.2307/3001968`

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_haptic.model_selection import contribution_summary
    >>> scores = pd.DataFrame(
    ...     {
    ...         "held_out": ["none"] * 4 + ["pac"] * 4,
    ...         "start": [0, 0, 1, 1] * 2,
    ...         "fold": 0,
    ...         "object": ["foam", "cork"] * 4,
    ...         "trial": [0, 1] * 4,
    ...         "emd": [0.5, 0.3, 0.5, 0.5, 0.75, 0.75, 0.75, 0.75],
    ...     }
    ... )
    >>> summary = contribution_summary(scores, metric="emd")
    >>> summary[["held_out", "full", "holdout", "difference", "p_objects"]]
      held_out  full  holdout  difference  p_objects
    0      pac  0.45     0.75         0.3        0.5
    """
    if not hasattr(scores, "columns"):
        raise TypeError(
            f"scores is a {type(scores).__name__}; give a DataFrame, as "
            "sensor_contributions returns it."
        )
    by = [] if by is None else [by] if isinstance(by, str) else list(by)
    if "threshold" in by:
        scores, metric = _melt_thresholds(scores, by), "rps"
    paired = _pair_models(scores, metric, by)
    cells = paired.groupby(by, sort=False) if by else [((), paired)]
    summary = pd.DataFrame(
        [
            {**dict(zip(by, key)), "held_out": sensor, **row}
            for key, cell in cells
            for sensor, row in _compare_models(cell).items()
        ]
    )
    one_object = not {"object", "trial"}.isdisjoint(by)
    return summary.drop(columns="p_objects") if one_object else summary


def _melt_thresholds(scores, by):
    """Give each threshold a row, with its term of the ranked probability score."""
    terms = scores.filter(regex=r"^rps_\d+$").columns
    if terms.empty:
        raise ValueError(
            "scores has no column rps_1, rps_2, …, which by='threshold' requires; make "
            "scores with sensor_contributions."
        )
    keys = scores.columns.intersection([*by, *_UNIT, "held_out"], sort=False)
    long = scores[[*keys, *terms]].melt(keys, var_name="threshold", value_name="rps")
    return long.assign(threshold=long["threshold"].str.removeprefix("rps_").astype(int))


def _pair_models(scores, metric, by):
    """One score for each model, in columns, of each trial, fold and start, in rows."""
    missing = {"held_out", "start", "object", metric, *by}.difference(scores.columns)
    if missing:
        raise ValueError(
            f"scores has no column {sorted(missing)}; choose metric and by among "
            f"{list(scores.columns)}."
        )
    compared = {"held_out", "start"}.intersection(by)
    if compared:
        raise ValueError(
            f"by has {sorted(compared)}, which each summary compares; leave it out."
        )
    keys = [name for name in dict.fromkeys((*by, *_UNIT)) if name in scores]
    keys = [*keys, "held_out"]
    if scores[keys].isna().any(axis=None):
        blank = scores[keys].isna().any().idxmax()
        raise ValueError(
            f"scores has no value in some rows of {blank!r}; fill them in."
        )
    check_numbers(scores[metric], metric)
    values = scores.set_index(keys)[metric]

    def first(index):
        return ", ".join(map("{}={}".format, index.names, index[0]))

    twice = values.index.duplicated()
    if twice.any():
        raise ValueError(
            f"scores has several rows with {first(values.index[twice])}; summarise "
            "one run at a time."
        )
    bad = ~np.isfinite(values)
    if bad.any():
        raise ValueError(
            f"{metric} is not finite in the row with {first(values.index[bad])}; "
            "choose another metric, or decode='mixture', by which no rating has "
            "probability 0."
        )
    # In the order given: pandas 2 misplaces values in unstack(sort=False).
    rows = values.index.droplevel("held_out").unique()
    paired = values.unstack("held_out").reindex(rows)
    paired = paired[values.index.unique("held_out")]
    if FULL_MODEL not in paired or paired.shape[1] == 1:
        raise ValueError(
            f"held_out is {list(paired)} in scores; give the full model, "
            f"{FULL_MODEL!r}, and at least one holdout."
        )
    gaps = paired.isna()
    if gaps.any(axis=None):
        held_out = gaps.any().idxmax()
        raise ValueError(
            f"scores has no row with held_out={held_out}, "
            f"{first(paired.index[gaps[held_out]])}; score every model on the same "
            "trials and starts."
        )
    return paired


def _compare_models(paired):
    """Return, for each sensor held out, what its row of the summary says."""
    starts = paired.groupby("start").mean()
    objects = paired.groupby("object").mean()
    if len(starts) == 1:
        raise ValueError(
            "scores has one start, but standard deviations and tests require at least "
            "two; raise n_repeats."
        )
    full = starts[FULL_MODEL]
    return {
        sensor: {
            "full": full.mean(),
            "full_sd": full.std(),
            "holdout": holdout.mean(),
            "holdout_sd": holdout.std(),
            "difference": (holdout - full).mean(),
            "difference_sd": (holdout - full).std(),
            **_test_starts(full, holdout),
            "p_objects": _test_objects(objects[sensor] - objects[FULL_MODEL]),
        }
        for sensor, holdout in starts.drop(columns=FULL_MODEL).items()
    }


def _test_starts(full, holdout):
    """Kruskal–Wallis test; equal scores throughout are no evidence."""
    if np.ptp(np.append(full, holdout)) == 0:
        return {"H": 0.0, "p_starts": 1.0}
    result = kruskal(full, holdout)
    return {"H": result.statistic, "p_starts": result.pvalue}


def _test_objects(difference):
    """Wilcoxon's signed-rank test, of the objects that have a difference."""
    return wilcoxon(difference).pvalue if difference.any() else 1.0
