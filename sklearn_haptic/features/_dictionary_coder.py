"""What the transformers share that learn a dictionary by K-SVD and code over it."""

from __future__ import annotations

import warnings
from functools import partial
from numbers import Integral, Real

import numpy as np
from numpy.typing import NDArray
from sklearn.callback import CallbackSupportMixin
from sklearn.utils import check_array, check_random_state
from sklearn.utils.random import sample_without_replacement
from sklearn.utils.validation import check_is_fitted

from ..recordings._sequences import Sequences, row_index
from ..recordings._trials import channel_names, name_of, rate_of
from ..utils._sklearn import (
    FloatArray,
    HasMethods,
    Interval,
    Names,
    StrOptions,
    Trials,
    _check_feature_names_in,
    _wrap_data_with_container,
    fit_task,
    one_blas_thread,
)
from ..utils._validation import check_cache, check_numbers, check_table
from ._ksvd import initial_atoms, ksvd, residual_of
from ._sparse_coding import batch_omp, dense_codes, row_norms, unit_rows


def encode(observations, atoms, n_nonzero_coefs, *, remove_mean=True, sign="split"):
    """Code observations, float32 or float64, over a dictionary.

    Parameters
    ----------
    observations : ndarray of shape (n_obs, n_obs_features)
    atoms : ndarray of shape (n_atoms, n_obs_features)
    n_nonzero_coefs : int
        Most atoms that one code may use.
    remove_mean : bool, default=True
        Whether to subtract each observation's mean.
    sign : {"split", "absolute", "none"}, default="split"
        How signs are kept, see :func:`dense_codes`.

    Returns
    -------
    codes : ndarray of shape (n_obs, n_atoms) or (n_obs, 2 * n_atoms)

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._dictionary_coder import encode
    >>> encode(np.array([[5.0, 3.0]]), np.array([[0.8, -0.6]]), 1).round(2)
    array([[1.4, 0. ]])
    """
    signals, scale = centre(observations, remove_mean)
    support, coefs = batch_omp(signals, atoms, n_nonzero_coefs, scale=scale)
    return dense_codes(support, coefs, len(atoms), sign=sign)


def centre(observations, remove_mean):
    """Return observations, less their means if asked, and their norms before that."""
    scale = row_norms(observations)
    # sqrt(n) times its norm bounds the sum of a row and the row less its mean.
    limit = np.finfo(observations.dtype).max / np.sqrt(observations.shape[1])
    if not (scale <= limit).all():
        raise ValueError(
            f"X holds values so large that their sums overflow {observations.dtype}; "
            "divide X by a constant."
        )
    if remove_mean:
        observations = observations - observations.mean(axis=1, keepdims=True)
    return observations, scale


def draw_observations(trials, counts, limit, observe, rng):
    """Gather at most `limit` observations as rows, drawn without replacement.

    Trial by trial, `counts` has the number of observations, and `observe` takes a trial
    and the indices of one or more of its observations, which it returns as rows. They
    stay in the order of the trials. None as the limit takes all.
    """
    ends = np.cumsum(counts)
    if limit is None or limit >= ends[-1]:
        picked = np.arange(ends[-1])
    else:
        picked = np.sort(sample_without_replacement(ends[-1], limit, random_state=rng))
    shares = np.split(picked, np.searchsorted(picked, ends[:-1]))
    return np.concatenate(
        [
            observe(trial, share - (end - count))
            for trial, share, end, count in zip(trials, shares, ends, counts)
            if len(share)
        ]
    )


def learn_dictionary(
    observations,
    n_atoms,
    n_nonzero_coefs,
    *,
    dict_init,
    remove_mean,
    update,
    max_iter,
    tol,
    seed,
    callback=None,
):
    """Learn a dictionary by K-SVD, from given or from drawn initial atoms.

    `dict_init` has the initial atoms; None draws them from the observations, of shape
    (n_obs, n_obs_features). `seed` is that of this draw and of the order of updates,
    `callback` that of :func:`ksvd`, and all else as in :class:`KSVDTransformer`. Return
    the atoms, of shape (n_atoms, n_obs_features), the iterations run, and the root mean
    squared error of the observations coded over the atoms.
    """
    rng = np.random.RandomState(seed)
    signals, scale = centre(observations, remove_mean)
    atoms = dict_init
    if atoms is None:
        atoms = initial_atoms(signals, n_atoms, rng, scale=scale)
    errors = []
    if max_iter:
        atoms, errors = ksvd(
            signals,
            unit_rows(atoms),
            n_nonzero_coefs,
            update=update,
            max_iter=max_iter,
            tol=tol,
            scale=scale,
            rng=rng,
            callback=callback,
        )
    support, coefs = batch_omp(signals, atoms, n_nonzero_coefs, scale=scale)
    residual = residual_of(signals, support, coefs, atoms)
    error = row_norms(residual.reshape(1, -1))[0] / np.sqrt(residual.size)
    return atoms, len(errors), error


class DictionaryCoder(CallbackSupportMixin):
    """Mixin for transformers that code trials, or rows of a table, over a dictionary.

    This mixin is not a TransformerMixin, so `set_output` does not wrap its methods:
    `transform` wraps the codes of a table itself and leaves sequences as they are.

    A subclass has the parameters below. Its `fit` sets `takes_trials_`, calls `_learn`
    and returns the estimator. For trials it provides:

    - `_fit_trials(X)`, which validates the trials and returns the arguments `trials`,
      `counts` and `observe` of :func:`draw_observations`;
    - `_check_trials(X)`, which validates trials for `transform` and returns them with
      their numbers of codes;
    - `_encode_trial`, the function that codes a trial, `_trial_coding`, its keyword
      arguments beside those of :func:`encode`, and `_unit`, what its rows are;
    - `_blocks`, the names of the channels or cells, each of which has all codes.
    """

    _parameter_constraints = {  # noqa: RUF012
        "n_atoms": [Interval(Integral, 1, None, closed="left")],
        "n_nonzero_coefs": [Interval(Integral, 1, None, closed="left")],
        "remove_mean": ["boolean"],
        "update": [StrOptions({"approximate", "exact"})],
        "max_iter": [Interval(Integral, 0, None, closed="left")],
        "tol": [Interval(Real, 0, 1, closed="left")],
        "dict_init": ["array-like", None],
        "sign": [StrOptions({"split", "absolute", "none"})],
        "memory": [str, HasMethods("cache"), None],
        "random_state": ["random_state"],
    }

    @one_blas_thread
    def _learn(self, X, y, max_train):
        """Learn the dictionary from trials, if `takes_trials_`, or from a table."""
        with fit_task(self, X, y, max_subtasks=self.max_iter) as task:
            self._learn_from(X, max_train, task.on_iteration)
        return self

    def _learn_from(self, X, max_train, on_iteration):
        rng = check_random_state(self.random_state)
        for name in ("feature_names_in_", "spatial_cells_", "window_step_"):
            vars(self).pop(name, None)  # of an earlier fit to another kind of data
        self.rate_ = rate_of(X, name=name_of(X))
        self._channel_names = channel_names(X)
        if self.takes_trials_:
            trials, counts, observe = self._fit_trials(X)
        else:
            rows = check_table(self, X, dtype=[np.float64, np.float32])
            trials, counts, observe = [rows], [len(rows)], np.ndarray.__getitem__
        observations = draw_observations(trials, counts, max_train, observe, rng)
        n_nonzero_coefs = min(self.n_nonzero_coefs, self.n_atoms)
        if n_nonzero_coefs < self.n_nonzero_coefs:
            warnings.warn(
                f"n_nonzero_coefs={self.n_nonzero_coefs} exceeds "
                f"n_atoms={self.n_atoms}; codes use at most {self.n_atoms} atoms.",
                UserWarning,
                stacklevel=2,
            )
        # Callbacks have to see the iterations, and may stop them.
        memory = check_cache(self.memory if on_iteration is None else None)
        learn = memory.cache(learn_dictionary)
        self.components_, self.n_iter_, self.reconstruction_error_ = learn(
            observations,
            self.n_atoms,
            n_nonzero_coefs,
            dict_init=self._check_dict_init(observations),
            remove_mean=self.remove_mean,
            update=self.update,
            max_iter=self.max_iter,
            tol=self.tol,
            # Drawn here, so that a cached result leaves rng in the same state.
            seed=rng.randint(np.iinfo(np.int32).max),
            callback=on_iteration,
        )
        # Parameters that are set after `fit` take effect with the next one.
        self._coding = {
            "n_nonzero_coefs": n_nonzero_coefs,
            "remove_mean": self.remove_mean,
            "sign": self.sign,
        }

    def fit_transform(self, X: Trials, y: None = None) -> FloatArray | Sequences:
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
        codes: FloatArray | Sequences = self.fit(X, y).transform(X)
        return codes

    def transform(self, X: Trials) -> FloatArray | Sequences:
        """Code observations over the dictionary.

        Parameters
        ----------
        X : array-like of shape (n_samples, n_features) or collection of trials
            Data of the kind given to `fit`. Parameters that were set after `fit` take
            effect with the next one.

        Returns
        -------
        codes : ndarray of shape (n_samples, n_codes) or Sequences
            For a table, one row per observation. For trials, one array per trial,
            coded each time it is asked for; `set_output` does not change these.
        """
        check_is_fitted(self)
        if not self.takes_trials_:
            return _wrap_data_with_container("transform", self._code_rows(X), X, self)
        rate_of(X, self.rate_, name=name_of(X))
        trials, lengths = self._check_trials(X)
        return Sequences(
            trials,
            self.get_feature_names_out(),
            row_index(X),
            encode=partial(
                self._encode_trial,
                atoms=self.components_,
                **self._coding,
                **self._trial_coding,
            ),
            lengths=lengths,
            unit=self._unit,
        )

    @one_blas_thread
    def _code_rows(self, X):
        X = check_table(self, X, dtype=[np.float64, np.float32], reset=False)
        return encode(X, self.components_, **self._coding)

    def get_feature_names_out(
        self, input_features: Names | None = None
    ) -> NDArray[np.object_]:
        """Return the names of the code columns.

        Parameters
        ----------
        input_features : array-like of str, default=None
            Ignored, but for a table checked against the columns seen in `fit`.

        Returns
        -------
        names : ndarray of str objects
            For a table ``atom0+``, …, ``atom0-``, … with `sign="split"`, else
            ``atom0``, …. For trials the same for each channel, as in ``ch0_atom0+``,
            or for each spatial cell, as in ``s2of9_atom3+``.
        """
        check_is_fitted(self)
        suffixes = ["+", "-"] if self._coding["sign"] == "split" else [""]
        atoms = range(len(self.components_))
        names = [f"atom{j}{suffix}" for suffix in suffixes for j in atoms]
        if self.takes_trials_:
            names = [f"{block}_{name}" for block in self._blocks for name in names]
        else:
            _check_feature_names_in(self, input_features, generate_names=False)
        return np.asarray(names, dtype=object)

    def __sklearn_is_fitted__(self):
        return hasattr(self, "_coding")  # which is set last

    def _check_dict_init(self, observations):
        if self.dict_init is None:
            return None
        check_numbers(self.dict_init, "dict_init")
        atoms = check_array(
            self.dict_init,
            dtype=observations.dtype,
            copy=True,
            input_name="dict_init",
        )
        expected = (self.n_atoms, observations.shape[1])
        if atoms.shape != expected:
            raise ValueError(
                f"dict_init has shape {atoms.shape}, but {expected} is expected: one "
                "row per atom, one column per entry of an observation."
            )
        return atoms

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags
