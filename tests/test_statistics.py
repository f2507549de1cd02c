from itertools import pairwise

import numpy as np
import pytest
import scipy.fft
from numpy.testing import assert_allclose, assert_array_equal

from sklearn_haptic import (
    KSVDTransformer,
    Signal,
    SignalStatistics,
    make_haptic_pipeline,
)
from sklearn_haptic.features._statistics import band_edges, band_powers

LEVELS = ["mean", "std", "max", "min", "slope", "change"]


def recordings(lengths=(120, 97, 120, 64), n_channels=3, dtype=np.float64, seed=0):
    rng = np.random.default_rng(seed)
    return [
        (rng.normal(size=(n, n_channels)).cumsum(axis=0) + 40).astype(dtype)
        for n in lengths
    ]


def loop_levels(x):
    """Statistics of one channel, sample by sample."""
    n, x = len(x), x.astype(float)
    mean = sum(x) / n
    return [
        mean,
        (sum((v - mean) ** 2 for v in x) / n) ** 0.5,
        max(x),
        min(x),
        np.polyfit(np.arange(n), x, 1)[0] if n > 1 else 0,
        sum(abs(b - a) for a, b in pairwise(x)) / max(1, n - 1),
    ]


def loop_bands(x, n_bands):
    """Powers of bands by the mirrored signal's Fourier transform, line by line."""
    n = scipy.fft.next_fast_len(len(x), real=True)
    x = x.astype(float) - x.astype(float).mean()
    x = np.append(x, x[::-1][: n - len(x)])
    mirrored = np.append(x, x[::-1])
    lines = np.abs(np.fft.fft(mirrored)[:n]) ** 2 / (2 * n)
    edges = [0, *(0.5 * 2 ** (8 * (i / n_bands - 1)) for i in range(1, n_bands + 1))]
    powers = np.zeros(n_bands)
    for k in range(1, n):
        low, high = (0 if k == 1 else k - 0.5) / (2 * n), (k + 0.5) / (2 * n)
        overlaps = np.minimum(high, edges[1:]) - np.maximum(low, edges[:-1])
        shares = np.maximum(0, overlaps) / (high - low)
        if k == n - 1:  # the last line has what is left
            shares[-1] = 1 - shares[:-1].sum()
        powers += shares * lines[k] / n
    return powers


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_levels_equal_a_plain_loop(dtype):
    trials = recordings((120, 97, 2, 1), dtype=dtype)
    features = SignalStatistics(LEVELS).fit_transform(trials)
    assert features.dtype == dtype
    expected = [np.concatenate([loop_levels(x) for x in t.T]) for t in trials]
    tolerance = 1e-4 if dtype == np.float32 else 1e-10
    assert_allclose(features, expected, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n_bands", [1, 4, 16])
def test_bands_equal_the_fourier_transform_of_the_mirrored_signal(dtype, n_bands):
    trials = recordings((120, 97, 31, 3, 2, 1), dtype=dtype)
    model = SignalStatistics(["bands"], n_bands=n_bands).fit(trials)
    stds = np.array([t.astype(float).std(axis=0) for t in trials])
    assert_allclose(model.scale_, np.sqrt((stds**2).mean(axis=0)), 1e-5)
    expected = [
        np.concatenate(
            [
                np.log(loop_bands(x, n_bands) / s**2 + 1e-8)
                for x, s in zip(t.T, model.scale_)
            ]
        )
        for t in trials
    ]
    assert_allclose(
        model.transform(trials), expected, atol=1e-2 if dtype == np.float32 else 1e-9
    )


@pytest.mark.parametrize("n_times", [2, 3, 5, 96, 4999, 5000, 100_000])
def test_powers_of_bands_add_up_to_the_variance(n_times):
    x = np.random.default_rng(0).normal(size=(3, n_times))
    x -= x.mean(axis=1, keepdims=True)
    powers = band_powers(x, band_edges(16))
    assert (powers >= 0).all()
    # The mirror may count a few samples at the end twice.
    tolerance = 0 if n_times in (2, 3, 5, 96, 5000, 100_000) else 0.02
    assert_allclose(powers.sum(axis=1), x.var(axis=1), 1e-12 + tolerance)


def test_a_sample_less_changes_no_band_of_a_short_signal_much():
    x = np.random.default_rng(0).normal(size=(200, 1)).cumsum(axis=0)
    shorter = [x[:n] for n in range(20, 200)]
    bands = SignalStatistics(("bands",)).fit([x]).transform(shorter)
    assert abs(np.diff(bands, axis=0)).max() < 4  # 15 if line 1 does not begin at 0
    assert bands.min() > -9  # the floor is -18


def test_a_drift_does_not_cover_high_bands():
    ramp = np.linspace(0, 1, 800)
    (powers,) = band_powers(ramp[np.newaxis] - ramp.mean(), band_edges(4))
    assert powers[3] < 1e-6 * powers.sum()
    fourier = np.abs(np.fft.rfft(ramp - ramp.mean())) ** 2
    assert fourier[200:].sum() > 1e-3 * fourier.sum()


def test_a_trial_has_the_same_features_alone_and_among_others():
    trials = recordings((120, 97, 120, 64, 120))
    model = SignalStatistics().fit(trials)
    together = model.transform(trials)
    for i, trial in enumerate(trials):
        assert_allclose(model.transform([trial])[0], together[i], 1e-12)
    assert_array_equal(model.transform(trials[::-1]), together[::-1])


@pytest.mark.parametrize("exponent", [-900, -300, 7, 300, 900])
def test_scaling_by_a_power_of_two_scales_levels_and_leaves_bands(exponent):
    trials = recordings()
    scaled = [np.ldexp(trial, exponent) for trial in trials]
    levels = SignalStatistics(LEVELS)
    expected = np.ldexp(levels.fit_transform(trials), exponent)
    assert_array_equal(levels.fit_transform(scaled), expected)
    bands = SignalStatistics(["bands"])
    assert_allclose(bands.fit_transform(scaled), bands.fit_transform(trials), atol=1e-9)


@pytest.mark.parametrize("value", [0.0, 0.1, 1e-310, -3e200])
@pytest.mark.parametrize("n_times", [1, 2, 97])
def test_constant_channels_are_finite(value, n_times):
    trials = [np.full((n_times, 2), value), np.full((5, 2), value)]
    model = SignalStatistics().fit(trials)
    features = model.transform(trials)
    assert np.isfinite(features).all()
    names = model.get_feature_names_out()
    assert_allclose(features[:, names == "t1of1_ch0_mean"], value, 1e-14)
    assert (features[:, names == "t1of1_ch0_band16of16"] < -16).all()


def test_cells_are_the_statistics_of_parts():
    trials = recordings((120, 97, 5, 3))
    model = SignalStatistics(n_bands=4, cells=(4, 1)).fit(trials)
    names = model.get_feature_names_out()
    whole = SignalStatistics(n_bands=4).fit(trials)
    features = model.transform(trials)
    assert_array_equal(features[:, -30:], whole.transform(trials))
    assert names[30 * 2 + 10] == "t3of4_ch1_mean"
    for i in range(4):
        parts = [t[i * len(t) // 4 : (i + 1) * len(t) // 4] for t in trials[:3]]
        assert_allclose(
            features[:3, 30 * i : 30 * (i + 1)], whole.transform(parts), 1e-10, 1e-10
        )
    # A trial shorter than the cells has the sample at the middle and its neighbours.
    short = trials[3]
    parts = [short[:2], short, short, short[1:]]
    assert_allclose(features[3, :-30], whole.transform(parts).ravel(), 1e-10, 1e-10)


def test_silence_is_at_the_floor():
    model = SignalStatistics(["bands"]).fit(recordings())
    silent = model.transform([np.zeros((50, 3))])
    assert_allclose(silent, np.log(1e-8))


def test_a_row_of_a_table_is_a_trial_with_one_channel():
    X = np.random.default_rng(0).normal(size=(5, 50))
    of_table = SignalStatistics().fit(X)
    assert_array_equal(
        of_table.transform(X), SignalStatistics().fit_transform(list(X[:, :, None]))
    )
    assert of_table.n_features_in_ == 50


def test_statistics_of_codes():
    codes = KSVDTransformer(4, 2, window=10, random_state=0).fit_transform(recordings())
    model = SignalStatistics(("mean", "max")).fit(codes)
    expected = [
        np.stack([c.mean(axis=0), c.max(axis=0)], axis=1).ravel() for c in codes
    ]
    assert_allclose(model.transform(codes), expected, 1e-12, 1e-12)
    assert model.get_feature_names_out()[1] == "t1of1_ch0_atom0+_max"


def test_parameters_set_after_fit_wait_for_the_next_fit():
    trials = recordings()
    model = SignalStatistics(("max", "bands"), n_bands=3).fit(trials)
    expected, names = model.transform(trials), model.get_feature_names_out()
    model.set_params(statistics=("min",), n_bands=5)
    assert_array_equal(model.transform(trials), expected)
    assert_array_equal(model.get_feature_names_out(), names)


@pytest.mark.parametrize("sensor", [None, Signal(rate=100)])
def test_warns_of_transposed_trials(sensor):
    trials = np.random.default_rng(0).normal(size=(8, 200, 12))
    features = make_haptic_pipeline(sensor, random_state=0)[:-1]
    with pytest.warns(
        UserWarning, match=r"\(12, 200\) is taken for 12 time samples of"
    ):
        features.fit(trials.swapaxes(1, 2))
    features.fit(trials)
    SignalStatistics().fit(trials[:, :12, :, np.newaxis].repeat(20, axis=3))  # images


def test_images_of_another_orientation_are_refused():
    """As many pixels in another order would be other channels."""
    rng = np.random.default_rng(0)
    images = [rng.normal(size=(20, 3, 4)) for _ in range(4)]
    statistics = SignalStatistics().fit(images)
    turned = [each.transpose(0, 2, 1) for each in images]
    with pytest.raises(ValueError, match="frames of 4 × 3, but frames of 3 × 4 are"):
        statistics.transform(turned)
    flat = [each.reshape(20, 12) for each in images]
    np.testing.assert_array_equal(
        statistics.transform(flat), statistics.transform(images)
    )
