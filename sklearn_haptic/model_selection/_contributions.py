"""Scores of a model with all its sensors, and without each of them.

A *holdout* is a model whose combined network was trained again with the activations of
one sensor set to zero. How much worse it predicts than the full model is what that
sensor contributes. A *start* is one draw of all random weights.
"""

from __future__ import annotations

from numbers import Integral

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils import check_random_state
from sklearn.utils.parallel import Parallel, delayed

from ..ensembles._out_of_fold import check_folds, warn_of_divided, warn_of_frozen
from ..metrics._trial_scores import predict_and_score
from ..models import DistributionalOrdinalRegressor, SensorFusionNNPOM
from ..ratings._checks import check_adjectives, check_rated
from ..utils._folds import make_splitter
from ..utils._sklearn import (
    CrossValidator,
    Interval,
    RandomState,
    Trials,
    _safe_indexing,
    validate_params,
)
from ..utils._validation import check_groups

# Value of `held_out` in tables for the model that has all sensors.
FULL_MODEL = "none"


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
    """Score a model that combines sensors, with all of them and without each.

    For each fold and each of several random starts, the full model and one model
    without each sensor are fitted and predict the test trials [1]_. The networks of the
    sensors are fitted once per start and shared by all models of that start.

    Parameters
    ----------
    model : DistributionalOrdinalRegressor or Pipeline
        A regressor whose ``estimator`` is a :class:`~sklearn_haptic.SensorFusionNNPOM`,
        or a Pipeline that ends in one and passes DataFrames on to it, so that it can
        tell the sensors by the names of their columns. Frozen networks of sensors are
        not fitted again; only the combined network then has random starts.
    X : DataFrame or array-like of shape (n_trials, n_columns)
        The trials.
    y : array-like of shape (n_trials, n_levels) or (n_trials,)
        How many people gave the trial's object each rating, or one rating. Counts of
        several adjectives, of shape (n_trials, n_adjectives, n_levels), are learned
        together.
    groups : array-like of shape (n_trials,), default=None
        The object of each trial; by default each trial is of another object. It is
        passed to the splitter and to ``fit``, which may need it to stop early.
    cv : int, splitter or iterable of (train, test), default=None
        The folds. An int, or None for 5, is a number of folds: of whole objects if
        ``groups`` are given, else as in
        :class:`~sklearn.model_selection.GridSearchCV`. For given training and test
        trials pass ``[(train, test)]``.
    n_repeats : int, default=10
        Number of random starts; a summary requires at least 2.
    random_state : int, RandomState instance or None, default=None
        Seed of the starts. It replaces the random states of the regressor and its
        networks; the other steps of a Pipeline keep theirs. Pass an int for the same
        table in every call.
    n_jobs : int, default=None
        Number of jobs, each of which fits and scores all models of one start on one
        fold. The table is the same for any number.

    Returns
    -------
    scores : DataFrame
        One row per model and test trial. Columns: ``held_out``, the sensor left out,
        or "none" for the full model; ``start`` and ``fold``, counted from 0;
        ``object``; ``trial``, the row of ``X``; and the scores, lower being better:
        ``macro_mae``, ``emd`` and ``rps`` in levels, ``log_score`` in nats, and
        ``rps_1``, …, the terms of the ranked probability score (RPS) at the thresholds
        between levels k and k + 1, which sum to ``rps``. A model that decodes as in
        the paper has the ``macro_mae`` of its ratings as it predicts them, unsorted.
        Several adjectives have a row each and are counted from 0 in a further column,
        ``adjective``.

    Raises
    ------
    TypeError
        If ``model`` does not end in a regressor of a ``SensorFusionNNPOM``.
    ValueError
        If ``model`` already leaves a sensor out, or a sensor is called "none"; if a
        fold trains on a trial that it tests.

    Warns
    -----
    UserWarning
        If a fold trains on some trials of a group and tests others, or networks are
        frozen, which may have learned from test trials.

    See Also
    --------
    contribution_summary : Differences between the models, and tests of them.
    sensor_subsets : Score any model with every set of its sensors, and time it.
    sklearn_haptic.plotting.SensorContributionsDisplay : Plot the scores.

    Notes
    -----
    A model without one sensor shows what that sensor adds to all others, which is
    nothing if another sensor tells the same.

    References
    ----------
    .. [1] Richardson and Kuchenbecker (2020), section 2.3.3.
       :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    Vibration tells how people rate these objects, but temperature does not.

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
    X, y = check_rated(X, y)
    groups = check_groups(groups, X, y)
    counts, _ = check_adjectives(y, regressor.levels)
    objects = np.arange(len(counts)) if groups is None else groups
    splitter = make_splitter(regressor, y, groups, cv)
    starts = check_random_state(random_state).randint(
        np.iinfo(np.int32).max, size=n_repeats
    )
    folds = check_folds(splitter.split(X, y, groups), len(counts), least=None)
    warn_of_divided(folds, groups)
    warn_of_frozen([model], stacklevel=4)
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
    """Return the steps that compute the features, and the regressor after them."""
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
            "SensorFusionNNPOM; use sensor_subsets for others."
        )
    if fusion.held_out is not None:
        raise ValueError(
            f"model has held_out={fusion.held_out!r} already; set it to None."
        )
    return features, regressor


def _compute_features(transformer, X, y, train, test):
    """Compute the features of the training trials and of the test trials of a fold."""
    transformer = clone(transformer)
    Z_train = transformer.fit_transform(
        _safe_indexing(X, train), _safe_indexing(y, train)
    )
    return Z_train, transformer.transform(_safe_indexing(X, test))


def _score_start(
    regressor, X_train, X_test, y_train, y_test, *, random_state, groups, **columns
):
    """Score the full model, and the models without each sensor, on one fold."""
    models = fit_holdouts(
        regressor, X_train, y_train, random_state=random_state, groups=groups
    )
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "held_out": held_out,
                    **columns,
                    **({"adjective": i} if y_test.ndim == 3 else {}),
                    **scores,
                }
            )
            for held_out, model in models.items()
            for i, scores in enumerate(predict_and_score(model, X_test, y_test)[1])
        ]
    )


def fit_holdouts(regressor, X, y, *, random_state, groups=None, X_val=None, y_val=None):
    """Fit the full model, and one holdout per sensor, from one start.

    The networks of the sensors are fitted once, with the full model; the holdouts share
    them.

    Parameters
    ----------
    regressor : DistributionalOrdinalRegressor
        A regressor whose estimator is a `SensorFusionNNPOM`; it is cloned.
    X, y, groups, X_val, y_val
        As in :meth:`DistributionalOrdinalRegressor.fit`.
    random_state : int
        The start.

    Returns
    -------
    models : dict of str to DistributionalOrdinalRegressor
        The fitted models by the sensor held out. The first, ``"none"``, is the full
        model; no sensor may be called so, else a ValueError is raised.

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
