"""Codes over a dictionary learned by K-SVD, of tables and of sliding windows."""

from numbers import Integral, Real

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from sklearn.base import BaseEstimator, TransformerMixin, _fit_context
from sklearn.utils import check_array, check_random_state
from sklearn.utils._param_validation import Interval, StrOptions
from sklearn.utils.validation import (
    _check_feature_names_in,
    check_is_fitted,
    validate_data,
)

from ._dictionary_learning import initial_atoms, ksvd
from ._sparse_coding import batch_omp, dense_codes, row_norms, unit_rows
from ._validation import Sequences, check_sparsity, check_trials, is_table, row_index


class _UnwrappedSequences:
    """Mixin, first among the bases, for transformers that may return sequences.

    scikit-learn's `set_output` wraps the methods that a `TransformerMixin` class
    defines itself. This class is none, so what it returns stays as it is; tables
    go on to the next class's `transform`, which is wrapped.
    """

    def fit_transform(self, X, y=None):
        """Fit to `X`, then return its codes.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features) or collection of trials
            Training data.
        y : None
            Ignored.

        Returns
        -------
        codes : ndarray of shape (n_samples, n_codes) or Sequences
            Codes, as :meth:`transform` returns them.
        """
        return self.fit(X, y).transform(X)

    def transform(self, X):
        """Code observations over the dictionary.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features) or collection of trials
            Data of the kind given to `fit`.

        Returns
        -------
        codes : ndarray of shape (n_samples, n_codes) or Sequences
            One row an observation for a table. For trials a list of arrays, one
            a trial, which `set_output` leaves as they are.
        """
        check_is_fitted(self)
        if self._codes_trials:
            return self._transform_trials(X)
        return super().transform(X)


class _DictionaryCoder(TransformerMixin, BaseEstimator):
    """What transformers with a learned dictionary share; codes tables.

    A subclass takes the parameters below, puts :class:`_UnwrappedSequences`
    before this class, and provides `_codes_trials` (whether the fitted
    transformer takes trials), `_transform_trials` and, for trials, its own
    `get_feature_names_out`.
    """

    _parameter_constraints = {  # noqa: RUF012
        "n_atoms": [Interval(Integral, 1, None, closed="left")],
        "n_nonzero_coefs": [Interval(Integral, 1, None, closed="left")],
        "remove_mean": ["boolean"],
        "update": [StrOptions({"approximate", "exact"})],
        "max_iter": [Interval(Integral, 0, None, closed="left")],
        "tol": [Interval(Real, 0, 1, closed="left")],
        "max_train_windows": [Interval(Integral, 1, None, closed="left"), None],
        "dict_init": ["array-like", None],
        "sign": [StrOptions({"split", "absolute", "none"})],
        "random_state": ["random_state"],
    }

    def _fit_dictionary(self, blocks, *, obs_ndim=1):
        """Learn the dictionary.

        Parameters
        ----------
        blocks : list of ndarray
            Observations along the last axes, float32 or float64; views are only
            copied for the observations drawn.
        obs_ndim : int, default=1
            Number of axes of one observation.
        """
        n_nonzero_coefs = check_sparsity(self.n_nonzero_coefs, self.n_atoms)
        rng = check_random_state(self.random_state)
        observations = _draw_observations(blocks, self.max_train_windows, rng, obs_ndim)
        signals, scale = self._centre(observations)
        if self.dict_init is None:
            atoms = initial_atoms(signals, self.n_atoms, rng, scale=scale)
        else:
            atoms = self._check_dict_init(signals)
        self.n_iter_ = 0
        if self.max_iter:
            atoms, errors = ksvd(
                signals,
                unit_rows(atoms),
                n_nonzero_coefs,
                update=self.update,
                max_iter=self.max_iter,
                tol=self.tol,
                scale=scale,
                rng=rng,
            )
            self.n_iter_ = len(errors)
        self.components_ = atoms
        self.reconstruction_error_ = self._reconstruction_error(signals, scale)
        return self

    def _encode(self, observations):
        """Code observations, shape (n_obs, n_obs_features), as dense rows.

        Columns are the atoms or, with `sign="split"`, the positive parts of all
        followed by the negative parts of all.
        """
        signals, scale = self._centre(observations)
        support, coefs = batch_omp(
            signals, self.components_, self.n_nonzero_coefs, scale=scale
        )
        return dense_codes(support, coefs, len(self.components_), sign=self.sign)

    @property
    def _code_names(self):
        """Names of the columns of `_encode`."""
        suffixes = ["+", "-"] if self.sign == "split" else [""]
        atoms = range(len(self.components_))
        return [f"atom{j}{suffix}" for suffix in suffixes for j in atoms]

    def _fit_table(self, X):
        """Learn from the rows of a table."""
        return self._fit_dictionary(
            [validate_data(self, X, dtype=[np.float64, np.float32])]
        )

    def transform(self, X):
        """Code the rows of a table; see :class:`_UnwrappedSequences`."""
        X = validate_data(self, X, dtype=[np.float64, np.float32], reset=False)
        return self._encode(X)

    def get_feature_names_out(self, input_features=None):
        """Return the names of the code columns.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Ignored, but checked against the columns seen in `fit` for a table.

        Returns
        -------
        names : ndarray of str objects
            ``atom0+``, …, ``atom0-``, … with `sign="split"`, else ``atom0``, ….
        """
        check_is_fitted(self)
        _check_feature_names_in(self, input_features, generate_names=False)
        return np.asarray(self._code_names, dtype=object)

    def _centre(self, observations):
        """Return observations, mean removed if asked, and their norms before."""
        scale = row_norms(observations)
        if self.remove_mean:
            observations = observations - observations.mean(axis=1, keepdims=True)
        return observations, scale

    def _check_dict_init(self, signals):
        atoms = check_array(self.dict_init, dtype=signals.dtype, input_name="dict_init")
        expected = (self.n_atoms, signals.shape[1])
        if atoms.shape != expected:
            raise ValueError(
                f"dict_init has shape {atoms.shape}, but {expected} is expected: one "
                "row an atom, one column an entry of an observation."
            )
        return atoms

    def _reconstruction_error(self, signals, scale):
        support, coefs = batch_omp(
            signals, self.components_, self.n_nonzero_coefs, scale=scale
        )
        codes = dense_codes(support, coefs, len(self.components_))
        residual = signals - codes @ self.components_
        return row_norms(residual.reshape(1, -1))[0] / np.sqrt(residual.size)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags


class KSVDTransformer(_UnwrappedSequences, _DictionaryCoder):
    """Sparse codes over a dictionary learned by K-SVD.

    With `window=None` each row of a table is one observation, as in
    scikit-learn's dictionary learning. With a window each trial, an array of
    shape (n_times, n_channels), becomes the sequence of its windows' codes: every
    channel is cut into overlapping windows, one dictionary is learned from the
    windows of all channels, and :class:`TemporalMaxPool` can follow.

    Parameters
    ----------
    n_atoms : int, default=25
        Number of atoms.
    n_nonzero_coefs : int, default=4
        Most atoms that one code may use. The 2020 paper does not give it; 4 is
        what the authors of ST-HMP use.
    window : int, default=None
        Time samples a window: 22 in the 2020 paper for vibrations at 2.2 kHz, 50
        for pressure and temperature at 100 Hz. None codes the rows of a table.
    overlap : float, default=0.5
        Fraction of a window shared with the next, in [0, 1). Samples after the
        last whole window are left out.
    remove_mean : bool, default=True
        Whether to subtract each observation's mean. It is a nuisance in
        vibrations and in images of electrodes, but carries information in slow
        channels such as pressure and temperature.
    update : {"approximate", "exact"}, default="approximate"
        Fit an atom by one step of alternating least squares, or by the leading
        singular pair of what it has to represent. On recordings neither was
        clearly the more accurate (within 3 % of each other), and an iteration of
        the exact update took about half as long again.
    max_iter : int, default=50
        Most iterations of K-SVD. 0 takes the initial dictionary.
    tol : float, default=1e-3
        Stop when five iterations lower the training error by less than this
        fraction. Reaching `max_iter` first is usual and gives no warning; `n_iter_`
        tells.
    max_train_windows : int, default=20_000
        Most observations to learn from, drawn at random; None takes all. On
        recorded vibrations (25 and 40 atoms) and pressure the defaults took 1 to
        1.4 s and came within 2 % of the held-out error of 100 iterations with
        `tol=0`; 20 iterations on 10,000 windows took 0.3 s and were 12 to 15 %
        worse.
    dict_init : array-like of shape (n_atoms, n_obs_features), default=None
        Initial atoms; with `max_iter=0` they are used exactly as given. By
        default training observations, no two nearly parallel.
    sign : {"split", "absolute", "none"}, default="split"
        Give positive and negative parts of a coefficient columns of their own,
        take absolute values, or keep coefficients as they are. The ST-HMP authors
        recommend the split.
    random_state : int, RandomState instance or None, default=None
        Draws the training observations, the initial atoms and the order of
        updates.

    Attributes
    ----------
    components_ : ndarray of shape (n_atoms, n_obs_features)
        The dictionary. Each atom's largest-magnitude entry is positive.
    n_iter_ : int
        Iterations run.
    reconstruction_error_ : float
        Root mean squared error, per sample and in units of `X`, of the training
        observations coded over `components_`.
    n_features_in_ : int
        Columns of a table, or channels of the trials.
    feature_names_in_ : ndarray of shape (n_features_in_,)
        Column names of a table, where it has any.

    See Also
    --------
    TemporalMaxPool : Turn the sequences into rows of fixed length.
    sklearn.decomposition.DictionaryLearning : An l1-penalised dictionary.

    Notes
    -----
    An observation that is constant codes to exact zero, whatever rounding the
    removal of its mean leaves. Codes scale with the observations.

    References
    ----------
    M. Aharon, M. Elad and A. Bruckstein, "K-SVD: an algorithm for designing
    overcomplete dictionaries for sparse representation", IEEE Trans. Signal
    Processing 54(11), 2006, doi:10.1109/TSP.2006.881199.

    B. A. Richardson and K. J. Kuchenbecker, "Learning to predict perceptual
    distributions of haptic adjectives", Frontiers in Neurorobotics 13, 2020,
    doi:10.3389/fnbot.2019.00116.

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
        **_DictionaryCoder._parameter_constraints,
        "window": [Interval(Integral, 1, None, closed="left"), None],
        "overlap": [Interval(Real, 0, 1, closed="left")],
    }

    def __init__(
        self,
        n_atoms=25,
        n_nonzero_coefs=4,
        *,
        window=None,
        overlap=0.5,
        remove_mean=True,
        update="approximate",
        max_iter=50,
        tol=1e-3,
        max_train_windows=20_000,
        dict_init=None,
        sign="split",
        random_state=None,
    ):
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
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X, y=None):
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
            The fitted transformer.
        """
        if self._codes_trials:
            trials = self._check_windowed(X)
            self.n_features_in_ = trials[0].shape[1]
            return self._fit_dictionary([self._windows(trial) for trial in trials])
        if not is_table(X):
            raise ValueError(
                "X is a collection of trials, but window=None codes the rows of a "
                "table; set window to the number of time samples a window."
            )
        return self._fit_table(X)

    def get_feature_names_out(self, input_features=None):
        """Return the names of the code columns.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Ignored, but checked against the columns seen in `fit` for a table.

        Returns
        -------
        names : ndarray of str objects
            ``atom0+``, …, ``atom0-``, … with `sign="split"`, else ``atom0``, …;
            for trials the same for each channel, as in ``ch0_atom0+``.
        """
        if not self._codes_trials:
            return super().get_feature_names_out(input_features)
        check_is_fitted(self)
        channels = range(self.n_features_in_)
        return np.asarray(
            [f"ch{c}_{name}" for c in channels for name in self._code_names],
            dtype=object,
        )

    @property
    def _codes_trials(self):
        return self.window is not None

    def _check_windowed(self, X, n_channels=None):
        if is_table(X):
            X = check_array(X, dtype=[np.float64, np.float32])
        return check_trials(X, n_channels=n_channels, min_times=self.window)

    def _windows(self, trial):
        """Return a view of shape (n_windows, n_channels, window)."""
        step = max(1, self.window - round(self.overlap * self.window))
        return sliding_window_view(trial, self.window, axis=0)[::step]

    def _transform_trials(self, X):
        trials = self._check_windowed(X, self.n_features_in_)
        windows = [self._windows(trial) for trial in trials]
        names = self.get_feature_names_out()
        arrays = []
        for batch in batches(windows, [len(w) * w.shape[1] for w in windows]):
            codes = self._encode(np.concatenate(batch).reshape(-1, self.window))
            ends = np.cumsum([len(w) for w in batch])
            arrays += np.split(codes.reshape(-1, len(names)), ends[:-1])
        return Sequences(arrays, names, row_index(X))


def batches(items, sizes, limit=65_536):
    """Yield lists of consecutive items whose sizes add up to at most about `limit`."""
    numbers = np.cumsum(sizes) // limit
    for number in np.unique(numbers):
        yield [items[i] for i in np.flatnonzero(numbers == number)]


def _draw_observations(blocks, limit, rng, obs_ndim):
    """Gather at most `limit` observations, drawn without replacement, as rows."""
    grids = [block.shape[:-obs_ndim] for block in blocks]
    ends = np.cumsum([np.prod(grid, dtype=int) for grid in grids])
    picked = np.arange(ends[-1])
    if limit is not None and limit < ends[-1]:
        picked = np.sort(rng.choice(ends[-1], limit, replace=False))
    shares = np.split(picked, np.searchsorted(picked, ends[:-1]))
    starts = np.append(0, ends[:-1])
    drawn = np.concatenate(
        [
            block[np.unravel_index(share - start, grid)]
            for block, grid, share, start in zip(blocks, grids, shares, starts)
        ]
    )
    return drawn.reshape(len(drawn), -1)
