"""Whether a model predicts better than guessing, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone
from sklearn.compose import ColumnTransformer
from sklearn.frozen import FrozenEstimator
from sklearn.utils import Bunch, indexable
from sklearn.utils.parallel import Parallel, delayed

from ..metrics import noise_ceiling
from ..ratings._checks import check_adjectives, check_ratings
from ..recordings._faulty_trials import trial_columns
from ..recordings._trials import is_table
from ..utils._folds import make_splitter, route
from ..utils._report import Report, Table, as_texts
from ..utils._sklearn import (
    CrossValidator,
    HasMethods,
    Trials,
    _num_samples,
    _safe_indexing,
    validate_params,
)
from ..utils._validation import check_groups, count, is_text
from ._cost import predictor, seconds_per_trial, timed
from ._gains import (
    GUESSES,
    MODEL,
    compare_with_guesses,
    conclude,
    guess_out_of_fold,
    summarise_gains,
)
from ._out_of_fold import check_folds, fit_fold, join_folds, predict_fold

_SCORES = {
    "rps": "RPS",
    "emd": "EMD",
    "macro_mae": "MAE^M",
    "log_score": "log score",
    "dispersion": "dispersion",
}
_ANSWERS = {"better": "yes", "not shown": "not shown", "worse": "worse"}
_NOTE = (
    "RPS, EMD, MAE^M and the log score are errors of a predicted distribution, the "
    "first three in levels: lower is better. The dispersion is 1 if predictions are "
    "as broad as ratings scatter about them, less if they are too narrow. Guessing "
    "ignores the touch: it predicts the mean of the training objects' distributions, "
    "or the median of their cumulative ones; by RPS the better one counts."
)
_CEILING = (
    "The gain is how much lower the RPS of the model is than that of guessing. The "
    "best possible RPS is above 0 because people disagree: it is what to expect of a "
    "model that knows how the whole population would rate (the noise ceiling)."
)
_INFINITE = " ∞: a rating that people gave had been ruled out."


class _Model(Report):
    """What `model_report` returns."""

    def _parts(self):
        yield self.summary
        names, title = self.gains.index, "Scores on the test trials"
        if len(names) > 1:
            table = _gain_texts(self.gains)
            yield Table("RPS on the test trials", table, note=_CEILING)
            title += f", averaged over {len(names)} adjectives"
        elif names[0] != "ratings":
            title += f", {names[0]}"
        table = self.scores.groupby(level=1, sort=False).mean()
        note = _NOTE + _INFINITE * bool(np.isinf(table.to_numpy()).any())
        yield Table(title, _score_texts(table), note=note)
        yield self.conclusion


@validate_params(
    {
        "model": [HasMethods(["fit", "predict_proba"])],
        "y": [Mapping, "array-like"],
        "groups": ["array-like", None],
        "cv": ["cv_object"],
        "n_jobs": [Integral, None],
        "params": [dict, None],
    },
    prefer_skip_nested_validation=False,
)
def model_report(
    model: BaseEstimator,
    X: Trials,
    y: Mapping[str, ArrayLike] | ArrayLike,
    *,
    groups: ArrayLike | None = None,
    cv: CrossValidator = None,
    n_jobs: int | None = None,
    params: Mapping[str, Any] | None = None,
) -> Bunch:
    """Report how well a model predicts, beside guessing, and what it costs.

    For each adjective and fold, a clone of the model is fitted to the training trials
    and predicts the test trials, and so do both strategies of
    :class:`~sklearn_haptic.DummyDistribution`, which ignore the touch. A notebook shows
    the result as a table, and `print` as text; its last sentence says how much better
    than guessing the model is, or that it is not.

    Parameters
    ----------
    model : estimator object
        The model to report on, such as a Pipeline or a search, fitted or not.
    X : DataFrame, array-like or collection of trials
        The trials, in any form that the model takes.
    y : array-like of shape (n_trials,), (n_trials, n_levels) or \
            (n_trials, n_adjectives, n_levels), or dict of str to array-like
        Labels, how many people gave each level, or such counts of several adjectives,
        which are learned together. Of a dict, such as the ratings of a corpus, each
        entry is learned by a model of its own.
    groups : array-like of shape (n_trials,), default=None
        The object of each trial. By default each trial is of another object, which
        makes scores look better than they are if that is not so.
    cv : int, splitter or iterable of (train, test), default=None
        The folds, as in :func:`cross_val_predict_proba`, which need not test each trial
        here: ``[(train, test)]`` reports on the given test trials.
    n_jobs : int, default=None
        Number of jobs, each of which fits and predicts one fold. Times are right with
        one.
    params : dict, default=None
        Arguments of the model's ``fit``, as in :func:`cross_val_predict_proba`.

    Returns
    -------
    report : :class:`~sklearn.utils.Bunch`
        Dictionary-like object with attributes:

        scores : DataFrame
            One row per adjective and predictor ("model", "marginal", "barycentre"), one
            column per score, averaged over test trials: ``rps``, ``emd`` and
            ``macro_mae`` in levels, ``log_score`` in nats, and ``dispersion``.
        gains : DataFrame
            One row per adjective: the ``rps`` of the model; ``rps_guess``, the lower
            one of the two baselines; their difference ``gain``, positive if the model
            is better, and its ``standard_error``, paired over objects; ``rps_ceiling``,
            what the whole population is expected to score, by
            :func:`~sklearn_haptic.metrics.noise_ceiling`, NaN where a trial has fewer
            than two ratings; ``verdict``:
            "better" or "worse" if the 95% interval of the gain, by Student's t, has
            only positive or only negative values, else "not shown".
        seconds_to_learn : float
            Mean duration of a fit.
        seconds_per_touch : float
            Mean time to predict a trial on its own, see :func:`neg_seconds_scorer`.
        tested : ndarray of shape (n_tested,)
            The test trials, as rows of ``X``, in ascending order.
        predicted : dict of str to ndarray of shape (n_tested, n_levels)
            For each adjective, what the model predicted for them.
        summary, conclusion : str
            What was done, and what came out.

    Raises
    ------
    ValueError
        As :func:`cross_val_predict_proba`; a trial may be tested once or not at all.

    See Also
    --------
    cross_val_predict_proba : Predictions alone.
    sklearn_haptic.plotting.ReliabilityDisplay : Whether the predictions are calibrated.

    Notes
    -----
    The standard error takes each object for one observation, however often it was
    touched. It ignores that the folds of a cross-validation share training trials. No
    verdict is corrected for the number of adjectives: of twenty that cannot be felt,
    one is expected to look better or worse. If settings were chosen on these trials,
    report on others, or give the search that chooses as the model.

    Examples
    --------
    >>> from sklearn_haptic import make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.model_selection import model_report
    >>> corpus = make_haptic_corpus(20, 2, sensors=["pdc", "tdc"], random_state=0)
    >>> report = model_report(
    ...     make_haptic_pipeline(["pdc", "tdc"], random_state=0),
    ...     corpus.trials,
    ...     {name: corpus.ratings[name] for name in ("cold", "sticky")},
    ...     groups=corpus.objects,
    ... )
    >>> report.gains["verdict"]
    adjective
    cold         better
    sticky    not shown
    Name: verdict, dtype: ...
    """
    targets = dict(y) if isinstance(y, Mapping) else {"ratings": y}
    if not targets:
        raise ValueError("y has no adjectives; give the ratings of one or more.")
    params = {} if params is None else params
    groups = params.get("groups") if groups is None else groups
    X, *ratings = indexable(X, *targets.values())
    groups = check_groups(groups, X)
    splitter = make_splitter(model, ratings[0], groups, cv)
    for_split, for_fit = route(model, splitter, groups, params)
    folds = check_folds(
        splitter.split(X, ratings[0], **for_split), _num_samples(X), least=0
    )
    outcomes = Parallel(n_jobs=n_jobs)(
        delayed(_fit_and_time)(clone(model), X, each, *fold, for_fit)
        for each in ratings
        for fold in folds
    )
    counts: dict[str, np.ndarray] = {}
    predicted: dict[str, np.ndarray] = {}
    scales = []
    for i, (name, each) in enumerate(zip(targets, ratings)):
        of_target = outcomes[i * len(folds) : (i + 1) * len(folds)]
        proba, levels = join_folds(each, [fold[:2] for fold in of_target], folds)
        if is_text(levels) and np.ndim(each) == 1 and not _is_given(model, "levels"):
            check_ratings(each, name=name)  # warns of words without an order
        truth, _ = check_adjectives(each, levels, name=name)
        scales.append(f"{levels[0]} to {levels[-1]}")
        counts |= _by_adjective(name, truth)
        predicted |= _by_adjective(name, proba)
    tested = np.sort(np.concatenate([test for _, test in folds]))
    scores, gains, conclusion = _compare(counts, predicted, folds, tested, groups)
    result = _Model(
        scores=scores,
        gains=gains,
        seconds_to_learn=float(np.mean([fold[2] for fold in outcomes])),
        seconds_per_touch=float(np.mean([fold[3] for fold in outcomes])),
        tested=tested,
        predicted=predicted,
        conclusion=conclusion,
    )
    parts = [model, *model.get_params().values()]
    by = _by_what(model, X)
    result["summary"] = _summary(result, folds, groups, by, scales, parts)
    return result


def _fit_and_time(model, X, y, train, test, params):
    """Return the predictions of a fold, their levels, and both times in seconds."""
    _, to_learn = timed(fit_fold, model, X, y, train, params)
    X_test = _safe_indexing(X, test)
    outcome = predict_fold(model, X_test)
    return *outcome, to_learn, seconds_per_trial(predictor(model), X_test)


def _is_given(model, name):
    """Whether the model, or a part of it, is given a parameter of this name."""
    return any(
        key.split("__")[-1] == name and value is not None
        for key, value in model.get_params().items()
    )


def _by_adjective(name, values):
    """Return arrays by adjective; those learned together are told by their number."""
    if values.ndim == 2:
        return {name: values}
    return {f"{name}[:, {i}]": values[:, i] for i in range(values.shape[1])}


def _compare(counts, predicted, folds, tested, groups):
    """Return the tables of scores and gains, and the conclusion."""
    objects = tested if groups is None else groups[tested]
    rows, of_trials, table = {}, [], {}
    for name, each in counts.items():
        guesses = {guess: guess_out_of_fold(guess, each, folds) for guess in GUESSES}
        scores, gains, rps_guess = compare_with_guesses(
            each[tested], predicted[name], guesses
        )
        rows |= {(name, predictor): row for predictor, row in scores.items()}
        of_trials.append(gains)
        rps = {
            "rps": scores[MODEL]["rps"],
            "rps_guess": rps_guess,
            "rps_ceiling": _ceiling(each[tested]),
        }
        table[name] = {**rps, **summarise_gains(gains, objects)}
    scores = pd.DataFrame.from_dict(rows, orient="index")
    scores.index = pd.MultiIndex.from_tuples(rows, names=["adjective", "predictor"])
    gains = pd.DataFrame.from_dict(table, orient="index")
    gains.index.name = "adjective"
    overall = {
        **gains[["rps", "rps_guess"]].mean(),
        **summarise_gains(np.mean(of_trials, axis=0), objects),
    }
    n = len(np.unique(objects))
    return scores, gains, conclude(gains, overall, n, groups is not None)


def _ceiling(counts):
    """Return the expected RPS of the population, NaN if a trial has one rating."""
    if (counts.sum(axis=1) < 2).any():
        return np.nan
    return noise_ceiling(counts).truth


def sensors_of(model, X):
    """Return the names of the columns of trials that a model takes, None if unknown.

    Examples
    --------
    >>> import pandas as pd
    >>> from sklearn_haptic import make_haptic_pipeline
    >>> from sklearn_haptic.model_selection._model_report import sensors_of
    >>> trials = pd.DataFrame({"pac": [[[0.0]]], "pdc": [[[1.0]]]})
    >>> sensors_of(make_haptic_pipeline(["pdc"]), trials)
    ['pdc']
    >>> sensors_of(make_haptic_pipeline(), trials[["pac"]].to_numpy())
    """
    if not isinstance(X, pd.DataFrame):
        return None
    taken: set[Any] = set()
    for part in [model, *model.get_params().values()]:
        if isinstance(part, ColumnTransformer):
            for _, _, columns in part.transformers:
                taken.update([columns] if isinstance(columns, str) else columns)
    names = [str(name) for name in trial_columns(X)]
    return [name for name in names if name in taken] or names or None


def _summary(result, folds, groups, by, scales, parts):
    """Say what was learned from, what was predicted, and how long that took."""
    it = f"In each of {len(folds)} folds it" if len(folds) > 1 else "It"
    n_train = [len(train) for train, _ in folds]
    tested, learned = _range(len(result.tested)), _range(*n_train)
    if groups is not None:
        tested += f" of {count(len(np.unique(groups[result.tested])), 'objects')}"
        n_objects = [len(np.unique(groups[train])) for train, _ in folds]
        learned += f" of {_range(*n_objects, unit='objects')}"
    each = " per adjective" * (len(scales) > 1)
    scale = " or ".join(dict.fromkeys(scales))
    text = (
        f"The model predicted ratings from {scale} in {tested}. {it} had learned "
        f"from {learned}{by}. Learning took "
        f"{result.seconds_to_learn:.3g} s{each}, and predicting "
        f"{1e3 * result.seconds_per_touch:.3g} ms per touch."
    )
    if any(isinstance(part, FrozenEstimator) for part in parts):
        text += (
            " What is frozen had learned before: if from test objects too, the model "
            "is worse on new objects than it looks."
        )
    return text + _overlap(folds, groups)


def _by_what(model, X):
    """Say which sensors recorded what a model takes, or that it takes features."""
    if is_table(X):
        return ", given as features"
    sensors = sensors_of(model, X)
    return f", recorded by {', '.join(sensors)}" if sensors else ""


def _range(*values, unit="trials"):
    low, high = min(values), max(values)
    return count(low, unit) if low == high else f"{low} to {high} {unit}"


def _overlap(folds, groups):
    """Warn of objects that are touched in training and in the test."""
    if groups is None:  # which the conclusion tells
        return ""
    known = [np.isin(groups[test], groups[train]).sum() for train, test in folds]
    if not sum(known):
        return " No test object was touched in training."
    return (
        f" But {count(sum(known), 'test trials')} are of objects that were touched in "
        "training, so that the model is worse on new objects than it looks."
    )


def _score_texts(scores):
    """Return scores as text: errors with three decimals."""
    texts = {name: (title, _number) for name, title in _SCORES.items()}
    names = {
        MODEL: "the model",
        "marginal": "guess: mean",
        "barycentre": "guess: median",
    }
    return as_texts(scores, texts).rename(index=names).rename_axis(None)


def _number(value):
    return "∞" if np.isinf(value) else f"{value:.3f}"


def _gain_texts(gains):
    """Return what is gained on each adjective as text."""
    number = "{:.3f}".format
    return as_texts(
        gains,
        {
            "rps": ("the model", number),
            "rps_guess": ("guessing", number),
            "gain": ("gain", number),
            "standard_error": ("standard error", number),
            "rps_ceiling": ("best possible", number),
            "verdict": ("better than guessing?", _ANSWERS.get),
        },
    )
