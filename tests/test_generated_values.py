"""Generated corpora stay the same: figures of the pages were computed from them."""

import numpy as np
import pytest

from sklearn_haptic.datasets import make_haptic_corpus

# Of the samples of each sensor: mean, standard deviation, and how they go with a wave.
SIGNALS = {
    "squeeze": {
        "pac": [-0.001, 172.813, -0.041],
        "pdc": [225.214, 160.952, 0.050],
        "tac": [24.883, 29.693, 0.293],
        "tdc": [-4.441, 5.801, 0.010],
        "electrodes": [11.846, 41.505, -0.039],
    },
    "hold": {
        "pac": [0.798, 14.264, 0.019],
        "pdc": [246.593, 108.549, 0.213],
        "tac": [34.793, 31.287, -0.108],
        "tdc": [-11.402, 13.143, 0.041],
        "electrodes": [13.533, 43.282, 0.102],
    },
    "slow_slide": {
        "pac": [1.747, 53.774, 0.008],
        "pdc": [173.645, 76.784, -0.951],
        "tac": [18.963, 20.547, -0.355],
        "tdc": [-16.533, 17.103, -0.139],
        "electrodes": [2.617, 66.638, -0.496],
    },
    "fast_slide": {
        "pac": [2.823, 131.191, -0.068],
        "pdc": [133.947, 76.741, 0.500],
        "tac": [18.765, 21.501, 0.122],
        "tdc": [-18.343, 20.501, -0.555],
        "electrodes": [-6.252, 98.031, 0.120],
    },
}
PROPERTIES = [579.3544, 35.0657, 6.7365, 23.6685, -3.1748, 32.7399, -1.2626, 0.6547]
PROPERTIES += [-3.0389, -0.9399, -0.5341]
# Ratings times the place of the object, expected and given.
TRUTH = [4309.673, 2444.886, 1206.378, 4011.760, 1922.275, 146.475, 2450.633]
TRUTH += [672.486, 2117.672, 2183.380]
GIVEN = [52455, 29008, 13753, 47752, 23114, 3056, 32280, 7367, 24907, 26668]


@pytest.mark.parametrize("procedure", SIGNALS)
def test_signals(procedure):
    corpus = make_haptic_corpus(60, 1, procedure, random_state=0)
    for sensor, expected in SIGNALS[procedure].items():
        x = np.concatenate([trial.ravel() for trial in corpus.trials[sensor]])
        x = x.astype(np.float64)
        found = x.mean(), x.std(), 100 * np.mean(x * np.cos(np.arange(x.size)))
        np.testing.assert_allclose(found, expected, atol=0.002, err_msg=sensor)


def test_materials_of_few_objects():
    names = make_haptic_corpus(9, 1, sensors=["tdc"], random_state=0).object_names
    assert " ".join(names) == (
        "foam foam plastic plastic paper paper fabric organic glass"
    )


def test_objects_and_ratings():
    corpus = make_haptic_corpus(60, 1, sensors=["tdc"], random_state=0)
    properties = corpus.properties.drop(columns="material").sum()
    np.testing.assert_allclose(properties, PROPERTIES, atol=1e-3)
    assert corpus.objects.sum() == 17770
    rank, level = np.arange(60), np.arange(5)
    truth = [rank @ proba @ level for proba in corpus.true_proba.values()]
    np.testing.assert_allclose(truth, TRUTH, atol=0.01)
    people = [rank @ counts @ level for counts in corpus.ratings.values()]
    assert people == GIVEN
