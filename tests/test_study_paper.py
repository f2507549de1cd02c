"""The paper's study, done again by hand, and the tables that compare its networks."""

import re
from functools import partial
from itertools import product

import joblib
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import friedmanchisquare, wilcoxon
from sklearn.base import clone
from sklearn.frozen import FrozenEstimator
from sklearn.utils import Bunch

from sklearn_haptic import (
    PAPER_2020,
    DistributionalOrdinalRegressor,
    KSVDTransformer,
    SensorFusionNNPOM,
    metrics,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.study import compare_networks, read_study, run_study, score_table
from sklearn_haptic.study._store import read_settings, read_unit
from sklearn_haptic.study._study import derive_seed

pytestmark = pytest.mark.slow

SENSORS = ["pdc", "tdc"]
CELLS = {"squeeze": (16, 8, 4, 2, 1), "fast_slide": (8, 4, 2, 1)}
WINDOWED = {"pdc": 25, "tdc": 10}  # atoms
GRID = list(product([1, 3], [0.1, 1.0]))
P = np.arange(1, 100) / 100
CORPUS = partial(make_haptic_corpus, 10, 3, random_state=0)
SETTINGS = {
    "protocol": "paper",
    "adjectives": ["hard", "cold"],
    "procedures": ["squeeze", "fast_slide"],
    "sensors": SENSORS,
    "n_hidden": [1, 3],
    "alpha": [0.1, 1.0],
    "n_starts": 2,
    "verbose": False,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a finished study; not to be changed."""
    folder = tmp_path_factory.mktemp("paper")
    run_study(CORPUS, folder, **SETTINGS)
    return folder


def macro_error(counts, ratings):
    """Equation 3 by loops: the error of each trial, from 99 ratings as predicted."""
    errors = []
    for count, of_trial in zip(counts, ratings):
        by_level = {}
        for i in range(1, 100):
            true = 1 + np.searchsorted(np.cumsum(count) * 100, i * count.sum())
            by_level.setdefault(true, []).append(abs(true - of_trial[i - 1]))
        errors.append(np.mean([np.mean(each) for each in by_level.values()]))
    return errors


def test_the_papers_features(folder):
    """Levels by procedure, K-SVD with exact update, means kept, nothing rescaled."""
    for procedure, sensor in product(CELLS, SENSORS):
        features = read_unit(folder, ("features", procedure, sensor))[0]
        trials = list(CORPUS(procedure=procedure, sensors=[sensor]).trials[sensor])
        coder = KSVDTransformer(
            WINDOWED[sensor],
            window=50,
            max_iter=0,
            remove_mean=False,
            dict_init=features["dictionary"],
        )
        codes = coder.fit(trials).transform(trials)
        for i, row in enumerate(features["features"]):
            pooled = []
            for n in CELLS[procedure]:
                for cell in range(n):
                    n_windows = len(codes[i])
                    first, last = cell * n_windows // n, (cell + 1) * n_windows // n
                    if n > n_windows:  # a window and its neighbours
                        middle = (2 * cell + 1) * n_windows // (2 * n)
                        first, last = max(middle - 1, 0), middle + 2
                    pooled.append(codes[i][first:last].max(axis=0))
            assert_allclose(row, np.concatenate(pooled), rtol=1e-4, atol=1e-2)


def test_the_papers_dictionaries_are_exact(folder, tmp_path):
    settings = SETTINGS | {"adjectives": ["hard"], "procedures": ["squeeze"]}
    run_study(CORPUS, tmp_path, **settings | {"update": "approximate"})
    exact, approximate = (
        read_unit(each, ("features", "squeeze", "tdc"))[0]["dictionary"]
        for each in (folder, tmp_path)
    )
    assert not np.allclose(exact, approximate)
    stored = read_settings(folder)
    assert (stored["update"], stored["standardise"]) == ("exact", False)
    assert stored["split"] == "paper"
    assert stored["scoring"] == joblib.hash(metrics.neg_macro_mae_scorer)


@pytest.mark.parametrize("adjective", ["hard", "cold"])
def test_the_papers_study_by_hand(folder, adjective):
    """Split, grid, choice by the macro-averaged error, starts, holdouts, scores."""
    study = read_study(folder)
    corpus = CORPUS(procedure="squeeze", sensors=["tdc"])
    y, objects = corpus.ratings[adjective], corpus.objects
    mine = study.scores.query("procedure == 'squeeze' and adjective == @adjective")
    singly = study.networks.query("procedure == 'squeeze' and adjective == @adjective")
    chosen = study.choices.query("procedure == 'squeeze' and adjective == @adjective")
    chosen = chosen.set_index("network")

    # 80 %, 10 % and 10 % of the objects, at random for the adjective.
    rng = np.random.RandomState(derive_seed(0, "split", adjective))
    names = np.unique(objects)
    test = np.isin(objects, rng.permutation(names)[:1])
    rest = np.unique(objects[~test])
    validation = np.isin(objects, rng.permutation(rest)[:1])
    train = ~test & ~validation
    assert set(mine["object"]) == set(objects[test])

    def fitted(estimator, X, *name):
        model = DistributionalOrdinalRegressor(
            **PAPER_2020 | {"estimator": estimator},
            random_state=derive_seed(0, "squeeze", adjective, 0, *name),
        )
        return model.fit(X[train], y[train], X_val=X[validation], y_val=y[validation])

    def network(n_hidden, alpha):
        network = clone(PAPER_2020["estimator"])
        return network.set_params(n_hidden=n_hidden, alpha=alpha)

    def search(make, X, name):
        best = None
        for n_hidden, alpha in GRID:
            model = fitted(make(n_hidden, alpha), X, name, n_hidden, alpha)
            ratings = model.predict_rating(X[validation], P)
            error = np.mean(macro_error(y[validation], ratings))
            if best is None or error < best[0] - 1e-12:
                best = error, n_hidden, alpha, model
        error, n_hidden, alpha, model = best
        row = chosen.loc[name]
        assert (row["n_hidden"], row["alpha"]) == (n_hidden, alpha)
        assert row["score"] == pytest.approx(-error, abs=1e-10)
        return model

    blocks, frozen, columns, at = [], {}, {}, 0
    for sensor in SENSORS:
        X = read_unit(folder, ("features", "squeeze", sensor))[0]["features"]
        X = X.astype(float)
        model = search(network, X, sensor)
        frozen[sensor] = FrozenEstimator(model.estimator_)
        blocks.append(X)
        columns[sensor] = slice(at, at + X.shape[1])
        at += X.shape[1]
        rows = singly[singly["network"] == sensor]
        proba = model.predict_proba(X[test])
        assert_allclose(rows.filter(like="proba_"), proba, atol=1e-10)
        ratings = model.predict_rating(X[test], P)
        assert_allclose(rows["macro_mae"], macro_error(y[test], ratings), atol=1e-10)
    X = np.hstack(blocks)
    search(
        lambda *size: SensorFusionNNPOM(columns, frozen, network(*size)), X, "combined"
    )
    size = chosen.loc["combined", ["n_hidden", "alpha"]]
    final = network(int(size["n_hidden"]), float(size["alpha"]))
    for start, held_out in product(range(2), (None, *SENSORS)):
        fusion = SensorFusionNNPOM(columns, frozen, final, held_out=held_out)
        model = fitted(fusion, X, "start", start)
        proba, ratings = model.predict_proba(X[test]), model.predict_rating(X[test], P)
        rows = mine[
            (mine["start"] == start) & (mine["held_out"] == (held_out or "none"))
        ]
        assert_allclose(rows.filter(like="proba_"), proba, atol=1e-10)
        assert_allclose(rows["macro_mae"], macro_error(y[test], ratings), atol=1e-10)


def test_score_table_of_counts_that_are_not_whole(folder):
    study = read_study(folder)
    columns = [c for c in study.scores if re.fullmatch(r"count_\d+", c)]
    study.scores[columns] = study.scores[columns] / 3 + 1
    assert score_table(study, metric="emd")["ceiling"].isna().all()
    assert score_table(study, metric="rps")["ceiling"].notna().all()


def test_score_table(folder):
    study = read_study(folder)
    table = score_table(study, metric="rps")
    guesses = ["marginal", "barycentre"]
    assert [*table][: 1 + len(SENSORS)] == ["combined", *SENSORS]
    assert {*table} == {
        *("combined", *SENSORS, *guesses, "ceiling", "truth", "no_better")
    }
    for (adjective, procedure), row in table.iterrows():
        corpus = CORPUS(procedure=procedure, sensors=["tdc"])
        rows = study.networks.query(
            "adjective == @adjective and procedure == @procedure "
            "and network == 'combined'"
        )
        assert row["combined"] == pytest.approx(rows["rps"].mean())
        test = np.isin(corpus.objects, rows["object"])
        truth = metrics.ranked_probability_score(
            corpus.ratings[adjective][test], corpus.true_proba[adjective][test]
        )
        assert row["truth"] == pytest.approx(truth)
        counts = corpus.ratings[adjective][test]
        n = counts.sum(axis=1, keepdims=True)
        below = np.cumsum(counts, axis=1) / n
        ceiling = (n[:, 0] / (n[:, 0] - 1) * (below * (1 - below)).sum(axis=1)).mean()
        assert row["ceiling"] == pytest.approx(ceiling)
        assert row["no_better"] == (row["combined"] >= row[guesses].min())


def test_the_ceiling_of_touches_rated_one_by_one(folder):
    study = read_study(folder)
    full = study.scores[study.scores["held_out"] == "none"].filter(regex="^count_[0-9]")
    own = np.random.default_rng(0).integers(1, 9, size=full.shape)
    study.scores.loc[full.index, full.columns] = own
    for cell, row in score_table(study, metric="rps").iterrows():
        place = study.scores.loc[full.index, ["adjective", "procedure"]] == [*cell]
        counts = own[place.all(axis=1)]
        n = counts.sum(axis=1)
        below = np.cumsum(counts, axis=1) / n[:, np.newaxis]
        expected = (n / (n - 1) * (below * (1 - below)).sum(axis=1)).mean()
        assert row["ceiling"] == pytest.approx(expected)


@pytest.fixture(scope="module")
def kfold(tmp_path_factory):
    settings = SETTINGS | {"protocol": "default", "n_splits": 3, "n_repeats": 1}
    settings |= {"procedures": ["squeeze", "hold", "fast_slide"], "n_hidden": [1]}
    return run_study(CORPUS, tmp_path_factory.mktemp("kfold"), **settings)


def test_sensors_compared_by_hand(kfold):
    comparison = compare_networks(kfold, by="adjective").set_index(
        ["adjective", "network"]
    )
    for (adjective, sensor), row in comparison.iterrows():
        single, combined = (
            kfold.networks.set_index(["adjective", "network"])
            .sort_index()
            .loc[(adjective, name)]
            .groupby("object")["macro_mae"]
            .mean()
            for name in (sensor, "combined")
        )
        assert row["n_objects"] == 10
        assert row["difference"] == pytest.approx((single - combined).mean())
        assert row["p_objects"] == pytest.approx(wilcoxon(single - combined).pvalue)


def test_sensors_whose_scores_are_infinite_differ_by_no_number(kfold):
    scores = kfold.networks.assign(log_score=np.inf)
    study = Bunch(**kfold | {"networks": scores})
    found = compare_networks(study, metric="log_score")
    assert found["single"].eq(np.inf).all()
    assert found["difference"].isna().all()
    first = scores["object"] != scores["object"].iloc[0]
    study["networks"] = scores.assign(log_score=scores["log_score"].mask(first, 1.0))
    assert compare_networks(study, metric="log_score")["difference"].isna().all()


def test_no_score_is_no_better_than_guessing(kfold):
    study = Bunch(**kfold | {"networks": kfold.networks.assign(rps=np.nan)})
    assert score_table(study, metric="rps")["no_better"].all()


def test_procedures_compared_by_hand(kfold):
    comparison = compare_networks(
        kfold, "procedures", metric="rps", by="adjective"
    ).set_index("adjective")
    full = kfold.scores.query("held_out == 'none'")
    for adjective, row in comparison.iterrows():
        cell = full[full["adjective"] == adjective]
        of_procedure = dict(iter(cell.groupby("procedure")))
        columns = [
            of_procedure[name].groupby("object")["rps"].mean()
            for name in ("squeeze", "hold", "fast_slide")
        ]
        assert row["squeeze"] == pytest.approx(columns[0].mean())
        result = friedmanchisquare(*columns)
        assert row["statistic"] == pytest.approx(result.statistic)
        assert row["p_objects"] == pytest.approx(result.pvalue)
    assert len(compare_networks(kfold, "procedures")) == 1


def test_objects_on_which_two_procedures_are_equal_are_left_out():
    """So that p is exact: of 20 differences of one sign, 2 / 2**20."""
    cell = {"adjective": "hard", "fold": 0, "held_out": "none"}
    rows = [
        {"procedure": name, "object": i, "trial": i, "rps": more * max(i - 9.0, 0)}
        for more, name in enumerate(["hold", "slide"])
        for i in range(30)
    ]
    study = Bunch(scores=pd.DataFrame(rows).assign(proba_1=1, **cell))
    found = compare_networks(study, "procedures", metric="rps")
    assert found.loc[0, "n_objects"] == 30
    assert found.loc[0, "p_objects"] == pytest.approx(2**-19)


def test_guesses_are_means_over_the_trials_of_folds_of_any_size(kfold):
    """Three folds of ten objects test four, three and three."""
    table = score_table(kfold, metric="rps")
    combined = kfold.networks.query("network == 'combined'")
    baselines = kfold.baselines.set_index(["adjective", "procedure", "strategy"])
    for cell, trials in combined.groupby(["adjective", "procedure"]):
        counts = trials.filter(regex=r"^count_\d+$").to_numpy()
        for strategy in ("marginal", "barycentre"):
            guesses = baselines.sort_index().loc[[(*cell, strategy)]].set_index("fold")
            proba = guesses.loc[trials["fold"]].filter(regex="^proba_").to_numpy()
            rps = metrics.ranked_probability_score(counts, proba)
            assert table.loc[cell, strategy] == pytest.approx(rps)


def test_a_procedure_that_lacks_an_adjective(kfold):
    """Only adjectives that all procedures have are compared."""
    scores = kfold.scores
    lacks = (scores["procedure"] == "hold") & (scores["adjective"] == "cold")
    study = Bunch(**kfold | {"scores": scores[~lacks]})
    found = compare_networks(study, "procedures", metric="rps")
    hard = scores[scores["adjective"] == "hard"]
    expected = Bunch(**kfold | {"scores": hard})
    expected = compare_networks(expected, "procedures", metric="rps")
    pd.testing.assert_frame_equal(found, expected)


def test_the_ceiling_of_adjectives_that_differ_in_levels(kfold):
    scores = kfold.scores.copy()
    cold = scores["adjective"] == "cold"
    scores.loc[cold, "count_4"] += scores.loc[cold, "count_5"]
    scores.loc[cold, "count_5"] = np.nan
    table = score_table(Bunch(**kfold | {"scores": scores}), metric="rps")
    counts = scores[cold & (scores["procedure"] == "hold")].query("held_out == 'none'")
    counts = counts.filter(regex="^count_[1-4]$")
    ceiling = metrics.noise_ceiling(counts.to_numpy()).truth
    assert table.loc[("cold", "hold"), "ceiling"] == pytest.approx(ceiling)


def test_dictionaries_of_training_objects(tmp_path):
    """Recordings of other objects do not change them; those of the default do."""
    settings = SETTINGS | {"adjectives": ["hard"], "procedures": ["squeeze"]}
    settings |= {"sensors": ["tdc"], "alpha": [1.0], "n_starts": 1}
    study = run_study(CORPUS, tmp_path / "all", **settings)
    tested = study.scores["object"].unique()

    def learned(corpus, dictionaries, *fold):
        folder = tmp_path / f"{dictionaries} {id(corpus)}"
        run_study(corpus, folder, **settings | {"dictionaries": dictionaries})
        unit = "features", "squeeze", "tdc", *fold
        return read_unit(folder, unit)[0]["dictionary"]

    corpus = {"squeeze": CORPUS(procedure="squeeze")}
    changed = {"squeeze": Bunch(**corpus["squeeze"])}
    trials = corpus["squeeze"].trials.copy()
    of_test = np.isin(corpus["squeeze"].objects, tested)
    trials["tdc"] = [
        x + np.sin(np.arange(len(x)))[:, None] * 50 if test else x
        for x, test in zip(trials["tdc"], of_test)
    ]
    changed["squeeze"].trials = trials
    fold = "hard", 0
    one = learned(corpus, "training objects", *fold)
    assert_array_equal(learned(changed, "training objects", *fold), one)
    one = learned(corpus, "all objects")
    assert not np.allclose(learned(changed, "all objects"), one)


def test_corpus_in_memory_is_that_of_a_function(tmp_path):
    settings = SETTINGS | {"protocol": "default", "split": "paper"}
    settings |= {"n_hidden": [1], "alpha": [1.0]}
    expected = run_study(CORPUS, tmp_path / "function", **settings)
    corpus = {p: dict(CORPUS(procedure=p)) for p in settings["procedures"]}
    study = run_study(corpus, tmp_path / "memory", n_jobs=2, **settings)
    for name in ("scores", "networks", "choices", "baselines", "truth"):
        pd.testing.assert_frame_equal(study[name], expected[name], check_exact=True)


def test_any_procedures_and_sensors(tmp_path):
    rng = np.random.default_rng(0)
    objects = np.repeat(["cork", "felt", "foam", "wool"], 3)
    trials = {
        "my_mic": [rng.normal(size=(rng.integers(60, 90), 2)) for _ in objects],
        "skin": [rng.normal(size=(9, 4, 5)) for _ in objects],
    }
    columns = {
        name: pd.Series(list(each), dtype=object) for name, each in trials.items()
    }
    touches = {
        "trials": pd.DataFrame(columns),
        "objects": objects,
        "ratings": {"itchy": rng.integers(1, 5, size=(12, 4))},
    }
    settings = {"n_hidden": [1], "alpha": [1.0], "n_starts": 1, "split": "paper"}
    study = run_study({"stroke it": touches}, tmp_path / "a", verbose=False, **settings)
    table = score_table(study)
    assert [*table][:3] == ["combined", "my_mic", "skin"]
    assert table["ceiling"].isna().all()  # one object is tested
    assert study.truth.empty
    sensors = {"my_mic": KSVDTransformer(5, window=8)}
    run_study(
        {"stroke it": touches},
        tmp_path / "b",
        sensors=sensors,
        verbose=False,
        **settings,
    )
    arrays, _ = read_unit(tmp_path / "b", ("features", "stroke it", "my_mic"))
    assert arrays["dictionary"].shape == (5, 8)
    with pytest.raises(ValueError, match="holds a study with coders="):
        run_study(
            {"stroke it": touches}, tmp_path / "b", sensors=["my_mic"], **settings
        )
