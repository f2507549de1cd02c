"""The features of a sensor: codes over a dictionary of its own, pooled over time."""

import numpy as np
import pandas as pd
from scipy import linalg
from sklearn.base import clone
from sklearn.preprocessing import StandardScaler
from sklearn.utils import check_random_state

from .._pipeline import make_haptic_pipeline
from ..features import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from ..recordings._biotac import SENSORS
from ._corpus import names_of_trials
from ._store import read_table

_SHARE_OF_DICTIONARY = 0.6  # of the trials of each object


def compute_features(study, procedure, sensor, *fold):
    """Return the arrays of `learn_features` by name, and an empty record.

    ``fold`` is the adjective, or "all", and the number of the fold whose training
    trials the dictionary is learned from; without it all objects take part.
    """
    corpus = study.corpus(procedure=procedure, sensors=[sensor])
    trials, _ = read_table(study.folder, ("trials", procedure))
    for name, ids in names_of_trials(corpus).items():
        if trials[name].tolist() != ids.tolist():
            raise ValueError(
                f"The corpus gives other trials of {procedure!r} than those of the "
                f"study in {study.folder}; give the same corpus, or another folder."
            )
    recordings = list(corpus.trials[sensor])
    objects = trials["object"].to_numpy()
    seed = study.seed("features", procedure, sensor)
    chosen = choose_trials(objects, seed)
    if fold:
        adjective, number = fold
        parts = study.split_objects(objects, adjective)[number]
        chosen = np.intersect1d(chosen, parts.train)
    coder = study.coders.get(sensor)
    if coder is None:
        coder = default_coder(sensor, study.update, recordings)
    coder = clone(coder).set_params(random_state=seed)
    features, dictionary = learn_features(
        recordings, chosen, coder, cells_of(procedure, sensor)
    )
    return {"features": features, "dictionary": dictionary}, {}


def default_coder(sensor, update, trials):
    """Return the transformer of a sensor: that of the paper for sensors of a BioTac.

    Images of other sensors are coded by patches of 3 x 3 pixels over 10 atoms; signals
    by windows of 50 samples over 25 atoms, as the paper codes pressure. Means of
    windows are kept for all.

    Parameters
    ----------
    sensor : str
    update : {"approximate", "exact"}
        Update of K-SVD.
    trials : list of ndarray
        The sensor's recordings.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._features import default_coder
    >>> default_coder("pac", "exact", []).window
    22
    >>> default_coder("mic", "exact", [np.zeros((60, 1))]).window
    50
    """
    options = {"update": update, "remove_mean": False}
    if sensor in SENSORS:
        _, parts, _ = make_haptic_pipeline([sensor])["features"].transformers[0]
        coder = parts["codes"][0]
        if isinstance(coder, STHMPTransformer):
            return STHMPTransformer(**options)
        return KSVDTransformer(coder.n_atoms, window=coder.window, **options)
    if np.ndim(trials[0]) == 3:
        return STHMPTransformer(layout=None, **options)
    return KSVDTransformer(25, window=50, **options)


def choose_trials(objects, seed):
    """Draw 60 % of the trials of each object, one at least, in ascending order.

    As in the paper, every object takes part, but nobody's ratings are used.

    Parameters
    ----------
    objects : ndarray of shape (n_trials,)
        The object of each trial.
    seed : int

    Returns
    -------
    chosen : ndarray of int

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.study._features import choose_trials
    >>> np.bincount(np.repeat([0, 1], [10, 5])[choose_trials([0] * 10 + [1] * 5, 0)])
    array([6, 3])
    """
    rng = check_random_state(seed)
    chosen = []
    for of_object in pd.Series(objects).groupby(objects).indices.values():
        n_chosen = max(1, round(_SHARE_OF_DICTIONARY * len(of_object)))
        chosen.extend(rng.permutation(of_object)[:n_chosen])
    return np.sort(chosen)


def learn_features(trials, chosen, coder, cells):
    """Learn a sensor's dictionary from some of its trials; code and pool all trials.

    Parameters
    ----------
    trials : sequence of ndarray of shape (n_times_i, n_channels)
        The sensor's recordings.
    chosen : array-like of int
        Indices of the trials from which the dictionary is learned.
    coder : KSVDTransformer or STHMPTransformer
        It is fitted.
    cells : tuple of int
        Cells of each level of the pyramid over time.

    Returns
    -------
    features : ndarray of float32 of shape (n_trials, n_features)
        Codes pooled over time and, for images, over space.
    dictionary : ndarray of shape (n_atoms, n_samples)

    Examples
    --------
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> from sklearn_haptic.study._features import default_coder, learn_features
    >>> corpus = make_haptic_corpus(3, 2, "fast_slide", sensors=["tdc"], random_state=0)
    >>> trials = list(corpus.trials["tdc"])
    >>> coder = default_coder("tdc", "approximate", trials).set_params(random_state=0)
    >>> features, dictionary = learn_features(trials, [0, 2, 4], coder, (8, 4, 2, 1))
    >>> features.shape, dictionary.shape
    ((6, 600), (10, 50))
    """
    coder.fit([trials[i] for i in chosen])
    pool = TemporalMaxPool(cells).set_output(transform="default")
    features = pool.fit_transform(coder.transform(trials))
    return features.astype(np.float32, copy=False), coder.components_


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
