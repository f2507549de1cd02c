"""Whole models in one call: what they are made of, and that they work."""

import pickle

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from sklearn import config_context
from sklearn.base import clone
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.neural_network import BernoulliRBM
from sklearn.pipeline import make_pipeline, make_union
from sklearn.preprocessing import MinMaxScaler

from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    DummyDistribution,
    KSVDTransformer,
    NoveltyGuard,
    RepairTrials,
    Signal,
    SignalStatistics,
    TouchPool,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    earth_movers_distance,
    neg_rps_scorer,
    ranked_probability_score,
)

pytestmark = pytest.mark.slow

SENSORS = ["pac", "pdc", "tac", "tdc", "electrodes"]


def part(model, sensor, name):
    (union,) = [
        t for column, t, _ in model["features"].transformers if column == sensor
    ]
    return union[name]


@pytest.fixture(scope="module")
def corpus():
    return make_haptic_corpus(n_objects=12, n_trials=3, random_state=0)


@pytest.fixture(scope="module")
def biotac_slides(shared_data):
    """Trials, materials and runs of real slides of one finger."""
    with np.load(shared_data / "biotac_slides" / "biotac_slides.npz") as arrays:
        slides = np.split(
            arrays["frames"].astype(np.float32), np.cumsum(arrays["length"])[:-1]
        )
        materials, runs = arrays["material"], arrays["run"]
    columns = {"tdc": slice(1), "tac": slice(1, 2), "pdc": slice(2, 3)}
    columns |= {"pac": slice(3, 25), "electrodes": slice(25, 44)}
    trials = {s: [slide[:, columns[s]] for slide in slides] for s in SENSORS}
    trials["pac"] = [trial.reshape(-1, 1) for trial in trials["pac"]]
    return pd.DataFrame(trials), materials, runs


def test_predicts_objects_never_touched(corpus):
    unseen = np.isin(corpus.objects, np.unique(corpus.objects)[::4])
    model = make_haptic_pipeline(SENSORS, random_state=0)
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


def test_features_are_roots_of_statistics_of_codes_beside_statistics(corpus):
    model = make_haptic_pipeline(["pdc"], random_state=0).fit(
        corpus.trials, corpus.ratings["hard"]
    )
    coder = clone(part(model, "pdc", "codes")[0])
    assert isinstance(coder, KSVDTransformer) and coder.max_iter == 0
    codes = coder.fit(corpus.trials["pdc"]).transform(corpus.trials["pdc"])
    features = model["features"].transform(corpus.trials)
    features = model["features"].scaler_.inverse_transform(features)
    n_channels = corpus.trials["pdc"].iloc[0].shape[1]
    n_statistics = 3 * 19 * n_channels  # a whole trial and its halves
    assert features.shape[1] == 3 * 7 * codes[0].shape[1] + n_statistics
    names = model["features"].get_feature_names_out()
    whole = {
        "mean_": [code.mean(axis=0) for code in codes],
        "share_": [(code != 0).mean(axis=0) for code in codes],
        "": [code.max(axis=0) for code in codes],
    }
    for statistic, expected in whole.items():
        start = f"pdc__codes__t1of1_{statistic}ch"
        columns = [name.startswith(start) for name in names]
        assert_allclose(features[:, columns], np.sqrt(expected), rtol=1e-5, atol=1e-6)
    assert sum(name.startswith("pdc__statistics__") for name in names) == n_statistics


def test_one_touch_is_asked_for_as_a_table(corpus):
    two = ["pdc", "tdc"]
    trials, counts = corpus.trials[two], corpus.ratings["hard"]
    model = make_haptic_pipeline(two, random_state=0)
    fast = clone(model).fit(trials, counts)
    rates = dict.fromkeys(two, 100)
    stream = AnytimeRegressor(model, durations=[1], sampling_rates=rates, cv=2)
    members = [(name, make_haptic_pipeline([name]), [name]) for name in two]
    told = {"groups": corpus.objects}
    takers = [
        fast.predict_proba,
        make_pipeline(RepairTrials(), clone(fast)).fit(trials, counts).predict_proba,
        stream.fit(trials, counts, **told).predict_proba,
        TouchPool(members, cv=2).fit(trials, counts, **told).predict_proba,
    ]
    for take in takers:
        for touch in (trials.iloc[0], dict(trials.iloc[0])):
            with pytest.raises(ValueError, match=r"^X is a (Series|dict); give a Data"):
                take(touch)
            proba = take(pd.DataFrame([touch]))
            np.testing.assert_array_equal(proba, take(trials.iloc[[0]]))


def test_steps_are_fitted_in_place(corpus):
    """So that parts of a model taken before or after a fit are parts of it."""
    trials, y = corpus.trials[["pac"]], corpus.ratings["hard"]
    model = make_haptic_pipeline(["pac"], random_state=0)
    features, head = model[:-1], model[-1]
    proba = model.fit(trials, y).predict_proba(trials)
    np.testing.assert_array_equal(head.predict_proba(features.transform(trials)), proba)
    less = slice(0, 24)
    expected = clone(model).fit(trials[less], y[less]).predict_proba(trials)
    head.fit(features.fit(trials[less]).transform(trials[less]), y[less])
    np.testing.assert_allclose(model.predict_proba(trials), expected, atol=1e-12)


def test_a_model_says_what_it_was_fitted_on(corpus):
    """Also when it was saved, in a notebook, and of names that are numpy.str_."""
    model = make_haptic_pipeline(np.array(["pac", "electrodes"]), random_state=0)
    model.fit(corpus.trials, corpus.ratings["hard"])
    features = pickle.loads(pickle.dumps(model))["features"]
    assert features.fitted_on_.tolist() == [
        "36 touches",
        "pac: 2 channels, 22000 samples at 2200 Hz (median)",
        "electrodes: 38 channels, 1000 samples (median)",
    ]
    assert f"numpy {np.__version__}" in features.versions_
    assert features.fitted_on_[1] in model._repr_html_()
    assert model["model"].levels_.tolist() == [1, 2, 3, 4, 5]


def test_only_rate_is_a_rate(corpus):
    """Not the learning rate of a transformer that a user puts in."""
    model = make_haptic_pipeline(["pac", "pdc"], random_state=0)
    statistics = SignalStatistics(("mean",)), SignalStatistics(("bands",), rate=100)
    learner = BernoulliRBM(4, learning_rate=0.3, n_iter=1, random_state=0)
    model.set_params(
        features__pac=make_pipeline(SignalStatistics(), MinMaxScaler(), learner),
        features__pdc=make_union(*statistics),
    )
    features = model["features"].fit(corpus.trials)
    assert features.fitted_on_.tolist()[1:] == [
        "pac: 2 channels, 22000 samples (median)",
        "pdc: 2 channels, 1000 samples at 100 Hz (median)",
    ]


def test_codes_of_either_sign_have_roots_with_their_sign(corpus):
    model = make_haptic_pipeline("tac", random_state=0)
    model.set_params(features__tac__codes__ksvdtransformer__sign="none")
    X = model["features"].fit_transform(corpus.trials)
    assert np.isfinite(X).all() and X.min() < 0 < X.max()


def test_the_blend_learns_on_whole_objects(corpus):
    """Given by keyword or by routing, objects reach the blend."""
    trials, counts = corpus.trials[["tdc"]], corpus.ratings["cold"]
    model = make_haptic_pipeline("tdc", random_state=0)
    named = clone(model).fit(trials, counts, model__groups=corpus.objects)
    with config_context(enable_metadata_routing=True):
        routed = clone(model).fit(trials, counts, groups=corpus.objects)
        search = GridSearchCV(
            model,
            {"model__strong__estimator__alpha": [10.0, 100.0]},
            cv=GroupKFold(3),
            scoring=neg_rps_scorer,
        ).fit(trials, counts, groups=corpus.objects)
    assert np.isfinite(search.best_score_)
    assert named["model"].weights_ == routed["model"].weights_


def test_memory_is_for_dictionaries_and_pooled_rows(tmp_path):
    model = make_haptic_pipeline(memory=str(tmp_path))
    for sensor in SENSORS:
        coder, pool = part(model, sensor, "codes")
        assert coder.memory == pool.memory == str(tmp_path)


def test_real_slides_of_one_finger(biotac_slides):
    """Materials felt by a single finger, from slides recorded later."""
    trials, materials, runs = biotac_slides
    assert len(trials) == 300
    assert trials["electrodes"][0].shape[1] == 19
    model = make_haptic_pipeline(random_state=0).set_params(
        model=LogisticRegression(max_iter=1000)
    )
    model.fit(trials[runs <= 10], materials[runs <= 10])
    names = model[:-1].get_feature_names_out()
    assert len(set(names)) == len(names) == model[-1].n_features_in_
    assert model.score(trials[runs > 10], materials[runs > 10]) > 0.9


def test_one_broken_sensor_of_five_is_noticed(biotac_slides):
    """Of real slides recorded later; electrodes vary most, and hide no other sensor."""
    trials, materials, runs = biotac_slides
    trials = pd.DataFrame({s: [t[: len(t) // 2] for t in trials[s]] for s in SENSORS})
    known, later = runs <= 8, runs > 8
    model = make_haptic_pipeline(random_state=0).set_params(model=NNPOM(0))
    guard = NoveltyGuard(model, cv=2)
    y = 12 * np.eye(5)[materials % 5]
    guard.fit(trials[known], y[known], groups=materials[known])
    assert np.mean(guard.p_values(trials[later]) <= 0.05) <= 0.05
    for sensor in SENSORS:
        stuck = [np.full_like(t, t.mean()) for t in trials.loc[later, sensor]]
        p = guard.p_values(trials[later].assign(**{sensor: stuck}))
        assert np.mean(p <= 0.05) >= 0.95


def test_real_slides_of_any_length(biotac_slides):
    """A touch of one window is enough to fit and to predict."""
    trials, _, _ = biotac_slides
    short = trials[::15].copy()
    for i, row in enumerate(short.index):
        for sensor in SENSORS:
            n_frames = min(50 + 40 * i, len(short.at[row, "pdc"]))
            per_frame = 22 if sensor == "pac" else 1
            short.at[row, sensor] = short.at[row, sensor][: n_frames * per_frame]
    model = make_haptic_pipeline(random_state=0)
    model.set_params(model=LogisticRegression())
    few = np.arange(20) % 3
    model.fit(short, few)
    assert np.isfinite(model.predict_proba(short)).all()
    model.fit(trials[::15], few)
    assert np.isfinite(model.predict_proba(short)).all()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_bursts_of_pure_tones_whose_codes_are_nearly_zero_in_training(dtype):
    rng = np.random.default_rng(6)

    def burst(hertz, level):  # two seconds, as played to an actuator
        t = np.arange(4000 + rng.integers(400)) / 2000
        on = t * 4 % 1 < rng.uniform(0.3, 1)
        return (level * np.sin(2 * np.pi * hertz * t) * on).astype(np.float32)

    hertz, level = rng.choice([200, 250, 400], 24), rng.uniform(0.2, 1, 24)
    touches = [burst(*each) for each in zip(hertz, level) for _ in range(3)]
    touches = [each.astype(dtype) for each in touches]
    people = np.exp(-0.5 * (np.arange(5) - 4 * level[:, np.newaxis]) ** 2)
    people /= people.sum(axis=1, keepdims=True)
    counts = rng.multinomial(15, people).repeat(3, axis=0)
    known = {"model__groups": np.arange(18).repeat(3)}
    model = make_haptic_pipeline(Signal(rate=2000), random_state=0)
    model.fit(touches[:54], counts[:54], **known)
    guess = np.tile(counts[:54].sum(axis=0) / counts[:54].sum(), (18, 1))
    new = people[18:].repeat(3, axis=0)
    error = earth_movers_distance(new, model.predict_proba(touches[54:]))
    assert error < 0.4 * earth_movers_distance(new, guess)
    train, test = map(model[:-1].transform, (touches[:54], touches[54:]))
    low, high = train.min(axis=0), train.max(axis=0)
    beyond = np.maximum(test - high, low - test)
    assert (beyond <= (high - low) * (1 + 1e-5) + 1e-6).all()


def test_folds_whose_touches_differ_in_length():
    """Touches shorter than any of training, and than the pyramid."""
    corpus = make_haptic_corpus(
        15, 4, procedure="fast_slide", sensors=["pdc"], random_state=11
    )
    model = make_haptic_pipeline("pdc", random_state=0)
    folds = GroupKFold(5)
    lengths = np.array([len(trial) for trial in corpus.trials["pdc"]])
    assert any(
        lengths[test].min() < lengths[train].min()
        for train, test in folds.split(lengths, groups=corpus.objects)
    )
    scores = cross_val_score(
        model,
        corpus.trials,
        corpus.ratings["hard"],
        groups=corpus.objects,
        cv=folds,
        scoring=neg_rps_scorer,
        error_score="raise",
    )
    assert np.isfinite(scores).all()


@pytest.mark.parametrize("path", ["features", "features__pdc"])
def test_weights_of_sensors_that_would_have_no_effect_are_refused(path):
    corpus = make_haptic_corpus(4, 2, sensors=["pdc"], random_state=0)
    model = make_haptic_pipeline(["pdc"], random_state=0)
    part = "pdc" if path == "features" else "codes"
    model.set_params(**{f"{path}__transformer_weights": {part: 2.0}})
    with pytest.raises(ValueError, match="would have no effect"):
        model.fit(corpus.trials, corpus.ratings["hard"])
