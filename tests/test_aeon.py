"""Rocket features of aeon beside those of the package, each sensor at its own rate."""

import numpy as np
import pytest
from sklearn.compose import ColumnTransformer
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from sklearn_haptic import DistributionalOrdinalRegressor, SignalStatistics
from sklearn_haptic.datasets import make_haptic_corpus

pytest.importorskip("aeon")
pytestmark = [
    pytest.mark.slow,  # numba compiles
    pytest.mark.filterwarnings("ignore"),  # of aeon and numba
]


def of_equal_length(trials, n_times):
    """Cut trials, or repeat their last sample, for an array that aeon takes."""
    cut = [trial[:n_times] for trial in trials]
    padded = [
        np.pad(trial, ((0, n_times - len(trial)), (0, 0)), mode="edge") for trial in cut
    ]
    return np.stack(padded).swapaxes(1, 2)


def test_minirocket_is_a_step_of_a_column_transformer():
    from aeon.transformations.collection.convolution_based import MiniRocket

    corpus = make_haptic_corpus(
        4, 2, procedure="slow_slide", sensors=["pac", "pdc"], random_state=0
    )
    lengths = {s: max(map(len, corpus.trials[s])) for s in ("pac", "pdc")}
    assert len({*map(len, corpus.trials["pac"])}) > 1

    def rocket(sensor):
        cut = FunctionTransformer(of_equal_length, kw_args={"n_times": lengths[sensor]})
        # aeon takes no counts for y, so the kernels, which use no y, are fitted before.
        kernels = MiniRocket(84, random_state=0).fit(
            of_equal_length(corpus.trials[sensor], lengths[sensor])
        )
        return make_pipeline(cut, FrozenEstimator(kernels))

    features = ColumnTransformer(
        [
            ("pac", rocket("pac"), "pac"),
            ("pdc", rocket("pdc"), "pdc"),
            ("statistics", SignalStatistics(), "pdc"),
        ]
    )
    X = features.fit_transform(corpus.trials)
    assert X.shape == (8, 84 + 84 + 2 * 22)
    np.testing.assert_array_equal(
        X[:, 168:], SignalStatistics().fit_transform(corpus.trials["pdc"])
    )
    model = make_pipeline(features, StandardScaler(), DistributionalOrdinalRegressor())
    proba = model.fit(corpus.trials, corpus.ratings["hard"]).predict_proba(
        corpus.trials
    )
    np.testing.assert_allclose(proba.sum(axis=1), 1)
