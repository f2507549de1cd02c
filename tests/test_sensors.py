"""Sensors that are described, named, or found out from their trials."""

import pickle

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.linear_model import RidgeClassifier
from sklearn.model_selection import GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from sklearn_haptic import (
    DistributionalOrdinalRegressor,
    DummyDistribution,
    KSVDTransformer,
    Signal,
    SignalStatistics,
    STHMPTransformer,
    TaxelGrid,
    TemporalMaxPool,
    make_haptic_pipeline,
)
from sklearn_haptic.features._sensor_features import BlockScaler, SensorFeatures
from sklearn_haptic.metrics import ranked_probability_score

pytestmark = pytest.mark.filterwarnings("ignore:.*fit was given no groups")
STATISTICS = ("mean", "max", "min", "bands")


def touches(n_trials=12, seed=0):
    """A skin of 4 × 4 taxels at 50 Hz and an accelerometer at 1 kHz."""
    rng = np.random.default_rng(seed)
    lengths = rng.integers(20, 40, n_trials)
    cells = [(rng.normal(size=(n, 16)), rng.normal(size=(20 * n, 3))) for n in lengths]
    counts = 1 + np.eye(3)[np.arange(n_trials) % 3]
    return pd.DataFrame(cells, columns=["skin", "acc"]), counts


@pytest.mark.parametrize(
    ("signal", "n_samples"),
    [
        (Signal(), None),
        (Signal(rate=1000), 10),
        (Signal(rate=35), 10),
        (Signal(rate=12), 6),
        (Signal(rate=1), 2),
        (Signal(rate=2200, window=0.01), 22),
    ],
)
def test_windows_in_seconds(signal, n_samples):
    assert signal.n_samples == n_samples


def test_layouts():
    row_by_row = TaxelGrid((2, 3)).weights
    for i in range(2):
        for j in range(3):
            assert row_by_row[i, j].tolist() == np.eye(6)[3 * i + j].tolist()
    wiring = np.array([[1, 0], [3, 2], [4, 5]])
    assert (TaxelGrid(np.eye(6)[wiring]).weights.argmax(axis=2) == wiring).all()
    assert TaxelGrid(np.eye(6)[wiring]) == TaxelGrid(np.eye(6)[wiring].tolist())
    assert len({TaxelGrid((4, 4)), TaxelGrid([4, 4]), TaxelGrid(None)}) == 2


@pytest.mark.parametrize("shape", [(6, 8), (5, 5), (4, 4), (2, 8), (1, 6)])
def test_images_are_as_their_channels_row_by_row(shape):
    n_pixels = shape[0] * shape[1]
    rows = [np.random.default_rng(i).normal(size=(40, n_pixels)) for i in range(6)]
    images = [trial.reshape(-1, *shape) for trial in rows]
    sides = {(6, 8): (3, 3), (5, 5): (3, 3), (1, 6): (1, 2)}.get(shape, (2, 2))
    found = []
    for grid, X in ((TaxelGrid(shape), rows), (TaxelGrid(), images)):
        features = make_haptic_pipeline(grid, random_state=0)[:-1]
        found.append(features.fit_transform(X))
        coder = features[0].transformer_list[0][1][0]
        assert coder.patch_size_ == sides
    assert_array_equal(*found)


def test_a_biotac_has_patches_of_three_pixels():
    X = [np.random.default_rng(i).normal(size=(20, 38)) for i in range(6)]
    features = make_haptic_pipeline(TaxelGrid("biotac"), random_state=0)[:-1].fit(X)
    assert features[0].transformer_list[0][1][0].patch_size_ == (3, 3)


def by_hand(blocks):
    """Standardise each feature of a sensor; give its blocks equal total variance."""
    varies = [
        np.ptp(block, axis=0) > 1e-12 * abs(block).max(axis=0) for block in blocks
    ]
    n_features, scaled = sum(map(sum, varies)), []
    for block, of_block in zip(blocks, varies):
        share = max(n_features, 500) / len(blocks) / of_block.sum()
        columns = []
        for column, varying in zip(block.T, of_block):
            unit = column.std() if varying else np.inf
            columns.append((column - column.mean()) / unit * share**0.5)
        scaled.append(np.stack(columns, axis=1))
    return np.hstack(scaled)


def test_described_features_are_those_of_the_transformers():
    """The pipeline does what is written out here by hand."""
    trials, y = touches()
    sensors = {"skin": TaxelGrid((4, 4)), "acc": Signal(rate=1000, window=0.02)}
    model = make_haptic_pipeline(sensors, random_state=0).fit(trials, y)
    common = {"n_nonzero_coefs": 2, "max_iter": 0, "remove_mean": False}
    pool = TemporalMaxPool((4, 2, 1), statistics=("mean", "share", "max"))
    skin = STHMPTransformer(
        layout=np.eye(16).reshape(4, 4, 16),
        patch_size=(2, 2),
        max_train_patches=5000,
        random_state=0,
        **common,
    )
    acc = KSVDTransformer(window=20, max_train_windows=5000, random_state=0, **common)
    blocks = []
    for name, coder in {"skin": skin, "acc": acc}.items():
        codes = clone(pool).fit_transform(coder.fit_transform(trials[name]))
        blocks.append(np.sqrt(codes))
        blocks.append(
            SignalStatistics(STATISTICS, cells=(2, 1)).fit_transform(trials[name])
        )
    features = by_hand(blocks[:2]), by_hand(blocks[2:])
    assert_allclose(model[0].transform(trials), np.hstack(features), 1e-10, 1e-12)
    names = model[:-1].get_feature_names_out()
    assert len(set(names)) == len(names) == model[-1].n_features_in_
    assert names[0] == "skin__codes__t1of4_mean_s1of9_atom0+"
    assert names[-1] == "acc__statistics__t1of1_ch2_band16of16"
    loaded = pickle.loads(pickle.dumps(model))
    assert_array_equal(loaded.predict_proba(trials), model.predict_proba(trials))


def test_what_users_put_in_the_place_of_blocks_is_standardised():
    trials, y = touches()
    sensors = {"skin": TaxelGrid((4, 4)), "acc": Signal(rate=1000)}
    model = make_haptic_pipeline(sensors, random_state=0)
    model.set_params(
        features__skin=FunctionTransformer(means), features__acc__codes="drop"
    )
    rows = model[0].set_output(transform="pandas").fit_transform(trials, y)
    statistics = SignalStatistics(STATISTICS, cells=(2, 1)).fit_transform(trials["acc"])
    parts = by_hand([means(trials["skin"]).to_numpy()]), by_hand([statistics])
    assert_allclose(rows.to_numpy(), np.hstack(parts), rtol=1e-8, atol=1e-10)
    assert rows.index.equals(trials.index)
    # They do not depend on the other sensors, as in subsets and unions of models.
    for sensor, other in ("skin", "acc"), ("acc", "skin"):
        alone = clone(model[0]).set_params(**{other: "drop"}).fit_transform(trials, y)
        assert_array_equal(rows.filter(regex=f"^{sensor}__"), alone)


def means(trials):
    """Means of channels, and a feature that is always the same."""
    rows = [[*np.mean(trial, axis=0), 3.0] for trial in trials]
    return pd.DataFrame(rows, index=trials.index).add_prefix("mean")


@pytest.mark.parametrize("how", ["behind a step", "frozen"])
def test_blocks_behind_a_step_of_a_sensor_keep_their_weight(how):
    trials, y = touches()
    sensors = {"skin": TaxelGrid((4, 4)), "acc": Signal(rate=1000)}
    plain = make_haptic_pipeline(sensors, random_state=0)[0]
    own = clone(plain)
    if how == "frozen":
        fitted = clone(plain).fit(trials, y).named_transformers_["acc"]
        own.set_params(acc=FrozenEstimator(fitted))
    else:
        steps = FunctionTransformer(), own.get_params()["acc"]
        own.set_params(acc=make_pipeline(*steps))
    rows = own.fit_transform(trials, y)
    assert_allclose(rows, plain.fit_transform(trials, y), rtol=1e-9, atol=1e-12)
    assert_array_equal(rows, own.transform(trials))


@pytest.mark.parametrize("of_frame", [True, False], ids=["column", "alone"])
def test_a_branch_without_names_weighs_as_one_with_names(of_frame):
    trials, y = touches()
    X = trials if of_frame else list(trials["acc"])
    sensors = {"acc": Signal(rate=1000)} if of_frame else Signal(rate=1000)
    unnamed, named = (make_haptic_pipeline(sensors, random_state=0) for _ in range(2))
    path = "features__acc__statistics" if of_frame else "features__statistics"
    unnamed.set_params(**{path: FunctionTransformer(peaks)})
    names = {"feature_names_out": lambda _, names: ["p0", "p1", "p2"]}
    named.set_params(**{path: FunctionTransformer(peaks, **names)})
    rows, of_named = (each[0].fit_transform(X, y) for each in (unnamed, named))
    own = rows[:, -3:].var(axis=0).sum()
    assert own == pytest.approx(rows[:, :-3].var(axis=0).sum())
    assert_allclose(own, of_named[:, -3:].var(axis=0).sum())


def test_two_features_of_a_sensor_count_beside_thousands_of_another():
    """Only they tell the rating, so a model with both sensors has to see them."""
    rng = np.random.default_rng(0)
    size = rng.uniform(0.2, 2, 24).repeat(2)
    noise = [rng.normal(size=(60, 16)) for _ in size]
    felt = [each * rng.normal(size=(200, 1)) for each in size]
    trials = pd.DataFrame({"skin": noise, "acc": felt})
    counts = np.eye(5)[np.digitize(size, [0.5, 0.9, 1.2, 1.6])] * 12
    sensors = {"skin": TaxelGrid((4, 4)), "acc": Signal(rate=1000)}
    model = make_haptic_pipeline(sensors, random_state=0)
    model.set_params(
        features__acc=FunctionTransformer(peaks),
        model=DistributionalOrdinalRegressor(),
    )
    rps = [
        ranked_probability_score(
            counts[32:], each.fit(trials[:32], counts[:32]).predict_proba(trials[32:])
        )
        for each in (model, DummyDistribution())
    ]
    assert rps[0] < 0.7 * rps[1]


def peaks(trials):
    return np.array([np.ptp(trial, axis=0) for trial in trials])


@pytest.mark.parametrize("shift", [0, 1e6])
def test_blocks_of_any_unit_have_equal_variance(shift):
    rng = np.random.default_rng(0)
    widths = [[40, 3], [5], [2, 1, 6], [0, 4], [3, 2], [700, 14]]
    X = 10.0 ** rng.integers(-6, 6, 780) * rng.normal(size=(30, 780))
    X += shift * X.std(axis=0)
    X[:, [0, 47, 48]] = 0.1, 7, 0  # constant, of which one is a whole block
    X[:, 61:64] = -3
    scaled = BlockScaler(widths).fit_transform(X)
    end = 0
    for of_sensor in widths:
        variances = []
        for width in of_sensor:
            variances.append(scaled[:, end : end + width].var(axis=0).sum())
            end += width
        varies = [v for v in variances if v > 1e-9]
        n_varying = (np.ptp(X[:, end - sum(of_sensor) : end], axis=0) > 0).sum()
        assert_allclose(varies, max(n_varying, 500) / len(varies))
    assert_allclose(scaled.mean(axis=0), 0, atol=1e-8)
    single = BlockScaler(widths).fit_transform(X.astype(np.float32))
    assert single.dtype == np.float32
    deviation = scaled.std(axis=0).clip(1)
    assert_allclose(single / deviation, scaled / deviation, atol=1e-5 + 1e-6 * shift)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "sensor",
    [Signal(), Signal(100), TaxelGrid((2, 2))],
    ids=["levels", "codes", "grid"],
)
@pytest.mark.parametrize("value", [0.1, 2047.3])
def test_a_channel_that_is_always_the_same_tells_nothing(sensor, dtype, value):
    """However long the touches are: no feature of it varies by rounding alone."""
    rng = np.random.default_rng(0)
    X = [rng.normal(size=(n, 4)).astype(dtype) for n in rng.integers(40, 3000, 20)]
    for trial in X:
        trial[:, 3] = value
    features = make_haptic_pipeline(sensor, random_state=0)[:-1].fit(X)
    of_constant = ["ch3" in name for name in features.get_feature_names_out()]
    assert np.abs(features.transform(X)[:, of_constant]).max() < 1e-5
    for trial in X:
        trial[:, 3] *= 1.1
    assert np.abs(features.transform(X)[:, of_constant]).max() < max(value, 0.5)


def test_a_missing_feature_of_one_touch_leaves_those_of_others():
    X = np.random.default_rng(0).normal(size=(30, 2))
    X[3, 0] = np.nan
    scaled = BlockScaler().fit_transform(X)
    assert_array_equal(np.argwhere(np.isnan(scaled)), [[3, 0]])
    others = np.delete(X[:, 0], 3)
    expected = (others - others.mean()) / others.std()
    assert_allclose(np.delete(scaled[:, 0], 3), expected)


def test_rounding_is_no_variance():
    rows = np.full((30, 2), 0.1, np.float32)
    rows[::3, 0] = np.nextafter(rows[0, 0], np.float32(1))
    rows[:, 1] += np.linspace(0, 1e-5, 30)
    scaled = BlockScaler().fit_transform(rows)
    assert np.abs(scaled[:, 0]).max() < 1e-7
    assert scaled[:, 1].std() == pytest.approx(1, rel=1e-3)


def test_names_of_a_biotac_are_not_described_twice():
    named = make_haptic_pipeline(["pac", "acc"])[0].transformers
    coder = named[0][1]["codes"][0]
    assert isinstance(coder, KSVDTransformer)
    assert coder.window == 22 and coder.n_atoms == 40
    assert isinstance(named[1][1], SensorFeatures)


def test_one_sensor_alone_takes_a_list():
    trials, y = touches()
    skins = list(trials["skin"])
    alone = make_haptic_pipeline(TaxelGrid((4, 4)), random_state=0).fit(skins, y)
    of_frame = make_haptic_pipeline({"skin": TaxelGrid((4, 4))}, random_state=0)
    assert_array_equal(
        alone.predict_proba(skins), of_frame.fit(trials, y).predict_proba(trials)
    )


def test_what_is_not_described_is_found_out():
    trials, y = touches()
    trials["camera"] = [trial.reshape(-1, 4, 4) for trial in trials["skin"]]
    model = make_haptic_pipeline(["skin", "camera"], random_state=0).fit(trials, y)
    found = model[0].named_transformers_
    assert found["skin"].kind_ == "signals" and found["camera"].kind_ == "images"
    assert isinstance(found["skin"].transformer_, SignalStatistics)
    coder, _ = found["camera"].transformer_["codes"]
    assert isinstance(coder, STHMPTransformer)
    every = SignalStatistics(cells=(2, 1)).fit_transform(trials["skin"])
    assert_array_equal(found["skin"].transform(trials["skin"]), every)
    assert_array_equal(  # of pixels, which are channels row by row
        found["camera"].transformer_["statistics"].transform(trials["camera"]),
        SignalStatistics(STATISTICS, cells=(2, 1)).fit_transform(trials["skin"]),
    )
    described = {"skin": Signal(), "camera": TaxelGrid()}
    described = make_haptic_pipeline(described, random_state=0).fit(trials, y)
    assert_array_equal(described.predict_proba(trials), model.predict_proba(trials))
    again = clone(found["skin"]).fit(trials["camera"]).fit(trials["skin"])
    assert again.kind_ == "signals"
    alone = make_haptic_pipeline(None, random_state=0)
    (_, statistics), *_ = alone.fit(list(trials["skin"]), y)[0].transformer_list
    assert statistics.kind_ == "signals"


def test_the_description_of_a_biotac_is_that_of_its_name():
    named = make_haptic_pipeline(["pac", "electrodes"], random_state=0)
    sensors = {"pac": Signal(2200, 0.01), "electrodes": TaxelGrid("biotac")}
    described = make_haptic_pipeline(sensors, random_state=0)
    assert repr(named.get_params()) == repr(described.get_params())


@pytest.mark.parametrize("factor", [1000, 0.001, 0])
def test_touches_in_another_unit_or_of_a_sensor_that_is_off_are_warned_of(factor):
    trials, y = touches()
    model = make_haptic_pipeline(
        {"skin": TaxelGrid((4, 4)), "acc": Signal(rate=1000)}, random_state=0
    ).fit(trials, y)
    model.predict(trials)
    odd = trials.copy()
    odd.at[3, "acc"] = factor * trials["acc"][3]
    end = "highest" if factor > 1 else "lowest"
    said = rf"^Trial 3 of X\['acc'\] has a peak of .* times the {end} in fit; check"
    with pytest.warns(UserWarning, match=said) as caught:
        model.predict(odd)
    assert len(caught) == 1
    model.predict(odd.drop(index=3))


@pytest.mark.parametrize(
    "n_trials", [1, 5000, pytest.param(100_000, marks=pytest.mark.slow)]
)
def test_any_number_of_trials(n_trials):
    rng = np.random.default_rng(0)
    trials = list(rng.normal(size=(n_trials, 8, 4)).astype(np.float32))
    features = make_haptic_pipeline(None)[0]
    rows = features.fit_transform(trials)
    assert rows.shape == (n_trials, 3 * 4 * 22) and rows.dtype == np.float32
    rows = features.scaler_.inverse_transform(rows)
    assert_allclose(rows[-1, 0], trials[-1][:4, 0].mean(), rtol=1e-4)


@pytest.mark.slow
def test_fabrics_in_ten_lines(shared_data):
    """Seven fabrics under a taxel finger, at forces and speeds never combined."""
    arrays = np.load(shared_data / "fabric_slides" / "fabric_slides.npz")
    trials = np.split(arrays["taxels"], np.cumsum(arrays["length"])[:-1])
    forces, speeds = arrays["force"].astype(int), arrays["speed"]
    model = make_haptic_pipeline(TaxelGrid((4, 4)), random_state=0)
    model.set_params(model=RidgeClassifier(100))
    scores = cross_val_score(
        model, trials, arrays["fabric"], groups=1000 * forces + speeds, cv=GroupKFold(3)
    )
    assert scores.mean() > 0.97


@pytest.mark.slow
def test_one_finger_in_ten_lines(shared_data):
    """Twenty materials under one BioTac, in runs that were recorded later."""
    arrays = np.load(shared_data / "biotac_slides" / "biotac_slides.npz")
    frames = np.split(arrays["frames"], np.cumsum(arrays["length"])[:-1])
    trials = pd.DataFrame({"pac": [f[:, 3:25].reshape(-1, 1) for f in frames]})
    trials["slow"] = [f[:, :3] for f in frames]
    trials["skin"] = [f[:, 25:] for f in frames]
    sensors = {"pac": Signal(2200), "slow": Signal(100), "skin": TaxelGrid("biotac")}
    model = make_haptic_pipeline(sensors, random_state=0)
    model.set_params(model=RidgeClassifier(100))
    late, materials = arrays["run"] > 10, arrays["material"]
    model.fit(trials[~late], materials[~late])
    assert model.score(trials[late], materials[late]) > 0.95
