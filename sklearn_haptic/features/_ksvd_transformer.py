"""Codes of sliding windows of signals over a dictionary learned by K-SVD."""

from __future__ import annotations

from numbers import Integral, Real
from typing import Literal, Self

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils import check_array

from ..recordings._trials import (
    TABLE_FOR_TRIALS,
    check_trials,
    is_table,
    name_of,
    transposed_hint,
)
from ..utils._sklearn import Interval, Memory, RandomState, Trials, _fit_context
from ..utils._validation import check_numbers, refuse_empty
from ._dictionary_coder import DictionaryCoder, encode


def sliding_windows(trial, window, overlap):
    """View the windows of a trial's channels.

    A window has `window` time samples, and shares the fraction `overlap` of them with
    the next. The trial has the shape (n_times, n_channels), its windows (n_windows,
    n_channels, window).

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._ksvd_transformer import sliding_windows
    >>> sliding_windows(np.arange(6)[:, np.newaxis], window=4, overlap=0.5)[:, 0]
    array([[0, 1, 2, 3],
           [2, 3, 4, 5]])
    """
    windows = sliding_window_view(trial, window, axis=0)
    return windows[:: window_step(window, overlap)]


def window_step(window, overlap):
    """Return the time samples from the start of one window to the start of the next."""
    return max(1, window - round(overlap * window))


def encode_windows(
    trial, atoms, n_nonzero_coefs, *, window, overlap, remove_mean, sign
):
    """Code the windows of a trial, of shape (n_times, n_channels).

    Parameters are those of :func:`sliding_windows` and :func:`encode`. The codes have
    the shape (n_windows, n_channels * n_codes): all of the first channel, then those of
    the next.
    """
    windows = sliding_windows(trial, window, overlap)
    codes = encode(
        windows.reshape(-1, window),
        atoms,
        n_nonzero_coefs,
        remove_mean=remove_mean,
        sign=sign,
    )
    return codes.reshape(len(windows), -1)


class KSVDTransformer(DictionaryCoder, TransformerMixin, BaseEstimator):
    """Sparse codes over a dictionary learned by K-SVD.

    With `window=None` each row of a table is one observation, as in scikit-learn's
    dictionary learning. With a window each trial, an array of shape (n_times,
    n_channels), becomes a sequence of codes: every channel is cut into overlapping
    windows, and one dictionary is learned from the windows of all channels.
    :class:`TemporalMaxPool` turns these sequences into rows of features.

    Parameters
    ----------
    n_atoms : int, default=25
        Number of atoms.
    n_nonzero_coefs : int, default=4
        Most atoms that one code may use. The 2020 paper does not give it; the authors
        of ST-HMP use 4.
    window : int, default=None
        Time samples per window. The 2020 paper has 22 for vibrations at 2.2 kHz and 50
        for pressure and temperature at 100 Hz. None codes the rows of a table.
    overlap : float, default=0.5
        Fraction of a window that it shares with the next, in [0, 1). Samples after the
        last whole window are left out.
    remove_mean : bool, default=True
        Whether to subtract the mean of each observation. The mean carries information
        in slow channels such as pressure and temperature, but is a nuisance in
        vibrations and in images of electrodes.
    update : {"approximate", "exact"}, default="approximate"
        Fit an atom by one step of alternating least squares, or by the leading
        singular pair of the residual that it has to represent. On recordings their
        errors were within 3 % of each other, and an iteration of the exact update took
        about 1.5 times as long.
    max_iter : int, default=50
        Most iterations of K-SVD. 0 takes the initial dictionary, as the pipelines of
        :func:`make_haptic_pipeline` do.
    tol : float, default=1e-3
        Stop when five iterations lower the training error by less than this fraction.
        `max_iter` is often reached first, which gives no warning; see `n_iter_`.
    max_train_windows : int, default=20_000
        Most observations to learn from, drawn at random; None takes all. On recorded
        vibrations (25 and 40 atoms) and pressure the defaults took 1 to 1.4 s, and the
        error on other windows was within 2 % of that of 100 iterations with `tol=0`.
        With 20 iterations on 10,000 windows, learning took 0.3 s and the error was 12
        to 15 % larger.
    dict_init : array-like of shape (n_atoms, n_obs_features), default=None
        Initial atoms; with `max_iter=0` they are used exactly as given. By default
        training observations are drawn, no two of which are nearly parallel; if these
        run out, what the atoms so far leave of observations, then random directions.
    sign : {"split", "absolute", "none"}, default="split"
        Give the positive and the negative part of a coefficient a column each, take
        absolute values, or keep coefficients as they are. The authors of ST-HMP
        recommend the split.
    memory : str or object with the joblib.Memory interface, default=None
        Folder or :class:`joblib.Memory` in which to cache the dictionary, so that a
        search over later steps learns none twice. Results are the same, bit for bit.
        Set `random_state` to an int, and clear the cache after an upgrade. With
        callbacks the cache is not used, because they have to see every iteration.
        Codes are not cached; give :class:`TemporalMaxPool` a cache too, since its rows
        are smaller. By default nothing is cached.
    random_state : int, RandomState instance or None, default=None
        Seeds the draw of training observations and of initial atoms, and the order of
        updates.

    Attributes
    ----------
    components_ : ndarray of shape (n_atoms, n_obs_features)
        The dictionary. After an iteration or more, the entry of largest magnitude of
        each atom is positive.
    n_iter_ : int
        Iterations run.
    reconstruction_error_ : float
        Root mean squared error, per sample and in units of `X`, of the training
        observations coded over `components_`.
    rate_ : float or None
        Samples per second, by the time stamps of trials of pandas, if they have any.
        `transform` refuses trials that contradict it.
    takes_trials_ : bool
        Whether trials were fitted; else rows of a table.
    window_step_ : int
        Time samples from the start of one window to the start of the next. Defined
        for trials.
    n_features_in_ : int
        Number of columns of a table, or of channels of the trials.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the columns of a table. Defined if it has any.

    See Also
    --------
    TemporalMaxPool : Turn the sequences into rows of fixed length.
    sklearn.decomposition.DictionaryLearning : An l1-penalised dictionary.

    Notes
    -----
    The code of a constant observation is exactly zero, whatever rounding leaves when
    its mean is removed. Codes scale with the observations.

    References
    ----------
    M. Aharon, M. Elad and A. Bruckstein, "K-SVD: an algorithm for designing
    overcomplete dictionaries for sparse representation", IEEE Trans. Signal
    Processing 54(11), 2006. :doi:`10.1109/TSP.2006.881199`

    Richardson and Kuchenbecker (2020). :doi:`10.3389/fnbot.2019.00116`

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import KSVDTransformer
    >>> rng = np.random.default_rng(0)
    >>> trials = [rng.normal(size=(n_times, 2)) for n_times in (110, 220)]
    >>> ksvd = KSVDTransformer(n_atoms=10, window=22, random_state=0)
    >>> codes = ksvd.fit_transform(trials)
    >>> [trial.shape for trial in codes]
    [(9, 40), (19, 40)]
    >>> ksvd.get_feature_names_out()[[0, 10, 20]]
    array(['ch0_atom0+', 'ch0_atom0-', 'ch1_atom0+'], dtype=object)
    """

    _parameter_constraints = {  # noqa: RUF012
        **DictionaryCoder._parameter_constraints,
        "max_train_windows": [Interval(Integral, 1, None, closed="left"), None],
        "window": [Interval(Integral, 1, None, closed="left"), None],
        "overlap": [Interval(Real, 0, 1, closed="left")],
    }

    _encode_trial = staticmethod(encode_windows)
    _unit = "windows"

    def __init__(
        self,
        n_atoms: int = 25,
        n_nonzero_coefs: int = 4,
        *,
        window: int | None = None,
        overlap: float = 0.5,
        remove_mean: bool = True,
        update: Literal["approximate", "exact"] = "approximate",
        max_iter: int = 50,
        tol: float = 1e-3,
        max_train_windows: int | None = 20_000,
        dict_init: ArrayLike | None = None,
        sign: Literal["split", "absolute", "none"] = "split",
        memory: str | Memory | None = None,
        random_state: RandomState = None,
    ) -> None:
        self.n_atoms = n_atoms
        self.n_nonzero_coefs = n_nonzero_coefs
        self.window = window
        self.overlap = overlap
        self.remove_mean = remove_mean
        self.update = update
        self.max_iter = max_iter
        self.tol = tol
        self.max_train_windows = max_train_windows
        self.dict_init = dict_init
        self.sign = sign
        self.memory = memory
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: Trials, y: None = None) -> Self:
        """Learn the dictionary.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features) or collection of trials
            Training data.
        y : None
            Ignored.

        Returns
        -------
        self : KSVDTransformer
        """
        self.takes_trials_ = self.window is not None
        self._trial_coding = {"window": self.window, "overlap": self.overlap}
        if not self.takes_trials_ and not is_table(X):
            raise ValueError(
                "X is a collection of trials, but window=None codes the rows of a "
                "table; set window to the number of time samples per window."
            )
        return self._learn(X, y, self.max_train_windows)

    @property
    def _blocks(self):
        return [f"ch{i}" for i in range(self.n_features_in_)]

    def _fit_trials(self, X):
        self.window_step_ = window_step(**self._trial_coding)
        trials, n_windows = self._check_trials(X, reset=True)
        self.n_features_in_ = trials[0].shape[1]

        def observe(trial, indices):
            windows = sliding_windows(trial, **self._trial_coding)
            return windows[np.unravel_index(indices, windows.shape[:2])]

        return trials, [n * self.n_features_in_ for n in n_windows], observe

    def _check_trials(self, X, *, reset=False):
        """Return the trials and their numbers of windows.

        Each row of a table is a trial with one channel.
        """
        window = self._trial_coding["window"]
        if is_table(X):
            refuse_empty(X)
            check_numbers(X, "X")
            X = check_array(X, dtype=[np.float64, np.float32])
            if not reset and self.n_features_in_ > 1:
                raise ValueError(TABLE_FOR_TRIALS)
        n_channels = None if reset else self.n_features_in_
        trials = check_trials(X, n_channels=n_channels, names=self._channel_names)
        for i, trial in enumerate(trials):
            if len(trial) < window:
                raise ValueError(
                    f"Trial {i} of {name_of(X)} has {len(trial)} time samples, but one "
                    f"window takes {window}; remove it or use a shorter window."
                    f"{transposed_hint(trial.shape)}"
                )
        step = self.window_step_
        return trials, [(len(trial) - window) // step + 1 for trial in trials]
