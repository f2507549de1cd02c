"""Whether a model predicts better than guessing, and what it costs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.stats import t as student
from sklearn.base import BaseEstimator, clone, is_classifier
from sklearn.utils import Bunch
from sklearn.utils.parallel import Parallel, delayed

from ..ensembles import ConformalRatings
from ..ensembles._out_of_fold import (
    FROZEN,
    POSITIONS,
    check_folds,
    check_folds_know,
    fit_fold,
    in_order,
    predict_fold,
)
from ..metrics import crps, dispersion, noise_ceiling
from ..metrics._score import mean_over_objects
from ..metrics._trial_scores import score_trials
from ..models import ContinuousRatingsRegressor, DummyDistribution
from ..models._ordinal import DistributionMixin
from ..ratings._checks import check_adjectives, check_rated
from ..ratings._continuous import check_answers
from ..ratings._levels import levels_set_in, names_levels
from ..utils._folds import groups_among, groups_for, make_splitter
from ..utils._pipeline_steps import is_frozen, last_step
from ..utils._report import Report
from ..utils._row_order import check_orders
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
from ._cross_val_predict_proba import join_folds

_GUESSES = ("marginal", "barycentre")
_ERRORS = ("rps", "emd", "macro_mae", "log_score")
_LEVELS, _CLASSES, _SLIDERS = "levels", "classes", "sliders"  # kinds of ratings
_METHODS = {
    _LEVELS: None,  # probabilities
    _CLASSES: "predict",
    _SLIDERS: "predict_quantile",
}
_SCORE = {_LEVELS: "RPS", _CLASSES: "accuracy", _SLIDERS: "CRPS"}
_MOST_LEVELS = 10  # that whole numbers may be without a word of what they are
_READING = {
    _LEVELS: "Labels were read as levels; as text (astype(str)) they are classes. ",
    _CLASSES: "Labels were read as classes; an ordered pandas.Categorical has levels. ",
}
_VERDICTS = {
    "better": "is better than guessing",
    "not shown": "is not shown to be better than guessing",
    "worse": "is worse than guessing",
}


class _Model(Report):
    """What `model_report` returns."""

    def _parts(self):
        yield self.summary
        yield self.gains
        yield self.scores.groupby(level=1, sort=False).mean()
        if self.confusions is not None:
            yield from self.confusions.values()
        yield self.conclusion


@validate_params(
    {
        "model": [HasMethods(["fit"])],
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
    :class:`~sklearn_haptic.DummyDistribution`, which ignore the touch; classes without
    an order are guessed to be the most frequent one of all trials. Sliders are those
    that a `ContinuousRatingsRegressor` predicts, around or behind any steps. A notebook
    shows the result as tables, and `print` as text; its last sentence says how much
    better than guessing the model is, or that it is not.

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
        entry is learned by a model of its own. Answers on sliders are as in
        `ContinuousRatingsRegressor`. Labels are levels if they are an ordered
        categorical or the model has ``levels``. Otherwise words are classes, and so are
        numbers if the model is a classifier of scikit-learn. A model of ratings takes
        numbers for levels, but more than ten different whole numbers are refused.
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
            ``macro_mae`` in levels, ``log_score`` in nats, lower being better, and
            ``dispersion``, which is below 1 where predictions are narrower than ratings
            scatter. Of classes ``accuracy`` and ``balanced_accuracy``, the mean over
            classes, of "model" and "most frequent". Of sliders ``crps``.
        gains : DataFrame
            One row per adjective: its ``levels``; the ``dispersion`` of the model;
            ``rps_ceiling``, what the whole population is expected to score, by
            :func:`~sklearn_haptic.metrics.noise_ceiling`, NaN where a trial has fewer
            than two ratings; the ``rps`` of the model; ``rps_guess``, the lower one of
            the two baselines; their difference ``gain``, positive if the model is
            better, with its ``standard_error``, paired over objects, and the ends
            ``lower`` and ``upper`` of its 95% interval by Student's t; ``verdict``,
            "better" or "worse" if the interval has only positive or only negative
            values, else "not shown". Where one object has most trials, the standard
            error is too small, but the interval allows for it. Of classes the gain is
            that of ``accuracy`` over ``accuracy_guess``, and of sliders that of
            ``crps``.
        confusions : dict of str to DataFrame, or None
            How many trials of each class (row) were taken for each (column).
        seconds_to_learn : float
            Mean duration of a fit.
        seconds_per_touch : float
            Mean time to predict a trial on its own, see :func:`neg_seconds_scorer`.
        tested : ndarray of shape (n_tested,)
            The test trials, as rows of ``X``, in ascending order.
        predicted : dict of str to ndarray of shape (n_tested, n_levels)
            For each adjective, what the model predicted for them; of classes labels, of
            shape (n_tested,); of sliders quantiles, as :func:`cross_val_predict_proba`.
        summary, conclusion : str
            What was done, and what came out. Gains of several adjectives are averaged
            as they are, so report on scales of different units one by one.

    Raises
    ------
    ValueError
        As :func:`cross_val_predict_proba`; a trial may be tested once or not at all. If
        nothing tells whether whole numbers are classes or levels, or no fold trains on
        a class that it tests.

    See Also
    --------
    cross_val_predict_proba : Predictions alone.
    sklearn_haptic.plotting.ReliabilityDisplay : Whether the predictions are calibrated.

    Notes
    -----
    The interval takes each object for one observation, however often it was touched
    [1]_. It ignores that the folds of a cross-validation share training trials, and
    that few objects may gain or lose much, so that it held the true gain in 83 to 88%
    of simulated corpora of 12 or 20 objects (`benchmarks/claims.py`); the others mostly
    gained more. Of classes it is too narrow where nearly all are named right, and has
    no width where all are. No verdict is corrected for the number of adjectives: of
    forty that cannot be felt, one is expected to look better; of seven by a
    `DistributionBlend`, if the ratings of few objects are spread evenly over the
    levels, because its exponent, unlike the guess, flattens what they tell of the mean.
    More look worse, and rightly so: a model that learned chance predicts too narrow
    distributions, with a dispersion below 1, and a larger penalty mends it. If settings
    were chosen on these trials, report on others, or give the search that chooses as
    the model.

    References
    ----------
    .. [1] R. M. Bell and D. F. McCaffrey, "Bias reduction in standard errors for linear
       regression with multi-stage samples", Survey Methodology 28, 169–181, 2002.

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
    groups = groups_among(params) if groups is None else groups
    several = isinstance(y, Mapping)
    named = {f"y[{name!r}]" if several else "y": each for name, each in targets.items()}
    check_orders(X=X, **named, **{**params, "groups": groups})
    X, *ratings = check_rated(X, *targets.values())
    groups = check_groups(groups, X)
    targets, kind = _checked(model, dict(zip(targets, ratings)))
    ratings = [*targets.values()]
    splitter = make_splitter(model, ratings[0], groups, cv)
    for_fit = groups_for(model, groups) | dict(params)
    folds = check_folds(splitter.split(X, ratings[0], groups), _num_samples(X), least=0)
    if kind == _CLASSES:
        for each in ratings:
            check_folds_know(each, folds)
    outcomes = Parallel(n_jobs=n_jobs)(
        delayed(_fit_and_time)(model, X, each, *fold, for_fit, _METHODS[kind])
        for each in ratings
        for fold in folds
    )
    results = _compare(model, targets, outcomes, folds, groups, kind)
    seconds = np.mean([fold[2:] for fold in outcomes], axis=0)
    report = _Model(
        **results,
        seconds_to_learn=float(seconds[0]),
        seconds_per_touch=float(seconds[1]),
    )
    unit = "group" if kind == _CLASSES else "object"
    unnamed = levels_set_in(model) is None and any(
        np.ndim(each) == 1 and not names_levels(each) for each in ratings
    )
    report["summary"] = _READING.get(kind, "") if unnamed else ""
    report["summary"] += _summary(report, folds, groups, unit, is_frozen(model))
    if kind == _CLASSES:
        report["summary"] += _unlearned(ratings, folds)
    return report


def _checked(model, targets):
    """Check the ratings of each adjective; return them, and of what kind all are."""
    if _slider(model):
        answers = {n: check_answers(each, n) for n, each in targets.items()}
        single = {n: each[:, 0] for n, each in answers.items() if each.shape[1] == 1}
        return answers | single, _SLIDERS
    kinds = {_has_classes(model, each, name) for name, each in targets.items()}
    if len(kinds) > 1:
        raise ValueError(
            "y has classes without an order beside ratings; report on them in two "
            "calls."
        )
    for name, each in targets.items():
        if np.ndim(each) > 1:
            check_adjectives(each, name=name)
    return targets, _CLASSES if kinds.pop() else _LEVELS


def _slider(model):
    """Return the model of sliders at the end of a model, or None."""
    last, _ = last_step(model)
    if isinstance(last, ConformalRatings):
        last, _ = last_step(last.estimator)
    return last if isinstance(last, ContinuousRatingsRegressor) else None


def _compare(model, targets, outcomes, folds, groups, kind):
    """Compare the model with guessing on each adjective, and on their average."""
    tested = np.sort(np.concatenate([test for _, test in folds]))
    objects = tested if groups is None else groups[tested]
    scores: dict[Any, Any] = {}
    gains, of_trials, predicted, confusions = {}, [], {}, {}
    compare = {
        _LEVELS: partial(_compare_ratings, model),
        _CLASSES: _compare_classes,
        _SLIDERS: partial(_compare_sliders, _slider(model)),
    }[kind]
    for i, (name, y) in enumerate(targets.items()):
        of_target = outcomes[i * len(folds) : (i + 1) * len(folds)]
        of_target = [fold[:2] for fold in of_target]
        compared = compare(name, y, of_target, folds, tested)
        for label, each, by_predictor, gain, row in compared:
            predicted[label] = each
            scores |= {(label, who): each for who, each in by_predictor.items()}
            gains[label] = {**row, **gain_over_objects(gain, objects)}
            of_trials.append(gain)
        if kind == _CLASSES:
            true = pd.Series(np.asarray(y)[tested], name="true")
            taken_for = pd.Series(predicted[name], name="predicted")
            table = pd.crosstab(true, taken_for)
            every = table.index.union(table.columns)
            table = table.reindex(index=every, columns=every, fill_value=0)
            confusions[name] = table.rename_axis(index="true", columns="predicted")
    table = pd.DataFrame.from_dict(scores, orient="index")
    table.index = pd.MultiIndex.from_tuples(scores, names=["adjective", "predictor"])
    overall = gain_over_objects(np.mean(of_trials, axis=0), objects)
    unit = "trials" if groups is None else "groups" if kind == _CLASSES else "objects"
    n = count(len(np.unique(objects)), unit)
    return {
        "scores": table,
        "gains": pd.DataFrame.from_dict(gains, orient="index").rename_axis("adjective"),
        "confusions": confusions or None,
        "tested": tested,
        "predicted": predicted,
        "conclusion": _conclusion(overall, n, len(gains), kind),
    }


def _has_classes(model, y, name):
    """Whether ratings are labels without an order, see `model_report`."""
    if np.ndim(y) != 1 or levels_set_in(model) is not None or names_levels(y):
        return False
    values = np.asarray(y)
    if is_text(values) or hasattr(getattr(y, "dtype", None), "categories"):
        return True
    predictor = last_step(model)[0]
    if is_classifier(predictor) and not isinstance(predictor, DistributionMixin):
        return True
    distinct = np.unique(values) if values.dtype.kind in "iuf" else []
    if len(distinct) > _MOST_LEVELS and (distinct == np.round(distinct)).all():
        raise ValueError(
            f"{name} has {len(distinct)} different whole numbers, of classes "
            "or of levels; give text for classes (astype(str)), or an ordered "
            "pandas.Categorical for levels."
        )
    return False


def _fit_and_time(model, X, y, train, test, params, method):
    """Return the predictions of a fold, their levels, and both times in seconds."""
    fitted, to_learn = timed(fit_fold, model, X, y, train, params)
    X_test = _safe_indexing(X, test)
    outcome = predict_fold(fitted, X_test, method)
    return *outcome, to_learn, seconds_per_trial(predictor(fitted), X_test)


def _compare_ratings(model, name, y, outcomes, folds, tested):
    """Score the distributions predicted of each adjective beside both baselines.

    Yield the adjective, what the model predicts, the scores of all predictors, by how
    much the RPS of each trial is lower than that of the better baseline, and means.
    """
    proba, levels = join_folds(model, y, outcomes, folds)
    counts, _ = check_adjectives(y, levels, name=name)
    for i in range(counts.shape[1]) if counts.ndim == 3 else [...]:
        each = counts[:, i]
        true, by_predictor = each[tested], {"model": proba[:, i]}
        for guess in _GUESSES:
            dummy = DummyDistribution(guess)
            by_predictor[guess] = _guessed(dummy, each, folds)
        of_trials = {who: score_trials(true, p) for who, p in by_predictor.items()}
        scores = {
            who: {error: float(values[error].mean()) for error in _ERRORS}
            | {"dispersion": dispersion(true, by_predictor[who])}
            for who, values in of_trials.items()
        }
        two = (true.sum(axis=1) >= 2).all()
        ceiling = noise_ceiling(true).truth if two else np.nan
        gain, means = _gain("rps", of_trials, scores, ceiling)
        row = {
            "levels": f"{levels[0]} to {levels[-1]}",
            "dispersion": scores["model"]["dispersion"],
        } | means
        label = name if i is ... else f"{name}[:, {i}]"
        yield label, proba[:, i], scores, gain, row


def _compare_sliders(model, name, y, outcomes, folds, tested):
    """Score the quantiles predicted of sliders, and those of both baselines.

    Yield what `_compare_ratings` does, by the CRPS.
    """
    true, by_predictor = y[tested], {}
    by_predictor["model"] = in_order([each for each, _ in outcomes], folds)
    for guess in _GUESSES:
        dummy = clone(model).set_params(estimator=DummyDistribution(guess))
        by_predictor[guess] = _guessed(dummy, y, folds, "predict_quantile")
    of_trials = {
        who: {"crps": crps(true, POSITIONS, quantiles, average=False)}
        for who, quantiles in by_predictor.items()
    }
    scores = {who: {"crps": e["crps"].mean()} for who, e in of_trials.items()}
    two = true.ndim == 2 and ((~np.isnan(true)).sum(axis=1) >= 2).all()
    ceiling = noise_ceiling(true, crps).truth if two else np.nan
    gain, row = _gain("crps", of_trials, scores, ceiling)
    yield name, by_predictor["model"], scores, gain, row


def _gain(score, of_trials, scores, ceiling):
    """Return by how much the model beats the better guess in each trial, and means."""
    best = min(_GUESSES, key=lambda guess: scores[guess][score])
    means = [ceiling, scores["model"][score], scores[best][score]]
    row = dict(zip([f"{score}_ceiling", score, f"{score}_guess"], means))
    return of_trials[best][score] - of_trials["model"][score], row


def _guessed(dummy, y, folds, method=None):
    """Return what a model that ignores the trials predicts for the tested ones."""
    parts = []
    for train, test in folds:
        fitted = clone(dummy).fit(train[:, None], y[train])
        parts.append(predict_fold(fitted, test[:, None], method)[0])
    return in_order(parts, folds)


def _compare_classes(name, y, outcomes, folds, tested):
    """Score the classes predicted beside the most frequent one of all trials.

    That of a fold's training trials would be the rarest of those it tests, if classes
    are equally frequent, and any model would look better than guessing.

    Yield what `_compare_ratings` does, by the accuracy.
    """
    y = np.asarray(y)
    true, predicted = y[tested], in_order([each for each, _ in outcomes], folds)
    frequent = np.full(len(tested), pd.Series(y).mode()[0])
    by_predictor = {"model": predicted, "most frequent": frequent}
    scores, right = {}, {}
    for who, each in by_predictor.items():
        right[who] = pd.Series((each == true).astype(float))
        scores[who] = {
            "accuracy": right[who].mean(),
            "balanced_accuracy": right[who].groupby(true).mean().mean(),
        }
    row = {
        "accuracy": scores["model"]["accuracy"],
        "accuracy_guess": scores["most frequent"]["accuracy"],
    }
    gain = (right["model"] - right["most frequent"]).to_numpy()
    yield name, predicted, scores, gain, row


def gain_over_objects(gains, objects):
    """Return the mean gain of trials, its error and interval over objects, and verdict.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.model_selection._model_report import gain_over_objects
    >>> gain_over_objects(np.array([1.0, 3.0, 2.0, 2.5]), ["a", "a", "b", "b"])
    {'gain': 2.125, 'standard_error': 0.125, 'lower': ..., 'verdict': 'better'}
    """
    gain, error, freedom = mean_over_objects(gains, objects)
    margin = error * student.ppf(0.975, freedom)
    verdict = "not shown"
    if abs(gain) > max(margin, 1e-12):  # of rounding
        verdict = "better" if gain > 0 else "worse"
    return {
        "gain": gain,
        "standard_error": error,
        "lower": float(gain - margin),
        "upper": float(gain + margin),
        "verdict": verdict,
    }


def _summary(report, folds, groups, unit, frozen):
    """Say what was predicted from what, how long it took, and what makes it unfair."""
    learned = min(len(train) for train, _ in folds)
    text = (
        f"{count(len(report.tested), 'trials')} were predicted in "
        f"{count(len(folds), 'folds')}, learned from at least {learned} others. "
        f"Learning took {report.seconds_to_learn:.3g} s, and predicting "
        f"{1e3 * report.seconds_per_touch:.3g} ms per touch. "
    )
    if groups is None:
        text += (
            f"Which trials are of one {unit} is not known (groups=); if any are, the "
            f"model is worse on new {unit}s than it looks."
        )
    elif n := sum(np.isin(groups[test], groups[train]).sum() for train, test in folds):
        text += (
            f"But {count(n, 'test trials')} are of {unit}s that were touched in "
            f"training, so that the model is worse on new {unit}s than it looks."
        )
    else:
        text += f"By groups=, no test {unit} was touched in training."
    if frozen:
        text += f" {FROZEN}"
    return text


def _unlearned(labels, folds):
    """Say how many test trials are of classes that their fold did not learn."""
    unlearned = np.concatenate(
        [
            y[test][~np.isin(y[test], y[train])]
            for y in map(np.asarray, labels)
            for train, test in folds
        ]
    )
    if not len(unlearned):
        return ""
    names = ", ".join(map(str, np.unique(unlearned)))
    return (
        f" {count(len(unlearned), 'test trials')} could not be predicted right, for "
        f"want of training trials of their class in the fold ({names})."
    )


def _conclusion(overall, n, n_adjectives, kind):
    """Say in words how much better than guessing a model is, or that it is not."""
    score, up, down = _SCORE[kind], "lower", "higher"
    if kind == _CLASSES:
        up, down = down, up
    text = f"The model {_VERDICTS[overall['verdict']]}: its {score} is "
    text += f"{up if overall['gain'] >= 0 else down} by {abs(overall['gain']):.3f}"
    text += f" on average over {n_adjectives} adjectives" * (n_adjectives > 1)
    if not np.isnan(overall["lower"]):
        text += f" (95% interval {overall['lower']:.3f} to {overall['upper']:.3f}"
        text += f" of the gain, over {n})"
    text += "."
    if overall["verdict"] == "worse" and kind != _CLASSES:
        text += " It takes chance for a pattern: raise its penalty, such as alpha."
        text += " Standardise features that are in different units."
    return text
