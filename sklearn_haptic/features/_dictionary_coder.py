"""What transformers with a dictionary learned by K-SVD share."""

from functools import partial
from numbers import Integral, Real

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.callback import CallbackSupportMixin
from sklearn.utils import check_array, check_random_state
from sklearn.utils.random import sample_without_replacement
from sklearn.utils.validation import check_is_fitted, check_memory

from .._check_trials import channel_names
from .._sequences import Sequences
from .._sklearn import (
    DocumentedEstimator,
    FloatArray,
    HasMethods,
    Interval,
    Names,
    StrOptions,
    Trials,
    _check_feature_names_in,
    fit_task,
    one_blas_thread,
)
from .._validation import check_numbers, check_sparsity, check_table
from ._ksvd import initial_atoms, ksvd
from ._sparse_coding import batch_omp, dense_codes, row_norms, unit_rows


def encode(observations, atoms, n_nonzero_coefs, *, remove_mean=True, sign="split"):
    """Code observations over a dictionary.

    Parameters
    ----------
    observations : ndarray of shape (n_obs, n_obs_features)
        Observations, float32 or float64.
    atoms : ndarray of shape (n_atoms, n_obs_features)
        Dictionary.
    n_nonzero_coefs : int
        Most atoms that one code may use.
    remove_mean : bool, default=True
        Whether to subtract each observation's mean.
    sign : {"split", "absolute", "none"}, default="split"
        What becomes of signs, see :func:`dense_codes`.

    Returns
    -------
    codes : ndarray of shape (n_obs, n_atoms) or (n_obs, 2 * n_atoms)
        Columns are the atoms or, with `sign="split"`, the positive parts of all
        followed by the negative parts of all.

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
    """Return observations, mean removed if asked, and their norms before."""
    scale = row_norms(observations)
    # The norm times sqrt(n) bounds the sum of a row and what mean removal leaves.
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
    """Gather at most `limit` observations, drawn without replacement.

    Parameters
    ----------
    trials : list of ndarray
        What the observations are drawn from.
    counts : list of int
        Number of observations in each trial.
    limit : int or None
        Most observations; None takes all.
    observe : callable
        Called with a trial and indices, at least one, of its observations; returns
        these as rows.
    rng : RandomState
        Source of randomness.

    Returns
    -------
    observations : ndarray of shape (n_obs, n_obs_features)
        The observations drawn, in their order.
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
    """Learn a dictionary.

    Parameters
    ----------
    observations : ndarray of shape (n_obs, n_obs_features)
        Training observations.
    n_atoms, n_nonzero_coefs, remove_mean, update, max_iter, tol
        As in :class:`KSVDTransformer`.
    dict_init : ndarray of shape (n_atoms, n_obs_features) or None
        Initial atoms; None draws them.
    seed : int
        Seed of the initial atoms and of the order of updates.
    callback : callable, default=None
        Passed on to :func:`ksvd`.

    Returns
    -------
    atoms : ndarray of shape (n_atoms, n_obs_features)
        The dictionary.
    n_iter : int
        Iterations run.
    error : float
        Root mean squared error of the observations coded over it.

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
    residual = signals - dense_codes(support, coefs, len(atoms)) @ atoms
    error = row_norms(residual.reshape(1, -1))[0] / np.sqrt(residual.size)
    return atoms, len(errors), error


class _UnwrappedSequences:
    """Mixin, first among the bases, for transformers that may return sequences.

    scikit-learn's `set_output` wraps the methods that a `TransformerMixin` class
    defines itself. This class is none, so what it returns stays as it is; tables
    go on to the next class's `transform`, which is wrapped.
    """

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
        return self.fit(X, y).transform(X)  # type: ignore[attr-defined]

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
            One row an observation for a table. For trials a sequence of arrays, one
            a trial, which `set_output` leaves as it is. It refers to the trials and
            codes one each time its array is asked for, so that the codes of a whole
            corpus need not fit in memory; `list` codes all and keeps the arrays.
        """
        check_is_fitted(self)
        if self._codes_trials:  # type: ignore[attr-defined]
            return self._transform_trials(X)  # type: ignore[attr-defined]
        return super().transform(X)  # type: ignore[misc]


class _DictionaryCoder(
    DocumentedEstimator, CallbackSupportMixin, TransformerMixin, BaseEstimator
):
    """What transformers with a learned dictionary share; codes tables.

    A subclass takes the parameters below, puts :class:`_UnwrappedSequences`
    before this class, sets `_codes_trials` in `fit` (whether it takes trials), and
    provides `_draw_from_trials`, `_transform_trials` and, for trials, its own
    `get_feature_names_out`. How observations are coded is settled by `fit` and
    kept in `_coding`, keyword arguments of :func:`encode`; a subclass keeps what
    else its codes depend on in the same way.
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
        """Learn the dictionary from a table or, if `_codes_trials`, from trials."""
        with fit_task(self, X, y, max_subtasks=self.max_iter) as task:
            self._learn_from(X, max_train, task.on_iteration)
        return self

    def _learn_from(self, X, max_train, on_iteration):
        rng = check_random_state(self.random_state)
        self._channel_names = None
        if self._codes_trials:
            vars(self).pop("feature_names_in_", None)  # of an earlier fit to a table
            self._channel_names = channel_names(X)
            observations = self._draw_from_trials(X, rng)
        else:
            rows = check_table(self, X, dtype=[np.float64, np.float32])
            observations = draw_observations(
                [rows], [len(rows)], max_train, np.ndarray.__getitem__, rng
            )
        n_nonzero_coefs = check_sparsity(self.n_nonzero_coefs, self.n_atoms)
        # Callbacks have to see the iterations, and may stop them.
        memory = check_memory(self.memory if on_iteration is None else None)
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
        # What `transform` does is settled here, whatever is set after.
        self._coding = {
            "n_nonzero_coefs": n_nonzero_coefs,
            "remove_mean": self.remove_mean,
            "sign": self.sign,
        }

    def _sequences(
        self, trials, lengths, encode_trial, index, unit="frames", **options
    ):
        """Return trials' codes, each made by `encode_trial` on demand."""
        encode_trial = partial(
            encode_trial,
            atoms=self.components_,
            **self._coding,
            **options,
        )
        return Sequences(
            trials,
            self.get_feature_names_out(),
            index,
            encode=encode_trial,
            lengths=lengths,
            unit=unit,
        )

    @property
    def _code_names(self):
        """Names of the columns of :func:`encode`."""
        suffixes = ["+", "-"] if self._coding["sign"] == "split" else [""]
        atoms = range(len(self.components_))
        return [f"atom{j}{suffix}" for suffix in suffixes for j in atoms]

    @one_blas_thread
    def transform(self, X):
        """Code the rows of a table; see :class:`_UnwrappedSequences`."""
        X = check_table(self, X, dtype=[np.float64, np.float32], reset=False)
        return encode(X, self.components_, **self._coding)

    def get_feature_names_out(
        self, input_features: Names | None = None
    ) -> NDArray[np.object_]:
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
                "row an atom, one column an entry of an observation."
            )
        return atoms

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.transformer_tags.preserves_dtype = ["float64", "float32"]
        return tags
