"""The units of a study: what each computes, as a function of its name alone.

A *unit* is one step of a study that is written to disk when it is finished: the trials
of a procedure, the features of a sensor, or all models of a fold. Its result depends on
nothing but the corpus, the settings and its name, from which its seeds derive.
"""

import json
import re
from collections import Counter
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from itertools import product
from numbers import Integral
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import linalg
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.metrics import check_scoring
from sklearn.model_selection import GroupKFold
from sklearn.preprocessing import StandardScaler
from sklearn.utils import check_random_state

from .._biotac import PROCEDURES
from .._check_ratings import check_ratings
from .._folds import validation_split
from .._pipeline import make_haptic_pipeline
from ..features._pooling import TemporalMaxPool
from ..model_selection._contributions import fit_holdouts, score_trials
from ..models._baselines import DummyDistribution
from ..models._distributional import DistributionalOrdinalRegressor
from ..models._fusion import SensorFusionNNPOM
from ._store import check_text, read_unit, unit_path

_SHARE_OF_DICTIONARY = 0.6  # of the trials of each object


_SHARE_OF_TEST = 0.1  # of the objects, in the paper's split


_SHARE_OF_VALIDATION = 1 / 9  # of the objects that are not for testing


# Name of a unit of models: procedure, adjective and fold.
NAME_OF_MODELS = rf"({'|'.join(PROCEDURES)})_.*_\d+"


# Pure steps -----------------------------------------------------------------
class Parts(NamedTuple):
    """Ascending indices of the trials of one fold."""

    train: np.ndarray
    validation: np.ndarray
    test: np.ndarray


def derive_seed(random_state, *name):
    """Return the seed of one random choice, a function of the study's and its name.

    Parameters
    ----------
    random_state : int
        Seed of the study.
    *name : str, int or float
        What the seed is for.

    Returns
    -------
    seed : int
        From 0 to 2**31 - 1.

    Examples
    --------
    >>> from sklearn_haptic.study._units import derive_seed
    >>> derive_seed(0, "features", "hold", "pac")
    1392585247
    """
    digest = sha256(json.dumps([random_state, *name]).encode()).digest()
    return int.from_bytes(digest[:4], "big") >> 1


def split_objects(objects, split, *, n_splits, n_repeats, seed):
    """Divide trials into training, validation and test trials of distinct objects.

    Parameters
    ----------
    objects : ndarray of shape (n_trials,)
        The object of each trial.
    split : {"group_kfold", "paper"}
        As `run_study` takes it.
    n_splits, n_repeats : int
        Of "group_kfold".
    seed : int

    Returns
    -------
    folds : list of Parts
        The objects of each part depend on which objects there are, not on the order
        of the trials.

    Raises
    ------
    ValueError
        If there are too few objects for a part.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._units import split_objects
    >>> objects = np.repeat(np.arange(60), 10)
    >>> (parts,) = split_objects(objects, "paper", n_splits=5, n_repeats=2, seed=0)
    >>> [len(np.unique(objects[part])) for part in parts]
    [48, 6, 6]
    """
    n_objects = len(np.unique(objects))
    n_required = 3 if split == "paper" else n_splits if n_splits > 2 else 4
    if n_objects < n_required:
        raise ValueError(
            f"The corpus has {n_objects} object{'s' * (n_objects > 1)}, but "
            f"split={split!r} with n_splits={n_splits} requires {n_required} or more, "
            "to train, validate and test on different ones; give more objects or "
            'another n_splits or split="paper".'
        )
    rng = check_random_state(seed)
    if split == "paper":
        outer = [validation_split(len(objects), objects, _SHARE_OF_TEST, rng)]
    else:
        kfold = GroupKFold(n_splits, shuffle=True, random_state=rng)
        outer = [
            fold
            for _ in range(n_repeats)
            for fold in kfold.split(objects, groups=objects)
        ]
    folds = []
    for rest, test in outer:
        train, validation = validation_split(
            len(rest), objects[rest], _SHARE_OF_VALIDATION, rng
        )
        parts = rest[train], rest[validation], test
        folds.append(Parts(*map(np.sort, parts)))
    return folds


def trials_of_objects(objects):
    """Return the ascending indices of the trials of each object, objects in order."""
    _, rank, counts = np.unique(objects, return_inverse=True, return_counts=True)
    return np.split(np.argsort(rank, kind="stable"), np.cumsum(counts)[:-1])


def cells_of(procedure, sensor):
    """Return the paper's temporal cells of a sensor's recordings of a procedure."""
    short = procedure == "fast_slide" and sensor in ("pdc", "tac", "tdc")
    return (8, 4, 2, 1) if short else (16, 8, 4, 2, 1)


def learn_features(trials, objects, procedure, sensor, seed):
    """Learn a sensor's dictionary from some trials of each object; code all trials.

    Nobody's ratings are used, and every object takes part, as in the paper.

    Parameters
    ----------
    trials : sequence of ndarray of shape (n_times_i, n_channels)
        The sensor's recordings.
    objects : ndarray of shape (n_trials,)
        The object of each trial.
    procedure, sensor : str
        Their names, which say how trials are coded and pooled.
    seed : int

    Returns
    -------
    features : ndarray of float32 of shape (n_trials, n_features)
        Codes pooled over space, if the sensor has some, and time.
    dictionary : ndarray of shape (n_atoms, n_samples)

    Examples
    --------
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.study._units import learn_features
    >>> corpus = make_haptic_corpus(3, 2, "fast_slide", sensors=["tdc"], random_state=0)
    >>> features, dictionary = learn_features(
    ...     list(corpus.trials["tdc"]), corpus.objects, "fast_slide", "tdc", seed=0
    ... )
    >>> features.shape, dictionary.shape
    ((6, 600), (10, 50))
    """
    rng = check_random_state(seed)
    learnt_from = []
    for of_object in trials_of_objects(objects):
        of_object = rng.permutation(of_object)
        n_learnt = max(1, round(_SHARE_OF_DICTIONARY * len(of_object)))
        learnt_from.extend(of_object[:n_learnt])
    model = make_haptic_pipeline([sensor], preset="accurate", random_state=seed)
    coder = model["features"].transformers[0][1][0]
    coder.fit([trials[i] for i in sorted(learnt_from)])
    pool = TemporalMaxPool(cells_of(procedure, sensor))
    pool.set_output(transform="default")
    features = pool.fit_transform(coder.transform(trials))
    return features.astype(np.float32, copy=False), coder.components_


def rotate_features(features, train):
    """Standardise features and rotate them to the principal axes of training trials.

    The axes are all those that the training trials span, so that distances between
    these stay as they are, and with them what a network with an L2 penalty can learn.

    Parameters
    ----------
    features : ndarray of shape (n_trials, n_features)
    train : ndarray of int of shape (n_train,)
        Trials to take means, standard deviations and axes from.

    Returns
    -------
    rotated : ndarray of shape (n_trials, n_axes)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._units import rotate_features
    >>> features = np.random.default_rng(0).normal(size=(6, 20))
    >>> rotate_features(features, np.arange(4)).shape
    (6, 3)
    """
    features = features.astype(np.float64)
    scaler = StandardScaler().set_output(transform="default").fit(features[train])
    X = scaler.transform(features)
    _, length, axes = linalg.svd(X[train], full_matrices=False)
    tolerance = length[0] * max(len(train), X.shape[1]) * np.finfo(float).eps
    return X @ axes[length >= tolerance].T


def for_early_stopping(regressor, X, counts, parts):
    """Return the arguments that ``fit`` needs of a regressor that stops early."""
    if regressor.estimator.validation_share() == 0:
        return {}
    return {"X_val": X[parts.validation], "y_val": counts[parts.validation]}


def fit_best(candidates, X, counts, parts, scoring):
    """Fit regressors to training trials and keep the best on validation trials.

    Parameters
    ----------
    candidates : list of DistributionalOrdinalRegressor
        Unfitted. Those whose networks stop early do so on the validation trials.
    X : ndarray of shape (n_trials, n_features)
    counts : ndarray of shape (n_trials, n_levels)
    parts : Parts
    scoring : str, callable or None
        Higher is better; None for the regressor's own score.

    Returns
    -------
    best : int
        Index of the best candidate, the first among equals. NaN is worse than any
        score.
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
    >>> from sklearn_haptic.study._units import Parts, fit_best
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
    best = None
    for i, candidate in enumerate(candidates):
        held_out = for_early_stopping(candidate, X, counts, parts)
        candidate.fit(X[parts.train], counts[parts.train], **held_out)
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


# Units ----------------------------------------------------------------------
@dataclass(frozen=True)
class Study:
    """What the units of a study need to know; see `run_study` for the settings."""

    corpus: object
    folder: Path
    sensors: list[str]
    split: str
    n_splits: int
    n_repeats: int
    n_hidden: list[int]
    alpha: list[float]
    n_starts: int
    regressor: DistributionalOrdinalRegressor
    scoring: object
    random_state: int

    @property
    def settings(self):
        """Everything that changes the results of a unit."""
        chosen = {name: value for name, value in vars(self).items() if name != "folder"}
        return {"version": version("sklearn_haptic"), **chosen}

    @property
    def n_folds(self):
        """Folds of each procedure and adjective."""
        return 1 if self.split == "paper" else self.n_splits * self.n_repeats

    def seed(self, *name):
        """Seed of a random choice."""
        return derive_seed(self.random_state, *name)

    def split_objects(self, objects, adjective):
        """Folds of trials: the paper's for one adjective, or the same for all."""
        name = adjective if self.split == "paper" else "all"
        return split_objects(
            objects,
            self.split,
            n_splits=self.n_splits,
            n_repeats=self.n_repeats,
            seed=self.seed("split", name),
        )


def compute_trials(study, procedure):
    """Return a table of trials: name, object and how many people gave each rating."""
    corpus = study.corpus(procedure=procedure, sensors=study.sensors[:1])
    if not corpus.ratings:
        raise ValueError(
            "The corpus has no ratings; give load_phac2 the file as ratings_path."
        )
    columns = names_of_trials(corpus)
    for adjective, counts in corpus.ratings.items():
        check_text(adjective, "The adjective")
        for k, count in enumerate(np.asarray(counts).T, start=1):
            columns[f"{adjective}_{k}"] = count
    return pd.DataFrame(columns), {}


def names_of_trials(corpus):
    """Return the name and the object of each trial, as whole numbers or text.

    Raises
    ------
    ValueError
        If one is missing or of another type, or a name comes twice.
    """
    names = check_ids(corpus.trials.index, "The index of the corpus's trials")
    name, count = Counter(names.tolist()).most_common(1)[0]
    if count > 1:
        raise ValueError(
            f"The corpus has {count} trials named {name!r} in the index of its trials; "
            "give each a name of its own."
        )
    return {"trial": names, "object": check_ids(corpus.objects, "corpus.objects")}


def check_ids(ids, name):
    """Return ids as an array of whole numbers, or of text, as they are.

    Parameters
    ----------
    ids : array-like of shape (n_trials,)
    name : str
        What error messages call them.

    Returns
    -------
    ids : ndarray of int or object of shape (n_trials,)

    Raises
    ------
    ValueError
        If there are none, some are neither, some are numbers and others text, a
        number has more than 64 bits, or text has control characters.

    Examples
    --------
    >>> from sklearn_haptic.study._units import check_ids
    >>> check_ids(["007", "7"], "objects")
    array(['007', '7'], dtype=object)
    """
    ids = list(ids)
    if not ids:
        raise ValueError(f"{name} is empty; give at least one trial.")
    kind = str if isinstance(ids[0], str) else Integral
    for i, each in enumerate(ids):
        if not isinstance(each, kind) or isinstance(each, bool):
            raise ValueError(
                f"{name} has {each!r} in place {i}; give whole numbers for all trials, "
                "or text for all."
            )
        if kind is str:
            check_text(each, f"{name} has the name")
    if kind is str:
        return np.array(ids, dtype=object)
    numbers = np.array(ids)
    if numbers.dtype.kind not in "iu":
        raise ValueError(f"{name} has numbers beyond 64 bits; give them as text.")
    return numbers


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
        adjective is no name of a file.
    """
    for _, procedure, adjective, fold in models:
        unit_path(study.folder, ("models", procedure, adjective, fold))
        if fold == 0:
            trials, _ = read_unit(study.folder, ("trials", procedure))
            check_ratings(
                counts_of(trials, adjective), name=f"corpus.ratings[{adjective!r}]"
            )
            study.split_objects(trials["object"].to_numpy(), adjective)


def adjectives_of(trials):
    """Return the adjectives in a table made by `compute_trials`."""
    counts = trials.columns.drop(["trial", "object"])
    return list(dict.fromkeys(name.rpartition("_")[0] for name in counts))


def counts_of(trials, adjective):
    """Return counts (n_trials, n_levels) from a table made by `compute_trials`."""
    return trials.filter(regex=rf"^{re.escape(adjective)}_\d+$").to_numpy()


def compute_features(study, procedure, sensor):
    """Return the arrays of `learn_features` for one sensor and procedure."""
    corpus = study.corpus(procedure=procedure, sensors=[sensor])
    trials, _ = read_unit(study.folder, ("trials", procedure))
    for name, ids in names_of_trials(corpus).items():
        if trials[name].tolist() != ids.tolist():
            raise ValueError(
                f"The corpus gives other trials of {procedure!r} than those of the "
                f"study in {study.folder}; give the same corpus, or another folder."
            )
    features, dictionary = learn_features(
        list(corpus.trials[sensor]),
        trials["object"].to_numpy(),
        procedure,
        sensor,
        study.seed("features", procedure, sensor),
    )
    return {"features": features, "dictionary": dictionary}, {}


def choose_network(study, name, regressor, network, X, counts, parts):
    """Search the hidden units and the penalty of one network of a regressor.

    Parameters
    ----------
    study : Study
    name : tuple
        Procedure, adjective, fold and the name of the network.
    regressor : DistributionalOrdinalRegressor
    network : str
        Where the network is among the parameters of `regressor`.
    X, counts, parts
        As in `fit_best`.

    Returns
    -------
    model : DistributionalOrdinalRegressor
        The best, fitted.
    choice : dict
        What was chosen, and its score.
    """
    grid = list(product(study.n_hidden, study.alpha))
    candidates = [
        clone(regressor).set_params(
            **{f"{network}__n_hidden": n_hidden, f"{network}__alpha": alpha},
            random_state=study.seed(*name, n_hidden, alpha),
        )
        for n_hidden, alpha in grid
    ]
    best, score, model = fit_best(candidates, X, counts, parts, study.scoring)
    n_hidden, alpha = grid[best]
    return model, {
        "network": name[-1],
        "n_hidden": n_hidden,
        "alpha": alpha,
        "score": score,
    }


def predict_holdouts(study, name, combined, X, counts, parts):
    """Predict test trials from each start, with all sensors and without each.

    Parameters
    ----------
    study : Study
    name : tuple
        Procedure, adjective and fold.
    combined : DistributionalOrdinalRegressor
        The combined model; it is fitted again.
    X, counts, parts
        As in `fit_best`.

    Yields
    ------
    start : int
    held_out : str
        The sensor, or "none".
    proba : ndarray of shape (n_test, n_levels)
    """
    held_out = for_early_stopping(combined, X, counts, parts)
    for start in range(study.n_starts):
        models = fit_holdouts(
            combined,
            X[parts.train],
            counts[parts.train],
            random_state=study.seed(*name, "start", start),
            **held_out,
        )
        for sensor, model in models.items():
            yield start, sensor, model.predict_proba(X[parts.test])


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
        Of each strategy of `DummyDistribution`: its name, the mean of each score over
        the test trials, and the probability of each level.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._units import Parts, score_baselines
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
            | {f"proba_{k + 1}": float(p) for k, p in enumerate(model.proba_)}
        )
    return baselines


def compute_models(study, procedure, adjective, fold):
    """Return a table of scores, of the combined model and its holdouts, of one fold."""
    name = procedure, adjective, fold
    trials, _ = read_unit(study.folder, ("trials", procedure))
    objects, counts = trials["object"].to_numpy(), counts_of(trials, adjective)
    parts = study.split_objects(objects, adjective)[fold]

    features, columns, networks, choices = [], {}, {}, []
    n_features = 0
    for sensor in study.sensors:
        arrays, _ = read_unit(study.folder, ("features", procedure, sensor))
        X = rotate_features(arrays["features"], parts.train)
        model, choice = choose_network(
            study, (*name, sensor), study.regressor, "estimator", X, counts, parts
        )
        features.append(X)
        columns[sensor] = slice(n_features, n_features + X.shape[1])
        networks[sensor] = FrozenEstimator(model.estimator_)
        choices.append(choice)
        n_features += X.shape[1]
    X = np.hstack(features)

    final = study.regressor.estimator
    fusion = SensorFusionNNPOM(columns, networks, final_estimator=final)
    combined, choice = choose_network(
        study,
        (*name, "combined"),
        clone(study.regressor).set_params(estimator=fusion),
        "estimator__final_estimator",
        X,
        counts,
        parts,
    )
    choices.append(choice)

    known = {
        "object": objects[parts.test],
        "trial": trials["trial"].to_numpy()[parts.test],
    }
    counts_of_level = {f"count_{k + 1}": c[parts.test] for k, c in enumerate(counts.T)}
    tables = [
        pd.DataFrame(
            {
                "procedure": procedure,
                "adjective": adjective,
                "fold": fold,
                "held_out": held_out,
                "start": start,
                **known,
                **score_trials(counts[parts.test], proba),
                **{f"proba_{k + 1}": p for k, p in enumerate(proba.T)},
                **counts_of_level,
            }
        )
        for start, held_out, proba in predict_holdouts(
            study, name, combined, X, counts, parts
        )
    ]
    table = pd.concat(tables, ignore_index=True)
    return table, {"choices": choices, "baselines": score_baselines(counts, parts)}


COMPUTE = {
    "trials": compute_trials,
    "features": compute_features,
    "models": compute_models,
}
