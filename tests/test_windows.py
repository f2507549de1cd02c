"""KSVDTransformer against scikit-learn, windows made by hand, and bad input."""

import pickle
from itertools import pairwise

import joblib
import numpy as np
import pandas as pd
import polars as pl
import pytest
from cached_rows import assert_an_entry_each
from callback_recorder import Recorder
from numpy.testing import assert_allclose, assert_array_equal
from sklearn import config_context
from sklearn.base import clone
from sklearn.datasets import make_sparse_coded_signal
from sklearn.decomposition import SparseCoder
from sklearn.pipeline import make_pipeline

from sklearn_haptic import KSVDTransformer, Sequences, TemporalMaxPool
from sklearn_haptic.features._dictionary_coder import draw_observations

DTYPES = [np.float64, np.float32]
N_CHANNELS = 2


def make_trials(n_trials=6, dtype=np.float64, seed=0):
    """Sums of two sines of random frequency on a level of their own, two channels."""
    rng = np.random.default_rng(seed)
    trials = []
    for n_times in rng.integers(100, 200, n_trials):
        times = np.arange(n_times)[:, None, None]
        waves = np.sin(times * rng.uniform(0.1, 1, (N_CHANNELS, 2))).sum(axis=2)
        trials.append((waves + 20 + 0.1 * rng.normal(size=waves.shape)).astype(dtype))
    return trials


@pytest.mark.slow
@pytest.mark.parametrize("update", ["approximate", "exact"])
@pytest.mark.parametrize("remove_mean", [True, False])
@pytest.mark.parametrize(
    "X",
    [
        np.zeros((20, 6)),
        np.full((20, 6), 0.1),
        np.ones((1, 6)) * np.arange(6),
        np.repeat(np.random.default_rng(0).normal(size=(2, 6)), 10, axis=0),
        np.random.default_rng(0).normal(size=(10, 6)),
        np.random.default_rng(0).normal(size=(10, 1)),
    ],
    ids=["zero", "constant", "one", "duplicates", "few", "one column"],
)
def test_degenerate_data(X, remove_mean, update):
    model = KSVDTransformer(
        15, 8, remove_mean=remove_mean, update=update, sign="none", random_state=0
    ).fit(X)
    assert np.isfinite(model.components_).all()
    assert_allclose(np.linalg.norm(model.components_, axis=1), 1)
    codes = model.transform(X)
    signals = X - X.mean(axis=1, keepdims=True) if remove_mean else X
    assert_allclose(codes @ model.components_, signals, atol=1e-12)
    if not np.ptp(X, axis=1).any() and remove_mean:
        assert not codes.any()


@pytest.mark.parametrize("dtype", DTYPES)
def test_constant_windows_code_to_zero(dtype):
    model = KSVDTransformer(10, window=22, random_state=0).fit(make_trials(dtype=dtype))
    levels = np.array([0.1, 1234.7, 1e6 + 0.1, -1e-9], dtype)
    for codes in model.transform([np.full((100, 2), level) for level in levels]):
        assert codes.dtype == dtype
        assert not codes.any()


def test_codes_equal_scikit_learn():
    X = np.random.default_rng(0).normal(size=(100, 12))
    model = KSVDTransformer(
        20, 3, remove_mean=False, sign="none", random_state=0, max_iter=5
    )
    codes = model.fit_transform(X)
    expected = SparseCoder(model.components_, transform_n_nonzero_coefs=3).transform(X)
    assert_allclose(codes, expected, atol=1e-12)
    error = np.sqrt(np.mean((X - codes @ model.components_) ** 2))
    assert model.reconstruction_error_ == pytest.approx(error)


def test_signs():
    X = np.random.default_rng(0).normal(size=(50, 8))
    model = KSVDTransformer(10, 3, sign="none", random_state=0)
    codes = model.fit_transform(X)
    split = model.set_params(sign="split").fit_transform(X)
    assert_array_equal(split, np.hstack([np.maximum(codes, 0), np.maximum(-codes, 0)]))
    absolute = model.set_params(sign="absolute").fit_transform(X)
    assert_array_equal(absolute, np.abs(codes))
    largest = np.abs(model.components_).argmax(axis=1)
    assert (model.components_[np.arange(10), largest] > 0).all()


def test_given_dictionary_is_used_as_it_is():
    X = np.random.default_rng(0).normal(size=(50, 8))
    atoms = -3.0 * np.eye(8)[:5]
    model = KSVDTransformer(
        5, 5, dict_init=atoms, max_iter=0, remove_mean=False, sign="none"
    ).fit(X)
    assert_array_equal(model.components_, atoms)
    assert model.n_iter_ == 0
    assert_allclose(model.transform(X), X[:, :5] / -3, rtol=1e-14)


def test_iterations_lower_the_error_until_they_do_not():
    X, _, _ = make_sparse_coded_signal(
        n_samples=600, n_components=8, n_features=12, n_nonzero_coefs=2, random_state=0
    )
    start = KSVDTransformer(8, 2, max_iter=0, random_state=0).fit(X)
    model = KSVDTransformer(8, 2, max_iter=200, random_state=0).fit(X)
    assert model.reconstruction_error_ < 0.5 * start.reconstruction_error_
    assert 5 < model.n_iter_ < 200


def test_windows_of_trials_by_hand():
    trials = make_trials()
    model = KSVDTransformer(7, 3, window=20, overlap=0.75, random_state=0)
    codes = model.fit_transform(trials)
    assert isinstance(codes, Sequences)
    assert model.n_features_in_ == N_CHANNELS
    coder = SparseCoder(model.components_, transform_n_nonzero_coefs=3)
    for trial, code in zip(trials, codes):
        starts = range(0, len(trial) - 19, 5)
        assert code.shape == (len(starts), N_CHANNELS * 2 * 7)
        for channel in range(N_CHANNELS):
            windows = np.array([trial[s : s + 20, channel] for s in starts])
            expected = coder.transform(windows - windows.mean(axis=1, keepdims=True))
            got = code[:, channel * 14 : (channel + 1) * 14]
            assert_allclose(got[:, :7] - got[:, 7:], expected, atol=1e-11)
            assert (got >= 0).all()


@pytest.mark.parametrize("overlap, step", [(0, 22), (0.5, 11), (0.99, 1)])
def test_overlap(overlap, step):
    trials = [np.random.default_rng(0).normal(size=(100, 1))]
    model = KSVDTransformer(5, 2, window=22, overlap=overlap, max_iter=1)
    assert len(model.fit_transform(trials)[0]) == (100 - 22) // step + 1


def test_the_containers_of_trials_agree():
    trials = [trial[:100] for trial in make_trials()]
    model = KSVDTransformer(7, 3, window=20, random_state=0, max_iter=3)
    expected = model.fit_transform(trials)
    objects = np.empty(len(trials), dtype=object)
    objects[:] = trials
    for X in (tuple(trials), objects, np.array(trials), pd.Series(trials)):
        for codes, expected_codes in zip(clone(model).fit_transform(X), expected):
            assert_array_equal(codes, expected_codes)
    table = np.array(trials)[:, :, 0]
    for X in (table, pd.DataFrame(table).add_prefix("t")):
        assert clone(model).fit(X).n_features_in_ == 1
        for row, codes in zip(trials, model.fit(X).transform(X)):
            alone = model.transform([row[:, :1]])[0]
            assert_allclose(codes, alone, rtol=1e-10, atol=1e-10)


def test_training_windows_are_subsampled():
    trials = make_trials()
    few = KSVDTransformer(5, 2, window=20, max_train_windows=30, random_state=0)
    assert few.fit(trials).components_.shape == (5, 20)
    everything = [
        KSVDTransformer(
            5, 2, window=20, max_train_windows=limit, max_iter=3, random_state=0
        ).fit(trials)
        for limit in (None, 10**6)
    ]
    assert_array_equal(everything[0].components_, everything[1].components_)
    assert few.reconstruction_error_ != everything[0].reconstruction_error_


@pytest.mark.parametrize("limit", [1, 7, 29, 30, None])
def test_observations_are_drawn_without_replacement(limit):
    trials = [np.arange(10), np.arange(10, 15), np.arange(15, 30)]
    drawn = draw_observations(
        trials, [10, 5, 15], limit, np.ndarray.take, np.random.RandomState(0)
    )
    assert len(drawn) == (limit or 30)
    assert (np.diff(drawn) > 0).all() and drawn[0] >= 0 and drawn[-1] < 30


def test_feature_names():
    trials = make_trials()
    X = np.random.default_rng(0).normal(size=(30, 6))
    table = KSVDTransformer(2, 1, random_state=0).fit(X)
    assert table.get_feature_names_out().tolist() == [
        "atom0+",
        "atom1+",
        "atom0-",
        "atom1-",
    ]
    windowed = KSVDTransformer(2, 1, window=20, sign="none", random_state=0)
    names = windowed.fit(trials).get_feature_names_out(["pac"])
    assert names.tolist() == ["ch0_atom0", "ch0_atom1", "ch1_atom0", "ch1_atom1"]
    assert windowed.transform(trials).feature_names.tolist() == names.tolist()


@pytest.mark.parametrize("output", ["default", "pandas", "polars"])
def test_set_output(output):
    trials = make_trials()
    model = KSVDTransformer(2, 1, window=20, random_state=0)
    plain = model.fit_transform(trials)
    with config_context(transform_output=output):
        globally = clone(model).fit_transform(trials)
    model = make_pipeline(clone(model)).set_output(transform=output)
    for codes in (model.fit_transform(trials), model.transform(trials), globally):
        assert isinstance(codes, Sequences)
        assert_array_equal(codes[-1], plain[-1])
    table = KSVDTransformer(2, 1, random_state=0).set_output(transform=output)
    X = np.random.default_rng(0).normal(size=(30, 6))
    for codes in (table.fit_transform(X), table.transform(X)):
        module = type(codes).__module__.split(".")[0]
        assert module == {"default": "numpy"}.get(output, output)


def test_clone_and_pickle():
    trials = make_trials(dtype=np.float32)
    model = KSVDTransformer(4, 2, window=20, random_state=0)
    codes = model.fit_transform(trials)
    restored = pickle.loads(pickle.dumps(model)).transform(trials)
    refitted = clone(model).fit_transform(trials)
    restored_codes = pickle.loads(pickle.dumps(codes))
    assert restored_codes.feature_names.tolist() == codes.feature_names.tolist()
    for i, code in enumerate(codes):
        assert code.dtype == np.float32
        assert_array_equal(restored[i], code)
        assert_array_equal(refitted[i], code)
        assert_array_equal(restored_codes[i], code)


def test_sequences_are_coded_when_asked_for():
    trials = make_trials()
    model = KSVDTransformer(4, 2, window=20, random_state=0).fit(trials)
    doubled = [2 * code for code in model.transform(trials)]
    codes = model.transform(trials)
    for trial in trials:
        trial *= 2
    assert repr(codes) == "<Sequences: 6 trials, 16 columns>"
    arrays = list(codes)
    for array, expected in zip(arrays, doubled, strict=True):
        assert_array_equal(array, expected)
    assert codes.lengths == [len(array) for array in arrays]
    assert_array_equal(codes[-1], arrays[-1])
    assert isinstance(codes[1:5:2], Sequences)
    for some in (codes[1:5:2], codes[:][1:5][::2]):
        assert some.lengths == codes.lengths[1:5:2]
        for array, expected in zip(some, arrays[1:5:2]):
            assert_array_equal(array, expected)
    with pytest.raises(IndexError):
        codes[6]


def test_slices_of_sequences_keep_the_index():
    trials = pd.Series(make_trials(), index=list("abcdef"))
    codes = KSVDTransformer(4, 2, window=20, random_state=0).fit_transform(trials)
    assert codes[2:4].row_index.tolist() == ["c", "d"]


@pytest.mark.parametrize("dtype", DTYPES)
def test_caches_change_nothing_and_keep_each_result_once(tmp_path, dtype):
    trials = make_trials(dtype=dtype)
    plain = make_pipeline(
        KSVDTransformer(4, 2, window=20, random_state=0), TemporalMaxPool((2, 1))
    )
    expected = plain.fit_transform(trials)
    kept = set()
    # Both memories are one folder.
    for memory in (str(tmp_path), joblib.Memory(str(tmp_path), verbose=0)):
        model = clone(plain).set_params(
            ksvdtransformer__memory=memory, temporalmaxpool__memory=memory
        )
        for pooled in (
            model.fit_transform(trials),
            model.transform(trials),
            clone(model).fit_transform(trials),
            pickle.loads(pickle.dumps(model)).transform(trials),
        ):
            assert_array_equal(pooled, expected)
            assert pooled.dtype == dtype
            entries = [(e, e.stat().st_mtime_ns) for e in tmp_path.rglob("output.pkl")]
            kept.update(entries)
        for name in ("components_", "n_iter_", "reconstruction_error_"):
            assert_array_equal(getattr(model[0], name), getattr(plain[0], name))
    assert len(kept) == len(entries) == 2  # the dictionary and the rows, never anew


coded = []


def code(trial):
    coded.append(len(trial))
    return 2.0 * trial


def test_cached_rows_are_coded_once(tmp_path):
    coded.clear()
    trials = make_trials()
    for pool in (TemporalMaxPool(memory=str(tmp_path)) for _ in range(2)):
        codes = Sequences(trials, ["left", "right"], encode=code)
        assert_array_equal(
            pool.fit_transform(codes),
            TemporalMaxPool().fit_transform([2 * trial for trial in trials]),
        )
    assert coded == [len(trial) for trial in trials]


def test_cached_rows_depend_on_every_parameter(tmp_path):
    trials = make_trials()
    atoms = np.linalg.qr(np.random.default_rng(0).normal(size=(20, 8)))[0].T
    codes = KSVDTransformer(4, 2, window=20, max_iter=0, dict_init=atoms[:4])
    changes = [
        {},
        {"sign": "none"},
        {"sign": "absolute"},
        {"n_nonzero_coefs": 3},
        {"overlap": 0.25},
        {"remove_mean": False},
        {"dict_init": atoms[4:]},
    ]
    assert_an_entry_each(codes, changes, trials, tmp_path)


def test_cached_dictionary_depends_on_the_draw(tmp_path):
    X = np.random.default_rng(0).normal(size=(60, 8))

    def dictionaries(random_state, memory):
        model = KSVDTransformer(
            4, 2, max_iter=2, memory=memory, random_state=random_state
        )
        return [model.fit(X).components_ for _ in range(3)]

    for memory in (None, str(tmp_path)):
        first, second, third = dictionaries(None, memory)
        assert (first != second).any() and (second != third).any()
    for seed in (1, 1):  # the second time from the cache
        for got, wanted in zip(
            dictionaries(np.random.RandomState(seed), str(tmp_path)),
            dictionaries(np.random.RandomState(seed), None),
        ):
            assert_array_equal(got, wanted)
    same, again, _ = dictionaries(0, str(tmp_path))
    assert_array_equal(same, again)


def test_callbacks_see_every_iteration():
    X = np.random.default_rng(0).normal(size=(60, 8))
    plain = KSVDTransformer(4, 2, max_iter=30, random_state=0).fit(X)
    recorder = Recorder()
    model = clone(plain).set_callbacks(recorder).fit(X)
    iterations = [f"iteration {i}" for i in range(1, plain.n_iter_ + 1)]
    assert recorder.tasks == ["setup", *iterations, "fit", "teardown"]
    assert_array_equal(model.components_, plain.components_)
    restored = pickle.loads(pickle.dumps(model))
    assert_array_equal(restored.transform(X), plain.transform(X))
    recorder.tasks.clear()
    assert_array_equal(clone(model).fit_transform(X), plain.transform(X))
    assert recorder.tasks == ["setup", *iterations, "fit", "teardown"]


def test_callbacks_see_and_stop_iterations_despite_a_cache(tmp_path):
    X = np.random.default_rng(0).normal(size=(60, 8))
    model = KSVDTransformer(4, 2, memory=str(tmp_path), random_state=0)
    three = KSVDTransformer(4, 2, max_iter=3, random_state=0).fit(X)
    for _ in range(2):  # an empty cache, then a full one
        recorder = Recorder(stop_after=3)
        stopped = clone(model).set_callbacks(recorder).fit(X)
        iterations = [f"iteration {i}" for i in range(1, 4)]
        assert recorder.tasks == ["setup", *iterations, "fit", "teardown"]
        assert_array_equal(stopped.components_, three.components_)
        assert model.fit(X).n_iter_ > 3


def test_more_coefficients_than_atoms_are_as_many_as_atoms():
    X = np.random.default_rng(0).normal(size=(30, 8))
    with pytest.warns(UserWarning, match="n_nonzero_coefs=9 exceeds n_atoms=4"):
        model = KSVDTransformer(4, 9, sign="none", random_state=0).fit(X)
    centred = X - X.mean(axis=1, keepdims=True)
    # With all atoms a code is the least-squares solution.
    codes = np.linalg.lstsq(model.components_.T, centred.T)[0].T
    assert_allclose(model.transform(X), codes, atol=1e-10)


TABLE = np.random.default_rng(0).normal(size=(40, 6))
FORMS = {
    "table": ({}, TABLE),
    "named table": ({}, pd.DataFrame(TABLE[:, :5]).add_prefix("x")),
    "polars table": ({}, pl.DataFrame(TABLE[:, :4])),
    "trials": ({"window": 20}, make_trials()),
    "series": ({"window": 10, "sign": "none"}, pd.Series(make_trials())),
    "rows": ({"window": 3}, TABLE),
    "named rows": ({"window": 3}, pd.DataFrame(TABLE).add_prefix("t")),
}


@pytest.mark.slow
@pytest.mark.parametrize(("first", "then"), [*pairwise([*FORMS, *[*FORMS][::-1]])])
def test_nothing_is_left_of_an_earlier_fit(first, then):
    model = KSVDTransformer(3, 2, max_iter=2, random_state=0)
    (before, X), (after, Y) = FORMS[first], FORMS[then]
    fresh = clone(model).set_params(**after).fit(Y)
    again = clone(model).set_params(**before).fit(X)
    again = again.set_params(**{"window": None, "sign": "split"} | after).fit(Y)
    assert vars(again).keys() == vars(fresh).keys()
    assert joblib.hash(vars(again)) == joblib.hash(vars(fresh))


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_parameters_set_after_fit_wait_for_the_next(form):
    params, X = FORMS[form]
    model = KSVDTransformer(3, 2, max_iter=2, random_state=0, **params).fit(X)
    names = model.get_feature_names_out().tolist()
    codes = [np.array(each) for each in model.transform(X)]
    for changed in [
        {"window": None if params else 3},
        {"window": 2},
        {"overlap": 0.9},
        {"sign": "absolute"},
        {"n_nonzero_coefs": 1},
        {"remove_mean": False},
        {"n_atoms": 9, "dict_init": np.ones((9, 9))},
    ]:
        model.set_params(**changed)
        assert model.get_feature_names_out().tolist() == names
        for before, after in zip(codes, model.transform(X), strict=True):
            assert_array_equal(before, after)


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_channels_are_those_of_the_same_name(library):
    trials = [pd.DataFrame(trial, columns=["left", "right"]) for trial in make_trials()]
    swapped = [trial[["right", "left"]] for trial in trials]
    if library == "polars":
        trials, swapped = [[pl.from_pandas(t) for t in X] for X in (trials, swapped)]
    model = KSVDTransformer(4, 2, window=20, max_iter=2, random_state=0)
    pool = make_pipeline(clone(model), TemporalMaxPool((2, 1)))
    for step in (pool, TemporalMaxPool((2, 1))):
        expected = step.fit(make_trials()).transform(make_trials())
        for X in (trials, [trials[0], *swapped[1:]]):
            assert_array_equal(step.fit(X).transform(swapped), expected)
            assert_array_equal(step.transform(make_trials()), expected)
    model.fit(trials)
    wrong = [pd.DataFrame(trial, columns=["left", "middle"]) for trial in make_trials()]
    with pytest.raises(
        ValueError, match="Trial 0 of X and fit differ in the column 'r"
    ):
        model.transform(wrong)
    model.fit(make_trials()).transform(wrong)


def test_codes_count_windows():
    trials = make_trials()
    model = KSVDTransformer(4, 2, window=20, max_iter=1, random_state=0).fit(trials)
    codes = model.transform([trials[0], trials[1][:29]])
    assert codes.unit == codes[:1].unit == "windows"
    assert codes.lengths[1] == len(codes[1]) == 1


def test_one_touch_that_is_given_without_a_list_is_told_how():
    rng = np.random.default_rng(0)
    trials = [rng.normal(size=(30, 3)) for _ in range(4)]
    coder = KSVDTransformer(4, window=5, max_iter=0, random_state=0).fit(trials)
    with pytest.raises(ValueError, match=r"of one touch \[touch\]"):
        coder.transform(trials[0])
    assert len(coder.transform([trials[0]])) == 1
