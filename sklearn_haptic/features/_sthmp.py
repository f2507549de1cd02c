"""ST-HMP: sparse codes of patches of tactile images, pooled over space."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils import check_array

from ..recordings._biotac import biotac_layout
from ..recordings._trials import check_trials, is_table, transposed_hint
from ..utils._sklearn import (
    Interval,
    Memory,
    RandomState,
    StrOptions,
    Trials,
    _fit_context,
)
from ..utils._validation import check_numbers
from ._dictionary_coder import DictionaryCoder, encode
from ._pooling import cell_bounds, check_cells

# Most patches coded at a time, so that their codes stay in the cache until pooled.
_CHUNK_SIZE = 8192


def electrode_images(trial, layout):
    """Turn electrode readings into images, the fingers side by side.

    A trial of shape (n_times, n_fingers * n_electrodes) has one finger after the other;
    `layout`, of shape (height, width, n_electrodes), is the weight of each of a
    finger's electrodes in each pixel. The images, of shape (n_times, height, n_fingers
    * width), have the dtype of the trial and time contiguous in memory.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.recordings._biotac import biotac_layout
    >>> from sklearn_haptic.features._sthmp import electrode_images
    >>> electrode_images(np.arange(1.0, 20.0)[np.newaxis], biotac_layout())[0, :3]
    array([[ 8.,  7.,  9.],
           [ 1., 10., 11.],
           [ 2., 17., 12.]])
    """
    height, width, n_electrodes = layout.shape
    weights = layout.reshape(-1, n_electrodes).T.astype(trial.dtype)
    readings = np.ascontiguousarray(trial)  # so that sums are the same in any layout
    pixels = (readings.reshape(-1, n_electrodes) @ weights).reshape(
        len(trial), -1, height, width
    )
    images = pixels.transpose(2, 1, 3, 0).reshape(height, -1, len(trial))
    return np.moveaxis(images, -1, 0)


def image_patches(images, patch_size):
    """View the patches of images of shape (n_times, height, width).

    They have the shape (n_times, n_rows, n_columns, patch_height, patch_width); from
    one to the next it is a pixel.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._sthmp import image_patches
    >>> image_patches(np.arange(9).reshape(1, 3, 3), (2, 2))[0, 1, 0]
    array([[3, 4],
           [6, 7]])
    """
    return np.lib.stride_tricks.sliding_window_view(images, patch_size, axis=(1, 2))


def spatial_grids(locations, cells):
    """Lay the levels of a pyramid as grids over the rows and columns of patches.

    `cells` has the number of cells along a side, one per level; a grid is the cells
    along both sides. No side has more cells than locations, and a grid equal to one
    before it is left out.

    Examples
    --------
    >>> from sklearn_haptic.features._sthmp import spatial_grids
    >>> spatial_grids((5, 4), (3, 2, 1)), spatial_grids((5, 1), (3, 2, 1))
    (((3, 3), (2, 2), (1, 1)), ((3, 1), (2, 1), (1, 1)))
    """
    n_rows, n_columns = locations
    return tuple(dict.fromkeys((min(n, n_rows), min(n, n_columns)) for n in cells))


def spatial_max_pool(codes, grids):
    """Pool codes over a pyramid of grids of cells.

    Location x of W along a side, counted from 1, belongs to cell ceil(x s / W) of s.
    Codes of shape (n_rows, n_columns, n_codes, n_times) become maxima of shape
    (n_cells, n_codes, n_times): levels in the order of the grids, and within each the
    cells row by row.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._sthmp import spatial_max_pool
    >>> spatial_max_pool(np.arange(6).reshape(2, 3, 1, 1), [(2, 2), (1, 1)]).ravel()
    array([0, 2, 3, 5, 5])
    """
    n_rows, n_columns, n_codes, n_times = codes.shape
    regions = [
        codes[top:bottom, left:right]
        for rows, columns in grids
        for top, bottom in zip(*cell_bounds(n_rows, rows))
        for left, right in zip(*cell_bounds(n_columns, columns))
    ]
    pooled = np.empty((len(regions), n_codes, n_times), dtype=codes.dtype)
    for region, out in zip(regions, pooled):
        np.maximum.reduce(region, axis=(0, 1), out=out)
    return pooled


def normalise_frames(frames):
    """Divide rows of any magnitude by their norms, in place; all-zero rows stay.

    It does what :func:`unit_rows` does, but in the precision of the codes and without a
    copy, which is faster for many frames.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic.features._sthmp import normalise_frames
    >>> normalise_frames(np.array([[3.0, 4.0], [0.0, 0.0]]))
    array([[0.6, 0.8],
           [0. , 0. ]])
    """
    peaks = np.maximum(frames.max(axis=1), -frames.min(axis=1))
    peaks[peaks == 0] = 1
    frames /= peaks[:, np.newaxis]  # so that no square overflows or underflows
    norms = np.sqrt(np.einsum("ij,ij->i", frames, frames))
    norms[norms == 0] = 1
    frames /= norms[:, np.newaxis]
    return frames


def encode_frames(
    trial,
    atoms,
    n_nonzero_coefs,
    *,
    layout,
    patch_size,
    grids,
    normalise,
    remove_mean,
    sign,
):
    """Code the frames of a trial: code their patches, pool over space, normalise.

    A trial holds electrode readings or, if `layout` is None, images of shape (n_times,
    height, width). The other parameters are those of :func:`electrode_images`,
    :func:`image_patches`, :func:`spatial_max_pool` and :func:`encode`. Return one row
    per frame, of norm 1 or all zero if asked to `normalise`, in the shape (n_times,
    n_cells * n_codes) with time contiguous in memory.
    """
    images = trial if layout is None else electrode_images(trial, layout)
    patches = image_patches(images, patch_size)
    n_rows, n_columns = patches.shape[1:3]
    n_pixels = atoms.shape[1]
    n_chunks = -(-len(trial) * n_rows * n_columns // _CHUNK_SIZE)
    frames = []
    for chunk in np.array_split(patches, min(n_chunks, len(trial))):
        # With time last, every operation runs over contiguous memory.
        by_pixel = chunk.transpose(3, 4, 1, 2, 0).reshape(n_pixels, -1)
        codes = encode(
            by_pixel.T, atoms, n_nonzero_coefs, remove_mean=remove_mean, sign=sign
        )
        by_time = codes.reshape(n_rows, n_columns, len(chunk), -1).swapaxes(2, 3)
        pooled = spatial_max_pool(np.ascontiguousarray(by_time), grids)
        pooled = pooled.reshape(-1, len(chunk))
        frames.append(normalise_frames(pooled.T).T if normalise else pooled)
    return np.concatenate(frames, axis=1).T


class STHMPTransformer(DictionaryCoder, TransformerMixin, BaseEstimator):
    """Sparse codes of tactile images, pooled over space.

    This is the spatial half of spatio-temporal hierarchical matching pursuit [1]_.
    Every frame is an image. Its overlapping patches are coded over a dictionary learned
    by K-SVD, the codes are max-pooled over a pyramid of cells, and each frame may be
    scaled to norm 1. :class:`TemporalMaxPool` is the temporal half.

    Parameters
    ----------
    n_atoms : int, default=10
        Number of atoms.
    n_nonzero_coefs : int, default=4
        Most atoms that the code of a patch may use. The 2020 paper does not give it;
        the authors of ST-HMP use 4.
    layout : "biotac", None or array-like of shape (height, width, n_electrodes), \
            default="biotac"
        How the electrodes of a finger form an image: the weight of each electrode in
        each pixel. "biotac" arranges the 19 electrodes of a BioTac in 7 × 3 pixels. The
        images of all fingers are joined side by side. None takes trials that are
        images already.
    patch_size : tuple of int or None, default=(3, 3)
        Height and width of a patch in pixels. None takes 3 × 3, or where a side of the
        images, or of the layout, has fewer than five pixels, 2 × 2.
    spatial_cells : sequence of int, default=(3, 2, 1)
        Number of cells along both sides, one per level of the pyramid. The default
        gives 9 + 4 + 1 cells. A side has no more cells than locations of patches: one
        BioTac has 5 × 1 locations, hence 3 + 2 + 1 cells. A level equal to one before
        it is left out.
    normalise : bool, default=True
        Whether to scale the pooled codes of each frame to norm 1, as the authors of
        ST-HMP do and the 2020 paper does not say. A light touch then counts as much as
        a firm one, and how firm it is gets lost.
    remove_mean : bool, default=True
        Whether to subtract the mean of each patch, as the authors of ST-HMP do.
    update : {"approximate", "exact"}, default="approximate"
        Fit an atom by one step of alternating least squares, or by the leading
        singular pair of the residual that it has to represent.
    max_iter : int, default=50
        Most iterations of K-SVD. 0 takes the initial dictionary, as the pipelines of
        :func:`make_haptic_pipeline` do.
    tol : float, default=1e-3
        Stop when five iterations lower the training error by less than this fraction.
    max_train_patches : int, default=20_000
        Most patches to learn from, drawn at random; None takes all.
    dict_init : array-like of shape (n_atoms, n_patch_pixels), default=None
        Initial atoms, pixels row by row; with `max_iter=0` they are used exactly as
        given. By default training patches are drawn, no two of which are nearly
        parallel.
    sign : {"split", "absolute", "none"}, default="split"
        Give the positive and the negative part of a coefficient a column each, take
        absolute values, or keep coefficients as they are. The authors of ST-HMP
        recommend the split.
    memory : str or object with the joblib.Memory interface, default=None
        Where to cache the dictionary, as in :class:`KSVDTransformer`. By default
        nothing is cached.
    random_state : int, RandomState instance or None, default=None
        Seeds the draw of training patches and of initial atoms, and the order of
        updates.

    Attributes
    ----------
    components_ : ndarray of shape (n_atoms, n_patch_pixels)
        The dictionary. After an iteration or more, the entry of largest magnitude of
        each atom is positive.
    n_iter_ : int
        Iterations run.
    reconstruction_error_ : float
        Root mean squared error, per pixel and in units of `X`, of the training
        patches coded over `components_`.
    layout_ : ndarray of shape (height, width, n_electrodes) or None
        The weight of each electrode of a finger in each pixel; None for images.
        ``layout_ @ finger.T`` turns the readings of a finger, of shape (n_times,
        n_electrodes), into images of shape (height, width, n_times).
    patch_size_ : tuple of int
        Height and width of a patch in pixels.
    spatial_cells_ : tuple of tuple of int (n_rows, n_columns)
        Rows and columns of cells of each level. Defined for trials.
    rate_ : float or None
        Samples per second, by the time stamps of trials of pandas, if they have any.
        `transform` refuses trials that contradict it.
    takes_trials_ : bool
        Whether trials were fitted; else rows of a table.
    n_features_in_ : int
        Number of columns of a table, or of values per time sample of the trials.
    feature_names_in_ : ndarray of shape (`n_features_in_`,)
        Names of the columns of a table. Defined if it has any.

    See Also
    --------
    TemporalMaxPool : Turn the sequences into rows of fixed length.
    KSVDTransformer : The same for signals without a spatial arrangement.

    Notes
    -----
    The array of a trial has columns with names like `s2of9_atom3+`, the second of nine
    cells. Levels come in the order given, the cells of each level row by row, and each
    cell has all codes, positive parts before negative ones. The rows of a table are
    taken for patches and coded without pooling.

    A frame without contrast gives exact zeros, whatever rounding leaves when means are
    removed. Multiplying recordings by a power of two changes no digit of the
    codes. The authors of ST-HMP add 2.2e-16 to each norm and stop a pursuit at an
    absolute correlation of 1e-7, so their codes depend on the unit of measurement.

    References
    ----------
    .. [1] Madry, M., Bo, L., Kragic, D. & Fox, D. (2014). ST-HMP: unsupervised
       spatio-temporal feature learning for tactile data. ICRA 2014.
       :doi:`10.1109/ICRA.2014.6907172`

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn_haptic import STHMPTransformer
    >>> rng = np.random.default_rng(0)
    >>> trials = [rng.normal(size=(n_times, 38)) for n_times in (40, 60)]
    >>> sthmp = STHMPTransformer(random_state=0)
    >>> [frames.shape for frames in sthmp.fit_transform(trials)]
    [(40, 280), (60, 280)]
    >>> sthmp.get_feature_names_out()[[0, -1]]
    array(['s1of9_atom0+', 's1of1_atom9-'], dtype=object)
    """

    _parameter_constraints = {  # noqa: RUF012
        **DictionaryCoder._parameter_constraints,
        "max_train_patches": [Interval(Integral, 1, None, closed="left"), None],
        "layout": [StrOptions({"biotac"}), "array-like", None],
        "patch_size": [tuple, list, None],
        "spatial_cells": ["array-like"],
        "normalise": ["boolean"],
    }

    _encode_trial = staticmethod(encode_frames)
    _unit = "frames"

    def __init__(
        self,
        n_atoms: int = 10,
        n_nonzero_coefs: int = 4,
        *,
        layout: Literal["biotac"] | ArrayLike | None = "biotac",
        patch_size: tuple[int, int] | None = (3, 3),
        spatial_cells: Sequence[int] = (3, 2, 1),
        normalise: bool = True,
        remove_mean: bool = True,
        update: Literal["approximate", "exact"] = "approximate",
        max_iter: int = 50,
        tol: float = 1e-3,
        max_train_patches: int | None = 20_000,
        dict_init: ArrayLike | None = None,
        sign: Literal["split", "absolute", "none"] = "split",
        memory: str | Memory | None = None,
        random_state: RandomState = None,
    ) -> None:
        self.n_atoms = n_atoms
        self.n_nonzero_coefs = n_nonzero_coefs
        self.layout = layout
        self.patch_size = patch_size
        self.spatial_cells = spatial_cells
        self.normalise = normalise
        self.remove_mean = remove_mean
        self.update = update
        self.max_iter = max_iter
        self.tol = tol
        self.max_train_patches = max_train_patches
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
            Trials of shape (n_times_i, n_fingers * n_electrodes) or, with
            `layout=None`, (n_times_i, height, width).
        y : None
            Ignored.

        Returns
        -------
        self : STHMPTransformer

        Raises
        ------
        ValueError
            If the number of channels is not a multiple of the number of electrodes of
            the layout, or if the images are smaller than a patch.
        """
        self.takes_trials_ = not is_table(X)
        self.layout_ = self._check_layout()
        self.patch_size_ = self._check_patch_size()
        return self._learn(X, y, self.max_train_patches)

    @property
    def _blocks(self):
        return [
            f"s{i}of{rows * columns}"
            for rows, columns in self.spatial_cells_
            for i in range(1, rows * columns + 1)
        ]

    @property
    def _trial_coding(self):
        return {
            "layout": self.layout_,
            "patch_size": self.patch_size_,
            "grids": self.spatial_cells_,
            "normalise": self._normalise,
        }

    def _fit_trials(self, X):
        layout = self.layout_
        trials = check_trials(X, ndims=(2,) if layout is not None else (3,))
        self._frame_shape = trials[0].shape[1:]
        self.n_features_in_ = int(np.prod(self._frame_shape))
        if layout is not None and self.n_features_in_ % layout.shape[2]:
            raise ValueError(
                f"X has {self.n_features_in_} channels, which is no multiple of the "
                f"{layout.shape[2]} electrodes of layout; select the electrodes' "
                "channels, give the layout of your sensor, or describe it to "
                "make_haptic_pipeline, such as {'electrodes': Signal(rate=100)}."
                f"{transposed_hint(trials[0].shape)}"
            )
        if self.patch_size is None:
            sides = self._frame_shape if layout is None else layout.shape[:2]
            usual = 3 if min(sides) >= 5 else 2
            self.patch_size_ = (min(usual, sides[0]), min(usual, sides[1]))
        patch_size = self.patch_size_

        def patches(trial):
            images = trial if layout is None else electrode_images(trial, layout)
            height, width = images.shape[1:]
            if height < patch_size[0] or width < patch_size[1]:
                raise ValueError(
                    f"patch_size={patch_size} does not fit images of {height} × "
                    f"{width} pixels; use smaller patches."
                )
            return image_patches(images, patch_size)

        locations = patches(trials[0][:1]).shape[1:3]
        cells = check_cells(self.spatial_cells, "spatial_cells")
        self.spatial_cells_ = spatial_grids(locations, cells)
        self._normalise = self.normalise

        def observe(trial, indices):
            frame, row, column = np.unravel_index(indices, (len(trial), *locations))
            drawn = patches(trial[frame])[np.arange(len(indices)), row, column]
            return drawn.reshape(len(indices), -1)

        n_patches = [len(trial) * locations[0] * locations[1] for trial in trials]
        return trials, n_patches, observe

    def _check_trials(self, X):
        if is_table(X):
            raise ValueError(
                "X is a table, but fit was given trials; give a collection of trials."
            )
        trials = check_trials(
            X,
            ndims=(len(self._frame_shape) + 1,),
            n_channels=self._frame_shape,
            names=self._channel_names,
        )
        return trials, [len(trial) for trial in trials]

    def _check_patch_size(self):
        size = (3, 3) if self.patch_size is None else tuple(self.patch_size)
        if len(size) != 2 or not all(isinstance(n, Integral) and n > 0 for n in size):
            raise ValueError(
                f"patch_size={self.patch_size!r} must be two positive integers, the "
                "height and the width of a patch."
            )
        return size

    def _check_layout(self):
        if self.layout is None:
            return None
        if isinstance(self.layout, str):
            return biotac_layout()
        check_numbers(self.layout, "layout")
        layout = check_array(
            self.layout, allow_nd=True, dtype=np.float64, input_name="layout"
        )
        if layout.ndim != 3:
            raise ValueError(
                f"layout has shape {layout.shape}; it must be (height, width, "
                "n_electrodes), the weight of each electrode in each pixel."
            )
        return layout
