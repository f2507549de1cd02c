"""Sensor holdouts, their table, and what its summary says about it."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import wilcoxon
from sklearn import config_context
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.model_selection import KFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    SensorFusionNNPOM,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import ranked_probability_score
from sklearn_haptic.metrics._trial_scores import score_trials
from sklearn_haptic.model_selection import contribution_summary, sensor_contributions
from sklearn_haptic.model_selection._contributions import fit_holdouts
from sklearn_haptic.utils._folds import ObjectKFold

SENSORS = {"pac": [0, 1], "pdc": [2, 3], "tdc": [4]}
SCORES = ["macro_mae", "emd", "rps", "log_score", "rps_1", "rps_2", "rps_3", "rps_4"]

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("one_thread")]


def make_touches(n_objects, n_trials, seed):
    """Features of which column 0, of "pac", alone tells how people rate an object."""
    rng = np.random.default_rng(seed)
    objects = np.repeat([f"object {i}" for i in range(n_objects)], n_trials)
    feel = rng.normal(size=n_objects)
    X = rng.normal(size=(n_objects * n_trials, 5))
    X[:, 0] = np.repeat(feel, n_trials) + 0.2 * X[:, 0]
    weights = np.exp(-0.5 * (np.arange(5) - 2 - 1.5 * feel[:, None]) ** 2)
    counts = rng.multinomial(12, weights / weights.sum(axis=1, keepdims=True))
    return X, np.repeat(counts, n_trials, axis=0), objects


def make_regressor(**params):
    network = NNPOM(n_hidden=2, alpha=3.0)
    fusion = SensorFusionNNPOM(SENSORS, network, network).set_params(**params)
    return DistributionalOrdinalRegressor(fusion, n_duplicates=5)


@pytest.fixture(scope="module")
def touches():
    return make_touches(24, 2, seed=0)


@pytest.fixture(scope="module")
def scores(touches, one_thread):
    X, y, objects = touches
    return sensor_contributions(
        make_regressor(), X, y, groups=objects, cv=3, n_repeats=4, random_state=0
    )


# Scores of every trial ----------------------------------------------------------------


def test_scores_by_hand():
    """Cumulative: ratings (.25, .5, .75), predicted (.5, .5, .5); and a sure hit."""
    scores = score_trials(
        [[1, 1, 1, 1], [0, 4, 0, 0]], [[0.5, 0, 0, 0.5], [0, 1.0, 0, 0]]
    )
    assert list(scores) == [
        *("macro_mae", "emd", "rps", "log_score"),
        *("rps_1", "rps_2", "rps_3"),
    ]
    # 99 positions: p ≤ .25 and p > .75 agree, the rest is one level off, but for
    # p = .5, which is in both the second level and predicted as the first.
    np.testing.assert_allclose(scores["macro_mae"], [0.5, 0])
    np.testing.assert_allclose(scores["emd"], [0.5, 0])
    np.testing.assert_allclose(scores["rps_1"], [0.25**2 + 0.25 * 0.75, 0])
    np.testing.assert_allclose(scores["rps_2"], [0.25, 0])
    np.testing.assert_allclose(scores["rps_3"], [0.25**2 + 0.25 * 0.75, 0])
    np.testing.assert_allclose(scores["rps"], [0.75, 0])
    np.testing.assert_array_equal(scores["log_score"], [np.inf, 0])


def test_terms_of_thresholds_sum_to_the_ranked_probability_score():
    rng = np.random.default_rng(0)
    counts, proba = rng.integers(1, 9, (20, 5)), rng.dirichlet(np.ones(5), 20)
    scores = score_trials(counts, proba)
    terms = np.sum([scores[f"rps_{k}"] for k in range(1, 5)], axis=0)
    np.testing.assert_allclose(
        terms, ranked_probability_score(counts, proba, average=False)
    )
    # Brute force over people, for whether a rating is at most 2.
    for t in range(20):
        people = np.repeat(np.arange(1, 6), counts[t])
        squares = (proba[t, :2].sum() - (people <= 2)) ** 2
        assert scores["rps_2"][t] == pytest.approx(squares.mean())


# The table ----------------------------------------------------------------------------


def test_table_has_a_row_for_each_model_start_and_test_trial(scores, touches):
    X, _, objects = touches
    keys = ["held_out", "start", "fold", "object", "trial"]
    assert list(scores) == [*keys, *SCORES]
    assert len(scores) == 4 * 4 * len(X)
    assert list(scores["held_out"].unique()) == ["none", *SENSORS]
    for _, model in scores.groupby(["held_out", "start"]):
        assert sorted(model["trial"]) == list(range(len(X)))
        np.testing.assert_array_equal(objects[model["trial"]], model["object"])
    assert (scores.groupby("object")["fold"].nunique() == 1).all()


def test_holdouts_equal_models_fitted_one_by_one(scores, touches):
    X, y, objects = touches
    seeds = np.random.RandomState(0).randint(np.iinfo(np.int32).max, size=4)
    folds = list(ObjectKFold(3).split(X, y, objects))
    for fold, start in [(0, 0), (2, 3)]:
        train, test = folds[fold]
        full = make_regressor().set_params(random_state=seeds[start])
        full.fit(X[train], y[train])
        for held_out in ["none", *SENSORS]:
            model = full
            if held_out != "none":
                model = clone(full).set_params(estimator__held_out=held_out)
                model.fit(X[train], y[train])
            rows = scores.query("held_out == @held_out and fold == @fold")
            rows = rows[rows["start"] == start].set_index("trial").loc[test]
            rps = ranked_probability_score(
                y[test], model.predict_proba(X[test]), average=False
            )
            np.testing.assert_allclose(rows["rps"], rps, rtol=1e-9)


def test_networks_of_sensors_are_fitted_once_and_shared(touches, monkeypatch):
    X, y, _ = touches
    fitted, fit = [], NNPOM.fit_with_positions
    monkeypatch.setattr(
        NNPOM,
        "fit_with_positions",
        lambda self, *args, **kwargs: fitted.append(fit(self, *args, **kwargs)),
    )
    models = fit_holdouts(make_regressor(), X, y, random_state=0)
    full = models["none"].estimator_
    assert full.held_out is None
    final = [model.estimator_.final_network_ for model in models.values()]
    assert [id(n) for n in fitted] == [
        id(n) for n in (*full.sensor_networks_.values(), *final)
    ]
    for held_out in SENSORS:
        fusion = models[held_out].estimator_
        assert fusion.held_out == held_out
        others = full.sensor_networks_.keys() - {held_out}
        assert fusion.sensor_networks_.keys() == others
        for sensor in others:
            np.testing.assert_array_equal(
                fusion.sensor_networks_[sensor].coefs_[0],
                full.sensor_networks_[sensor].coefs_[0],
            )


def test_frozen_networks_stay_and_only_the_combined_network_restarts(touches):
    X, y, _ = touches
    fitted = make_regressor().set_params(random_state=7).fit(X, y).estimator_
    frozen = {
        sensor: FrozenEstimator(network)
        for sensor, network in fitted.sensor_networks_.items()
    }
    regressor = make_regressor(estimator=frozen)
    starts = [fit_holdouts(regressor, X, y, random_state=seed) for seed in (0, 1)]
    for models in starts:
        for sensor, network in fitted.sensor_networks_.items():
            held = models["none"].estimator_.sensor_networks_[sensor]
            np.testing.assert_array_equal(held.coefs_[0], network.coefs_[0])
    first, second = (models["none"].estimator_.final_network_ for models in starts)
    assert not np.array_equal(first.coefs_[0], second.coefs_[0])


@pytest.mark.parametrize("output", ["pandas", "polars"])
def test_pipeline_tells_sensors_by_names_and_learns_nothing_of_test_trials(
    touches, output
):
    X, y, objects = touches
    names = [f"{name}__{i}" for name, of in SENSORS.items() for i in range(len(of))]
    frame = pd.DataFrame(X, columns=names)
    train, test = np.arange(36), np.arange(36, 48)
    model = make_pipeline(StandardScaler(), make_regressor(sensors=None))
    settings = {"groups": objects, "cv": [(train, test)], "n_repeats": 1}
    with config_context(transform_output=output):
        scores = sensor_contributions(model, frame, y, random_state=0, **settings)
    assert list(scores["held_out"].unique()) == ["none", *SENSORS]
    scaled = StandardScaler().fit(frame.iloc[train]).transform(frame)
    by_hand = sensor_contributions(
        make_regressor(), scaled, y, random_state=0, **settings
    )
    # Last digits of the features may decide after which iteration a network stops.
    pd.testing.assert_frame_equal(scores, by_hand, rtol=5e-3)


def test_recordings():
    corpus = make_haptic_corpus(6, 2, sensors=["tdc", "pdc"], random_state=0)
    model = make_haptic_pipeline(["tdc", "pdc"], random_state=0)
    model.set_params(model=DistributionalOrdinalRegressor(SensorFusionNNPOM()))
    model.set_output(transform="pandas")
    scores = sensor_contributions(
        model, corpus.trials, corpus.ratings["hard"], groups=corpus.objects, cv=2
    )
    assert list(scores["held_out"].unique()) == ["none", "tdc", "pdc"]
    assert len(scores) == 3 * 10 * 12


@pytest.mark.parametrize("n_folds, cv", [(5, None), (3, 3), (3, np.int64(3))])
def test_objects_are_kept_together_by_default(touches, n_folds, cv):
    X, y, objects = touches
    settings = {"groups": objects, "n_repeats": 1, "random_state": 0}
    scores = sensor_contributions(make_regressor(), X, y, cv=cv, **settings)
    by_hand = sensor_contributions(
        make_regressor(),
        X,
        y,
        cv=[*ObjectKFold(n_folds).split(X, y, objects)],
        **settings,
    )
    pd.testing.assert_frame_equal(scores, by_hand)
    assert (scores.groupby("object")["fold"].nunique() == 1).all()


def test_labels_without_groups(touches):
    """Each trial is an object of its own; levels absent from a fold keep theirs."""
    X, y, _ = touches
    labels = np.array(["a", "b", "c", "d", "e"])[y.argmax(axis=1)]
    model = make_regressor().set_params(levels=[*"abcde"])
    scores = sensor_contributions(model, X, labels, cv=KFold(2), n_repeats=1)
    assert list(scores.columns[5:]) == SCORES
    np.testing.assert_array_equal(scores["object"], scores["trial"])


@pytest.mark.filterwarnings("ignore:.*fit was given no groups")
def test_early_stopping_validates_on_whole_objects(touches):
    X, y, _ = touches
    stops_early = NNPOM(n_hidden=2, early_stopping=True, validation_fraction=0.5)
    model = make_regressor(estimator=stops_early, final_estimator=stops_early)
    objects = np.repeat([*"abcdefgh"], 6)
    train, test = np.arange(24), np.arange(24, 48)
    table = sensor_contributions(
        model, X, y, groups=objects, cv=[(train, test)], n_repeats=1, random_state=0
    )
    seed = np.random.RandomState(0).randint(np.iinfo(np.int32).max)
    model.set_params(random_state=seed)
    rps = table.query("held_out == 'none'")["rps"]
    for groups, same in [(objects[train], True), (train, False)]:
        proba = model.fit(X[train], y[train], groups=groups).predict_proba(X[test])
        by_hand = ranked_probability_score(y[test], proba, average=False)
        assert np.allclose(rps, by_hand) == same


def test_validation_trials_are_passed_on(touches):
    X, y, _ = touches
    stops_early = NNPOM(n_hidden=2, early_stopping=True)
    model = make_regressor(estimator=stops_early, final_estimator=stops_early)
    model.set_params(random_state=3)
    models = fit_holdouts(
        model, X[:30], y[:30], random_state=3, X_val=X[30:], y_val=y[30:]
    )
    by_hand = model.fit(X[:30], y[:30], X_val=X[30:], y_val=y[30:])
    np.testing.assert_allclose(
        models["none"].predict_proba(X), by_hand.predict_proba(X), rtol=1e-9
    )


# Its summary --------------------------------------------------------------------------


def hand_made_table():
    """Two objects, of one and two trials; three starts; two sensors."""
    values = {
        "none": [[1.0, 2.0, 3.0], [1.5, 2.5, 2.0], [2.0, 2.0, 2.0]],
        "pac": [[2.0, 3.0, 5.0], [2.5, 3.5, 3.0], [3.0, 3.0, 3.0]],
        "tdc": [[1.0, 2.0, 2.0], [1.5, 2.0, 2.0], [1.0, 2.5, 2.0]],
    }
    return pd.DataFrame(
        [
            {
                "held_out": held_out,
                "start": start,
                "fold": 0,
                "object": "ABB"[trial],
                "trial": trial,
                "emd": value,
            }
            for held_out, starts in values.items()
            for start, trials in enumerate(starts)
            for trial, value in enumerate(trials)
        ]
    )


def test_summary_by_hand():
    summary = contribution_summary(hand_made_table(), metric="emd")
    assert list(summary) == [
        *("held_out", "full", "full_sd", "holdout", "holdout_sd"),
        *("difference", "difference_sd", "p_objects"),
    ]
    assert list(summary["held_out"]) == ["pac", "tdc"]
    for row, starts in zip(
        summary.itertuples(), [[10 / 3, 3, 3], [5 / 3, 5.5 / 3, 5.5 / 3]]
    ):
        assert row.full == pytest.approx(2)
        assert row.full_sd == pytest.approx(0)
        assert row.holdout == pytest.approx(np.mean(starts))
        assert row.holdout_sd == pytest.approx(np.std(starts, ddof=1))
        assert row.difference == pytest.approx(np.mean(starts) - 2)
        assert row.difference_sd == pytest.approx(np.std(starts, ddof=1))
    # Objects A and B: 1 and 7/6; -1/3 and -1/6. Two of a sign: p = 1 / 4, or 1.
    np.testing.assert_allclose(summary["p_objects"], [0.25, 1])


def test_the_test_is_scipys_on_objects(scores):
    for metric in SCORES:
        summary = contribution_summary(scores, metric=metric).set_index("held_out")
        for sensor in SENSORS:
            full, without = (
                scores[scores["held_out"] == model].groupby("object")[metric].mean()
                for model in ("none", sensor)
            )
            difference = np.round(without - full, 12)  # but for rounding
            difference = difference[difference != 0]
            p = wilcoxon(difference, alternative="greater").pvalue
            assert summary.loc[sensor, "p_objects"] == pytest.approx(p)


@pytest.mark.parametrize("better", [4, 5, 6])
def test_objects_that_do_not_differ_are_not_counted(better):
    """Of all signs of the others, one has as high a sum of ranks: p is exact."""
    frame = pd.DataFrame({"object": np.arange(16), "trial": np.arange(16), "fold": 0})
    gain = np.r_[np.arange(better) + 1.0, np.zeros(16 - better)]
    table = pd.concat(
        frame.assign(held_out=model, start=start, emd=1 + gain * (model == "pac"))
        for model in ("none", "pac")
        for start in range(2)
    )
    summary = contribution_summary(table, metric="emd")
    np.testing.assert_allclose(summary["p_objects"], 2.0**-better)


def test_categories_without_rows_are_no_objects():
    """As filtering leaves them."""
    one = hand_made_table()
    table = pd.concat(
        one.assign(procedure=name, object=one["object"] + name)
        for name in ("hold", "squeeze")
    )
    held = table["procedure"] == "hold"
    categories = table.astype({"object": "category", "procedure": "category"})
    for by in (None, "procedure"):
        expected = contribution_summary(table[held], metric="emd", by=by)
        summary = contribution_summary(categories[held], metric="emd", by=by)
        pd.testing.assert_frame_equal(summary, expected, check_dtype=False)


def test_equal_models_are_no_evidence():
    table = hand_made_table().assign(emd=0.3)
    summary = contribution_summary(table, metric="emd")
    np.testing.assert_array_equal(summary["difference"], 0)
    np.testing.assert_array_equal(summary["p_objects"], 1)


def test_by_object_tests_no_objects():
    summary = contribution_summary(hand_made_table(), metric="emd", by="object")
    assert "p_objects" not in summary
    assert summary[["object", "held_out"]].to_numpy().tolist() == [
        ["A", "pac"],
        ["A", "tdc"],
        ["B", "pac"],
        ["B", "tdc"],
    ]
    np.testing.assert_allclose(summary["difference"], [1, -1 / 3, 7 / 6, -1 / 6])


def test_by_threshold_takes_the_terms_apart(scores):
    summary = contribution_summary(scores, by="threshold")
    assert summary["threshold"].unique().tolist() == [1, 2, 3, 4]
    for k, rows in summary.groupby("threshold"):
        alone = contribution_summary(scores, metric=f"rps_{k}")
        pd.testing.assert_frame_equal(
            rows.drop(columns="threshold").reset_index(drop=True), alone
        )
    sums = summary.groupby("held_out", sort=False)["difference"].sum()
    whole = contribution_summary(scores, metric="rps").set_index("held_out")
    pd.testing.assert_series_equal(sums, whole["difference"])


def test_by_threshold_of_adjectives_of_different_levels(scores):
    """The adjective of fewer levels has fewer terms, as it would have alone."""
    few = scores.assign(adjective="dry", rps_3=np.nan, rps_4=np.nan)
    both = pd.concat([scores.assign(adjective="hard"), few])
    by = ["adjective", "threshold"]
    summary = contribution_summary(both, by=by).set_index(by).sort_index()
    assert {*summary.index} == {
        *(("hard", k) for k in (1, 2, 3, 4)),
        *(("dry", k) for k in (1, 2)),
    }
    alone = contribution_summary(scores, by="threshold").set_index("threshold")
    np.testing.assert_allclose(
        summary.loc[("dry", 2), "difference"], alone.loc[2, "difference"]
    )
    damaged = scores.assign(rps_2=np.nan)
    damaged["rps_1"] = np.nan
    with pytest.raises(ValueError, match="rps is not finite in some rows"):
        contribution_summary(damaged, by="threshold")


def test_by_adjective_and_procedure_keeps_their_order():
    names = [("soft", "squeeze"), ("soft", "hold"), ("hard", "squeeze")]
    tables = [
        hand_made_table().assign(adjective=adjective, procedure=procedure)
        for adjective, procedure in names
    ]
    tables[2]["emd"] *= 2
    table = pd.concat(tables)
    by = ["adjective", "procedure"]
    summary = contribution_summary(table, metric="emd", by=by)
    cells = summary[by].drop_duplicates().itertuples(index=False, name=None)
    assert list(cells) == names
    alone = contribution_summary(hand_made_table(), metric="emd")
    for i, factor in enumerate([1, 1, 2]):
        rows = summary.iloc[2 * i : 2 * i + 2]
        np.testing.assert_allclose(rows["difference"], factor * alone["difference"])
        np.testing.assert_allclose(rows["p_objects"], alone["p_objects"])


def test_order_of_rows_does_not_matter(scores):
    shuffled = scores.sample(frac=1, random_state=0)
    by = {"metric": "rps", "by": "fold"}
    index = ["fold", "held_out"]
    expected = contribution_summary(scores, **by).set_index(index).sort_index()
    summary = contribution_summary(shuffled, **by).set_index(index).sort_index()
    pd.testing.assert_frame_equal(summary, expected)


# What it finds ------------------------------------------------------------------------


@pytest.mark.parametrize("metric", ["macro_mae", "rps"])
def test_holdouts_find_the_sensor_that_tells_and_no_other(scores, metric):
    """One sensor alone carries the adjective."""
    summary = contribution_summary(scores, metric=metric).set_index("held_out")
    assert summary.loc["pac", "difference"] > 0.05
    assert summary.loc["pac", "p_objects"] < 0.05
    useless = summary.drop(index="pac")
    assert (useless["p_objects"] > 0.05).all()
    assert useless["difference"].abs().max() < summary.loc["pac", "difference"] / 10


@pytest.mark.parametrize("odd_one", range(8))
def test_objects_that_only_rounding_tells_apart_have_one_rank(odd_one):
    """Whichever object is the one that gains."""
    harm = np.full(8, 0.1)
    harm[odd_one] = -0.1
    rows = [
        {
            "held_out": held_out,
            "start": start,
            "fold": 0,
            "object": i,
            "trial": i,
            "emd": 0.3 + 0.01 * i + harm[i] * (held_out != "none"),
        }
        for held_out in ("none", "pac")
        for start in (0, 1)
        for i in range(8)
    ]
    (p,) = contribution_summary(pd.DataFrame(rows), metric="emd")["p_objects"]
    assert p == wilcoxon(np.r_[np.ones(7), -1], alternative="greater").pvalue
