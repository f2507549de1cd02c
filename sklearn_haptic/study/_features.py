"""The features of a sensor: codes over a dictionary of its own, pooled over time."""

import numpy as np
from scipy import linalg
from sklearn.preprocessing import StandardScaler
from sklearn.utils import check_random_state

from .._pipeline import make_haptic_pipeline
from ..features import TemporalMaxPool
from ._store import read_unit
from ._trials import names_of_trials

_SHARE_OF_DICTIONARY = 0.6  # of the trials of each object


def compute_features(study, procedure, sensor):
    """Return the arrays of `learn_features` by name, and an empty record."""
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


def learn_features(trials, objects, procedure, sensor, seed):
    """Learn a sensor's dictionary from some trials of each object; code all trials.

    As in the paper, every object takes part, but nobody's ratings are used.

    Parameters
    ----------
    trials : sequence of ndarray of shape (n_times_i, n_channels)
        The sensor's recordings.
    objects : ndarray of shape (n_trials,)
        The object of each trial.
    procedure, sensor : str
        Their names, which decide how trials are coded and pooled.
    seed : int
        Seed of the dictionary, and of the choice of trials that it is learned from.

    Returns
    -------
    features : ndarray of float32 of shape (n_trials, n_features)
        Codes pooled over time and, for electrodes, over space.
    dictionary : ndarray of shape (n_atoms, n_samples)

    Examples
    --------
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.study._features import learn_features
    >>> corpus = make_haptic_corpus(3, 2, "fast_slide", sensors=["tdc"], random_state=0)
    >>> features, dictionary = learn_features(
    ...     list(corpus.trials["tdc"]), corpus.objects, "fast_slide", "tdc", seed=0
    ... )
    >>> features.shape, dictionary.shape
    ((6, 600), (10, 50))
    """
    rng = check_random_state(seed)
    chosen = []
    for of_object in trials_of_objects(objects):
        of_object = rng.permutation(of_object)
        n_chosen = max(1, round(_SHARE_OF_DICTIONARY * len(of_object)))
        chosen.extend(of_object[:n_chosen])
    model = make_haptic_pipeline([sensor], preset="accurate", random_state=seed)
    coder = model["features"].transformers[0][1][0]
    coder.fit([trials[i] for i in sorted(chosen)])
    pool = TemporalMaxPool(cells_of(procedure, sensor))
    pool.set_output(transform="default")
    features = pool.fit_transform(coder.transform(trials))
    return features.astype(np.float32, copy=False), coder.components_


def trials_of_objects(objects):
    """Return the ascending indices of the trials of each object, objects in order."""
    _, rank, counts = np.unique(objects, return_inverse=True, return_counts=True)
    return np.split(np.argsort(rank, kind="stable"), np.cumsum(counts)[:-1])


def cells_of(procedure, sensor):
    """Return the paper's temporal cells of a sensor's recordings of a procedure."""
    short = procedure == "fast_slide" and sensor in ("pdc", "tac", "tdc")
    return (8, 4, 2, 1) if short else (16, 8, 4, 2, 1)


def rotate_features(features, train):
    """Standardise features and rotate them to the principal axes of training trials.

    All axes that the training trials span are kept. Distances between these trials
    therefore stay as they are, and with them what a network with an L2 penalty can
    learn.

    Parameters
    ----------
    features : ndarray of shape (n_trials, n_features)
    train : ndarray of int of shape (n_train,)
        Trials that give the means, the standard deviations and the axes.

    Returns
    -------
    rotated : ndarray of shape (n_trials, n_axes)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._features import rotate_features
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
