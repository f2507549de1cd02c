import numpy as np
import pandas as pd
import pytest
from cached_rows import assert_an_entry_each
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone
from sklearn.linear_model import orthogonal_mp
from sklearn.pipeline import make_pipeline

from sklearn_haptic import KSVDTransformer, Sequences, STHMPTransformer, TemporalMaxPool
from sklearn_haptic.features import _dictionary_coder
from sklearn_haptic.features._dictionary_coder import encode
from sklearn_haptic.features._sthmp import (
    electrode_images,
    image_patches,
    spatial_grids,
    spatial_max_pool,
)
from sklearn_haptic.recordings._biotac import biotac_layout

LAYOUT = biotac_layout()
SIGNS = {"omp": "absolute", "omp_sign": "split"}

# Electrode places in mm as (x towards the tip, y across).
PLACES = [
    (0.993, -4.855),
    (-2.7, -3.513),
    (-6.2, -3.513),
    (-8, -4.956),
    (-10.5, -3.513),
    (-13.4, -4.956),
    (4.763, 0),
    (3.031, -1.95),
    (3.031, 1.95),
    (1.299, 0),
]
PLACES += [(x, -y) for x, y in PLACES[:6]] + [(-2.8, 0), (-9.8, 0), (-13.6, 0)]


def electrodes(lengths=(40, 25), n_fingers=2, dtype=np.float64, seed=0):
    rng = np.random.default_rng(seed)
    return [
        rng.normal(size=(n, 19 * n_fingers)).cumsum(axis=0).astype(dtype)
        for n in lengths
    ]


def small(**params):
    return STHMPTransformer(
        **{"n_atoms": 6, "max_iter": 3, "random_state": 0, **params}
    )


@pytest.fixture(scope="module")
def reference(shared_data):
    with np.load(shared_data / "sthmp_reference" / "sthmp_reference.npz") as arrays:
        return dict(arrays)


@pytest.fixture(scope="module")
def authors(reference):
    """Estimators with the authors' dictionary and order, by variant."""
    # Their patches run down columns, ours along rows.
    atoms = reference["D"].T.reshape(10, 3, 3).swapaxes(1, 2).reshape(10, 9)
    return {
        variant: STHMPTransformer(
            10,
            int(reference["T"]),
            layout=None,
            spatial_cells=reference["spatial_levels"],
            dict_init=atoms,
            max_iter=0,
            sign=sign,
        )
        for variant, sign in SIGNS.items()
    }


# Layout


def test_layout_keeps_the_places_of_electrodes():
    assert LAYOUT.shape == (7, 3, 19)
    assert_allclose(LAYOUT.sum(axis=2), 1)
    _, columns, electrode = np.nonzero(LAYOUT == 1)
    assert_array_equal(np.sort(electrode), np.arange(19))
    places = np.array(PLACES)[electrode]
    assert_array_equal(columns, np.sign(places[:, 1]) + 1)
    for column in range(3):  # further rows are further from the tip
        assert (np.diff(places[columns == column, 0]) < 0).all()


def test_layout_interpolates_from_the_eight_neighbours():
    interpolated = np.argwhere((LAYOUT > 0).sum(axis=2) > 1)
    assert_array_equal(interpolated, [[3, 1], [4, 1]])
    single = np.where((LAYOUT == 1).any(axis=2), LAYOUT.argmax(axis=2), -1)
    for row, column in interpolated:
        around = single[row - 1 : row + 2, column - 1 : column + 2].ravel()
        known = np.sort(around[around >= 0])
        assert len(known) == 7
        assert_array_equal(np.flatnonzero(LAYOUT[row, column]), known)
        assert_allclose(LAYOUT[row, column, known], 1 / 7)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_fingers_are_joined_along_the_long_edge(dtype):
    channels = electrodes((5,), n_fingers=3, dtype=dtype)[0]
    images = electrode_images(channels, LAYOUT)
    assert images.shape == (5, 7, 9)
    assert images.dtype == dtype
    for finger in range(3):
        one = channels[:, 19 * finger : 19 * (finger + 1)]
        expected = np.einsum("te,hwe->thw", one, LAYOUT)
        assert_allclose(images[:, :, 3 * finger : 3 * finger + 3], expected, rtol=1e-5)
    # Values of single electrodes are exact.
    assert_array_equal(images[:, 0, 6], channels[:, 38 + 7])


# Patches, space, norm


@pytest.mark.parametrize("patch_size", [(3, 3), (2, 4), (1, 1), (7, 6)])
def test_patches_equal_brute_force(patch_size):
    images = np.random.default_rng(0).normal(size=(4, 7, 6))
    patches = image_patches(images, patch_size)
    height, width = patch_size
    expected = [
        [images[:, y : y + height, x : x + width] for x in range(6 - width + 1)]
        for y in range(7 - height + 1)
    ]
    assert_array_equal(patches, np.moveaxis(expected, 2, 0))


@pytest.mark.parametrize("seq", ["seq0", "seq1", "seq4"])
def test_patches_equal_the_authors(reference, seq):
    picked = reference[f"{seq}_picked_frames"]
    patches = image_patches(reference[seq], (3, 3))[picked]
    theirs = reference[f"{seq}_patches_raw"]  # both orders run down columns
    theirs = theirs.reshape(len(picked), 3, 3, 4, 5).transpose(0, 4, 3, 2, 1)
    assert_array_equal(patches, theirs)


@pytest.mark.parametrize("level", [1, 2, 3])
def test_cells_of_patches_equal_the_authors(reference, level):
    cell = reference["cell_of_patch"][:, level - 1].reshape(4, 5).T
    # A code for each position: one there, zero elsewhere.
    codes = np.eye(20).reshape(5, 4, 20, 1)
    pooled = spatial_max_pool(codes, [(level, level)])[..., 0]
    assert_array_equal(pooled.argmax(axis=0).reshape(5, 4), cell)
    assert_array_equal(pooled.sum(axis=0), 1)


@pytest.mark.parametrize("size", [(17, 11), (15, 13), (7, 9), (3, 3)])
def test_spatial_cells_are_exact_for_any_size(size):
    codes = np.eye(size[0] * size[1]).reshape(*size, -1, 1)
    for n in range(1, min(size) + 1):
        row, column = (
            [-(-x * n // length) - 1 for x in range(1, length + 1)] for length in size
        )
        expected = np.add.outer(np.multiply(row, n), column)
        pooled = spatial_max_pool(codes, [(n, n)])[..., 0]
        assert_array_equal(pooled.argmax(axis=0).reshape(size), expected)
        assert pooled.any(axis=1).all()  # no cell is empty


@pytest.mark.parametrize("positions", [(5, 4), (5, 1), (1, 5), (2, 2), (2, 3), (1, 1)])
@pytest.mark.parametrize("cells", [(3, 2, 1), (1, 3), (9,), (16, 4, 3, 2)])
def test_no_side_has_more_cells_than_positions(positions, cells):
    """A cell for each place that the cells of a level give to any position."""
    places = [
        tuple(
            len({-(-x * min(n, length) // length) for x in range(1, length + 1)})
            for length in positions
        )
        for n in cells
    ]
    grids = spatial_grids(positions, cells)
    assert list(grids) == sorted(set(places), key=places.index)
    codes = np.eye(positions[0] * positions[1]).reshape(*positions, -1, 1)
    pooled = spatial_max_pool(codes, grids)
    assert len(pooled) == sum(rows * columns for rows, columns in grids)
    levels = np.split(pooled, np.cumsum([rows * columns for rows, columns in grids]))
    for level in levels[:-1]:  # each position in one cell, none empty
        assert_array_equal(level.sum(axis=0), 1)
        assert level.any(axis=1).all()


# The authors' vectors


def untouched_by_their_threshold(reference, seq):
    """Mark frames whose codes do not depend on the scale of the signal.

    The authors stop a pursuit at an absolute correlation of 1e-7, which empties or
    truncates the codes of frames 10 to 14 of seq4, scaled by 1e-9 to 1e-5. Here
    thresholds are relative, so those frames keep the codes that their unscaled
    originals would have.
    """
    comparable = np.ones(len(reference[seq]), dtype=bool)
    if seq == "seq4":
        comparable[10:15] = False
    return comparable


@pytest.mark.parametrize("variant", SIGNS)
@pytest.mark.parametrize("seq", ["seq0", "seq1", "seq4"])
def test_frame_vectors_equal_the_authors(reference, authors, variant, seq):
    frames = authors[variant].fit_transform([reference[seq]])[0]
    theirs = reference[f"{variant}_{seq}_frame_vectors"]
    comparable = untouched_by_their_threshold(reference, seq)
    if len(theirs) < len(frames):
        picked = reference[f"{seq}_picked_frames"]
        frames, comparable = frames[picked], comparable[picked]
    assert_allclose(frames[comparable], theirs[comparable], atol=1e-12)
    assert_array_equal(frames[comparable].any(axis=1), theirs[comparable].any(axis=1))


@pytest.mark.parametrize("variant", SIGNS)
@pytest.mark.parametrize("seq", ["seq0", "seq1", "seq4"])
def test_codes_and_pooled_codes_equal_the_authors(reference, authors, variant, seq):
    estimator = authors[variant].fit([reference[seq]])
    picked = reference[f"{seq}_picked_frames"]
    comparable = untouched_by_their_threshold(reference, seq)[picked]
    patches = image_patches(reference[seq], (3, 3))[picked[comparable]]
    codes = encode(
        patches.reshape(-1, 9),
        estimator.components_,
        estimator.n_nonzero_coefs,
        sign=estimator.sign,
    ).reshape(len(patches), 5, 4, -1)
    theirs = reference[f"{variant}_{seq}_codes_picked"][comparable]
    theirs = theirs.reshape(*theirs.shape[:2], 4, 5).transpose(0, 3, 2, 1)
    scale = np.abs(theirs).max(axis=(1, 2, 3), initial=1, keepdims=True)
    assert_allclose(codes / 3 / scale, theirs / scale, atol=1e-12)

    grids = [(1, 1), (2, 2), (3, 3)]
    pooled = np.moveaxis(spatial_max_pool(np.moveaxis(codes, 0, -1), grids), -1, 0)
    raw = reference[f"{variant}_{seq}_frame_vectors_raw"]
    if len(raw) == len(reference[seq]):
        raw = raw[picked]
    assert_allclose(
        pooled.reshape(len(pooled), -1) / 3 / scale[:, :, 0, 0],
        raw[comparable] / scale[:, :, 0, 0],
        atol=1e-12,
    )


@pytest.mark.parametrize("variant", SIGNS)
@pytest.mark.parametrize("seq", ["seq0", "seq1", "seq4"])
def test_final_vectors_equal_the_authors(reference, authors, variant, seq):
    levels = reference["temporal_levels"]
    features = make_pipeline(authors[variant], TemporalMaxPool(levels, split="floor"))
    ours = features.fit_transform([reference[seq]]).reshape(31, -1)
    theirs = reference[f"{variant}_{seq}_final"].reshape(31, -1)
    usable = np.ones((len(reference[seq]), 1))
    usable[~untouched_by_their_threshold(reference, seq)] = -1
    lowest = TemporalMaxPool(levels, split="floor").fit_transform([-usable]).ravel()
    comparable = lowest == -1  # cells without a frame that may differ
    assert comparable.sum() == {"seq0": 31, "seq1": 31, "seq4": 23}[seq]
    assert_allclose(ours[comparable], theirs[comparable], atol=1e-12)


# Numbers at the extremes


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("level", [0, 0.1, 1234.7, 1e6 + 0.1, 3400])
def test_constant_frames_code_to_exact_zero(dtype, level):
    trials = electrodes(dtype=dtype)
    estimator = small().fit(trials)
    constant = np.full((3, 38), level, dtype=dtype)
    assert_array_equal(estimator.transform([constant])[0], 0)


def test_float32_is_kept_and_close():
    double = small().fit(electrodes())
    single = clone(double).fit(electrodes(dtype=np.float32))
    assert single.components_.dtype == np.float32
    frames = single.transform(electrodes(dtype=np.float32))[0]
    assert frames.dtype == np.float32
    assert_allclose(np.linalg.norm(frames, axis=1), 1, rtol=1e-5)


def test_frames_of_a_long_trial_are_coded_as_alone():
    """Their 10,000 patches per finger are more than are coded at a time."""
    (trial,) = electrodes((2_000,))
    estimator = small().fit([trial])
    (frames,) = estimator.transform([trial])
    alone = estimator.transform([frame[np.newaxis] for frame in trial[::97]])
    assert_allclose(frames[::97], np.concatenate(list(alone)), atol=1e-12)


# The estimator


def test_sizes_of_the_paper():
    trials = electrodes((40, 35))
    for sign, n_features in {"split": 8680, "absolute": 4340, "none": 4340}.items():
        features = make_pipeline(
            STHMPTransformer(sign=sign, max_iter=2, random_state=0), TemporalMaxPool()
        )
        assert features.fit_transform(trials).shape == (2, n_features)
        assert len(features.get_feature_names_out()) == n_features


def test_names_and_order():
    estimator = small(n_atoms=2, n_nonzero_coefs=2, spatial_cells=(2, 1))
    output = estimator.fit_transform(electrodes())
    assert isinstance(output, Sequences)
    assert output[0].shape == (40, 5 * 4)
    names = estimator.get_feature_names_out()
    assert_array_equal(output.feature_names, names)
    assert names.dtype == object
    codes = ["atom0+", "atom1+", "atom0-", "atom1-"]
    assert names[:4].tolist() == [f"s1of4_{code}" for code in codes]
    assert names[-4:].tolist() == [f"s1of1_{code}" for code in codes]
    assert estimator.n_features_in_ == 38


def test_split_holds_what_the_other_signs_drop():
    trials = electrodes()
    atoms = small().fit(trials).components_
    split, absolute = (
        small(dict_init=atoms, max_iter=0, sign=sign, spatial_cells=(1,))
        .fit_transform(trials)[0]
        .reshape(40, -1, 6)
        for sign in ("split", "absolute")
    )
    strongest = split.max(axis=1)
    assert_allclose(
        strongest / np.linalg.norm(strongest, axis=1, keepdims=True), absolute[:, 0]
    )


def test_images_and_electrodes_agree():
    trials = electrodes()
    images = [electrode_images(trial, LAYOUT) for trial in trials]
    expected = small().fit_transform(trials)
    estimator = small(layout=None).fit(images)
    assert estimator.n_features_in_ == 42
    for frames, wanted in zip(estimator.transform(images), expected):
        assert_allclose(frames, wanted, atol=1e-12)


def test_one_finger_has_a_column_of_positions():
    trials = electrodes(n_fingers=1)
    estimator = small(sign="absolute").fit(trials)
    assert estimator.spatial_cells_ == ((3, 1), (2, 1), (1, 1))
    names = estimator.get_feature_names_out()
    assert len(set(names)) == len(names) == 6 * 6
    assert names[[0, 6, 18, 35]].tolist() == [
        "s1of3_atom0",
        "s2of3_atom0",
        "s1of2_atom0",
        "s1of1_atom5",
    ]
    for trial, frames in zip(trials, estimator.transform(trials)):
        patches = np.einsum("te,hwe->thw", trial, LAYOUT)
        codes = np.array(
            [
                encode(
                    patches[:, row : row + 3].reshape(-1, 9),
                    estimator.components_,
                    estimator.n_nonzero_coefs,
                    sign="absolute",
                )
                for row in range(5)
            ]
        )
        cells = [(0, 1), (1, 3), (3, 5), (0, 2), (2, 5), (0, 5)]
        pooled = np.hstack([codes[top:end].max(axis=0) for top, end in cells])
        norms = np.linalg.norm(pooled, axis=1, keepdims=True)
        assert_allclose(frames, pooled / norms, atol=1e-12)


def test_parameters_set_after_fit_wait_for_the_next_fit():
    trials = electrodes()
    model = make_pipeline(small(), TemporalMaxPool((2, 1))).fit(trials)
    expected, names = model.transform(trials), model.get_feature_names_out()
    model[0].set_params(
        layout=None, patch_size=(2, 2), spatial_cells=(1,), max_train_patches=1
    )
    assert_array_equal(model.transform(trials), expected)
    assert_array_equal(model.get_feature_names_out(), names)


def test_custom_layout():
    rng = np.random.default_rng(0)
    trials = [rng.normal(size=(n, 32)) for n in (20, 30)]
    layout = np.eye(16).reshape(4, 4, 16)
    estimator = small(layout=layout, spatial_cells=(2, 1)).fit(trials)
    images = [
        trial.reshape(-1, 2, 4, 4).swapaxes(1, 2).reshape(-1, 4, 8) for trial in trials
    ]
    expected = small(layout=None, spatial_cells=(2, 1)).fit_transform(images)
    assert_allclose(estimator.transform(trials)[1], expected[1], atol=1e-12)


def test_table_is_coded_as_by_ksvd():
    X = np.random.default_rng(0).normal(size=(60, 9))
    codes = small().fit_transform(X)
    ksvd = KSVDTransformer(n_atoms=6, max_iter=3, random_state=0)
    assert_array_equal(codes, ksvd.fit_transform(X))


@pytest.mark.parametrize("limit", [50, None])
def test_dictionary_is_learned_from_patches(limit):
    trials = electrodes()
    patches = [
        image_patches(electrode_images(trial, LAYOUT), (3, 3)) for trial in trials
    ]
    table = np.concatenate([each.reshape(-1, 9) for each in patches])
    params = {"n_atoms": 6, "max_iter": 3}
    expected = KSVDTransformer(**params, max_train_windows=limit, random_state=0)
    expected.fit(table)
    components = small(**params, max_train_patches=limit).fit(trials).components_
    assert_allclose(components, expected.components_, atol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("n_fingers", [1, 2])
@pytest.mark.parametrize("limit", [1, 20, 500])
def test_most_trials_give_no_patch(n_fingers, limit):
    """As many patches as asked for, each drawn once, of far more trials."""
    trials = electrodes([2] * 5000, n_fingers)
    seen = []

    def learn(observations, n_atoms, *_, **__):
        seen.append(observations)
        return observations[:1].repeat(n_atoms, axis=0), 0, 0.0

    estimator = small(max_train_patches=limit)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(_dictionary_coder, "learn_dictionary", learn)
        estimator.fit(trials)
    patches = [image_patches(electrode_images(t, LAYOUT), (3, 3)) for t in trials]
    known = {patch.round(6).tobytes() for patch in np.reshape(patches, (-1, 9))}
    drawn = {patch.round(6).tobytes() for patch in seen[0]}
    assert len(drawn) == len(seen[0]) == limit
    assert drawn <= known


def test_refit_on_trials_forgets_a_table():
    table = pd.DataFrame(np.random.default_rng(0).normal(size=(60, 9)))
    estimator = small().fit(table.rename(columns=str))
    assert not hasattr(estimator, "spatial_cells_")
    assert not hasattr(estimator.fit(electrodes()), "feature_names_in_")
    assert not hasattr(estimator.fit(table), "spatial_cells_")


# Composition


def test_cached_rows_depend_on_every_parameter(tmp_path):
    trials = electrodes()
    atoms = np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0]
    codes = small(
        max_iter=0, dict_init=atoms, patch_size=(3, 2), spatial_cells=(2,), sign="none"
    )
    changes = [
        {},
        {"patch_size": (2, 3)},
        {"spatial_cells": (1,)},
        {"layout": LAYOUT[::-1]},
        {"n_nonzero_coefs": 2},
        {"sign": "absolute"},
        {"remove_mean": False},
        {"dict_init": atoms[::-1]},
    ]
    assert_an_entry_each(codes, changes, trials, tmp_path)


# Errors


def test_other_shapes_at_transform():
    images = np.random.default_rng(0).normal(size=(2, 9, 7, 6))
    with pytest.raises(ValueError, match="frames of 6 × 7, but frames of 7 × 6"):
        small(layout=None).fit(images).transform(images.swapaxes(2, 3))


def test_frames_that_are_not_normalised_are_maxima_of_codes():
    """Codes of single patches, one by one, by scikit-learn's pursuit."""
    rng = np.random.default_rng(0)
    trials = [rng.normal(size=(n, 4, 5)) for n in (6, 9)]
    settings = dict(n_atoms=4, n_nonzero_coefs=2, layout=None, random_state=0)
    sthmp = STHMPTransformer(**settings, spatial_cells=(1,), normalise=False)
    frames = sthmp.fit_transform(trials)[1]
    unit = STHMPTransformer(**settings, spatial_cells=(1,)).fit_transform(trials)[1]
    norms = np.linalg.norm(frames, axis=1, keepdims=True)
    assert_allclose(unit, frames / norms, rtol=1e-12)
    for image, frame in zip(trials[1], frames):
        patches = [
            image[i : i + 3, j : j + 3].ravel() for i in range(2) for j in range(3)
        ]
        patches = [patch - patch.mean() for patch in patches]
        codes = orthogonal_mp(
            sthmp.components_.T, np.array(patches).T, n_nonzero_coefs=2
        )
        split = np.concatenate([codes.clip(0), (-codes).clip(0)])
        assert_allclose(frame, split.max(axis=1), atol=1e-9)
