"""Whole models in one call: what they are made of, and that they work."""

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, GroupKFold

from sklearn_haptic import (
    DummyDistribution,
    KSVDTransformer,
    STHMPTransformer,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import ranked_probability_score

SENSORS = ["pac", "pdc", "tac", "tdc", "electrodes"]


def part(model, sensor, step=0):
    (branch,) = [t for name, t, _ in model["features"].transformers if name == sensor]
    return branch[step]


@pytest.fixture(scope="module")
def corpus():
    return make_haptic_corpus(n_objects=12, n_trials=3, random_state=0)


@pytest.mark.parametrize("preset", ["fast", "balanced", "accurate"])
def test_predicts_objects_never_touched(corpus, preset):
    unseen = np.isin(corpus.objects, np.unique(corpus.objects)[::4])
    model = make_haptic_pipeline(SENSORS, preset=preset, random_state=0)
    counts = corpus.ratings["hard"]
    model.fit(corpus.trials[~unseen], counts[~unseen])
    proba = model.predict_proba(corpus.trials[unseen])
    marginal = DummyDistribution().fit(corpus.trials[~unseen], counts[~unseen])
    assert ranked_probability_score(counts[unseen], proba) < ranked_probability_score(
        counts[unseen], marginal.predict_proba(corpus.trials[unseen])
    )
    names = model[:-1].get_feature_names_out()
    assert len(names) == model[-1].n_features_in_
    assert [s for s in SENSORS if names[0].startswith(s)] == ["pac"]


def test_accurate_has_the_defaults_of_the_transformers():
    model = make_haptic_pipeline(preset="accurate")
    expected = KSVDTransformer(40, window=22, remove_mean=False).get_params()
    assert part(model, "pac").get_params() == expected
    expected = STHMPTransformer(remove_mean=False).get_params()
    assert part(model, "electrodes").get_params() == expected


def test_memory_is_for_dictionaries_and_pooled_rows(tmp_path):
    model = make_haptic_pipeline(memory=str(tmp_path))
    for sensor in SENSORS:
        assert part(model, sensor).memory == part(model, sensor, 1).memory
        assert part(model, sensor).memory == str(tmp_path)


def test_presets_grow():
    fast, balanced, accurate = (
        make_haptic_pipeline(preset=preset)
        for preset in ("fast", "balanced", "accurate")
    )
    for sensor in SENSORS:
        for name in ("n_nonzero_coefs", "max_iter", "max_train_windows"):
            values = [
                getattr(part(m, sensor), name) for m in (fast, balanced, accurate)
            ]
            assert values == sorted(values)
        cells = [sum(part(m, sensor, 1).cells) for m in (fast, balanced, accurate)]
        assert cells == sorted(cells) and cells[0] < cells[2]


def test_only_the_sensors_asked_for(corpus, tmp_path):
    only = corpus.trials[["tdc"]]
    model = make_haptic_pipeline(
        "tdc", preset="fast", memory=str(tmp_path), random_state=0
    )
    search = GridSearchCV(
        model,
        {"model__estimator__alpha": [1.0, 100.0], "model__n_duplicates": [5, 15]},
        cv=GroupKFold(3),
    ).fit(only, corpus.ratings["cold"], groups=corpus.objects)
    assert np.isfinite(search.cv_results_["mean_test_score"]).all()
    again = clone(model).set_params(**search.best_params_)
    np.testing.assert_array_equal(
        again.fit(only, corpus.ratings["cold"]).predict_proba(only),
        search.predict_proba(only),
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"sensors": ["pac", "sound"]}, r"must name some of \['pac', .*build a Pipe"),
        ({"sensors": []}, "must name some of"),
        ({"preset": "best"}, "preset='best' must be one of .*'fast'"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        make_haptic_pipeline(**arguments)
