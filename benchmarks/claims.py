r"""Do the statistics of reports keep their word? Each claim, simulated.

    python benchmarks/claims.py \
        --parts interval ceiling raters slips report classes contributions

interval       share of 95% intervals of `model_report` that hold the true gain
ceiling        bias of `noise_ceiling`
raters         false alarms of `outlying_raters`, and careless people found
slips          false alarms where people slip, or adjectives go together
report         adjectives that cannot be felt: verdicts of `model_report`
classes        classes that cannot be felt: verdicts of `model_report`
contributions  sensors that tell nothing: p-values of `contribution_summary`

Brackets hold standard errors over repetitions.
"""

import warnings
from itertools import product

import numpy as np
from measure import command, head, machine, plus_minus, row
from scipy.stats import entropy
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import KFold
from sklearn.neighbors import KNeighborsClassifier

from sklearn_haptic import (
    DistributionalOrdinalRegressor,
    DummyDistribution,
    SensorFusionNNPOM,
    make_haptic_pipeline,
)
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    log_score,
    neg_rps_scorer,
    noise_ceiling,
    ranked_probability_score,
)
from sklearn_haptic.model_selection import (
    contribution_summary,
    model_report,
    sensor_contributions,
)
from sklearn_haptic.model_selection._model_report import gain_over_objects
from sklearn_haptic.ratings import outlying_raters

CUTS = -1.2, -0.4, 0.4, 1.2  # between five levels of what is felt


def interval(n_repeats):
    """Gains of objects that are normal or skew, of equally many touches or not."""
    head("objects", "gains", "touches alike", "1 to 8 touches", title="Coverage")
    rng = np.random.default_rng(0)
    gains = {"normal": (lambda z: z, 0.0), "skew": (lambda z: z - 0.4 * z**2, -0.4)}
    for n_objects in (4, 6, 12, 24):
        for name, (gain, truth) in gains.items():
            held = np.empty((2, 20 * n_repeats))
            for unequal, each in np.ndindex(held.shape):
                low, high = (1, 9) if unequal else (3, 4)
                touches = rng.integers(low, high, n_objects)
                objects = np.repeat(np.arange(n_objects), touches)
                of_objects = gain(rng.normal(size=n_objects))[objects]
                found = gain_over_objects(
                    of_objects + 0.5 * rng.normal(size=len(objects)), objects
                )
                held[unequal, each] = found["lower"] < truth < found["upper"]
            shown = [plus_minus(each, 3, sign="") for each in held]
            row(n_objects, name, *shown)

    title = "Coverage where folds share training objects, and what is above and below"
    head("objects", "touches", "held", "above", "below", title=title)
    model = DistributionalOrdinalRegressor()
    X_new, y_new, _ = felt_objects(rng, 3000, 3, 4)
    for n_objects, (low, high) in product((12, 20, 40), ((3, 4), (1, 9))):
        sides = []
        for _ in range(n_repeats):
            X, y, objects = felt_objects(rng, n_objects, low, high)
            found = model_report(model, X, y, groups=objects).gains.iloc[0]
            models = model, DummyDistribution()
            gain = np.subtract(
                *(neg_rps_scorer(m.fit(X, y), X_new, y_new) for m in models)
            )
            sides.append((gain > found["upper"], gain < found["lower"]))
        above, below = np.transpose(sides)
        shown = [plus_minus(a, 3, sign="") for a in (~(above | below), above, below)]
        row(n_objects, f"{low} to {high - 1}", *shown)


def felt_objects(rng, n_objects, low, high):
    """Noisy touches, counts of what fifteen people felt, and the objects."""
    felt = rng.normal(size=n_objects)
    objects = np.repeat(np.arange(n_objects), rng.integers(low, high, n_objects))
    X = rng.normal(size=(len(objects), 4))
    X[:, 0] = felt[objects] + 0.6 * X[:, 0]
    levels = np.digitize(felt[:, None] + 0.6 * rng.normal(size=(n_objects, 15)), CUTS)
    counts = np.stack([(levels == k).sum(axis=1) for k in range(5)], axis=1)
    return X, counts[objects], objects


def ceiling(n_repeats):
    """Crowds of few people from populations that agree much or little."""
    head("people", "agreement", "RPS", "log score", title="Bias of the ceiling, %")
    rng = np.random.default_rng(0)
    for n_people in (2, 3, 4, 5, 8, 12):
        for name, concentration in [("much", 0.15), ("little", 1.0), ("none", 10.0)]:
            bias = []
            for _ in range(n_repeats):
                truth = rng.dirichlet(np.full(5, concentration), size=500)
                counts = rng.multinomial(n_people, truth)
                below = np.cumsum(truth, axis=1)
                expected = (below * (1 - below)).sum(axis=1), entropy(truth, axis=1)
                scores = ranked_probability_score, log_score
                found = [noise_ceiling(counts, score).truth for score in scores]
                bias.append(100 * (found / np.mean(expected, axis=1) - 1))
            row(n_people, name, *(plus_minus(each, 1) for each in np.transpose(bias)))


def raters(n_repeats):
    """Honest people differ in shift, spread and care; one or three may be careless."""
    columns = ("false alarm", "one at random", "three at random", "one reversed")
    known = "objects", "people", "rated", "adjectives", "habits", "care"
    head(*known, *columns, title="Raters called outlying")
    rng = np.random.default_rng(0)
    designs = [(20, 12, 20), (60, 12, 60), (20, 36, 20), (30, 60, 5), (20, 100, 10)]
    designs = [(*each, 3) for each in designs] + [(20, 12, 20, 1), (20, 100, 10, 1)]
    for n_objects, n_people, n_rated, n_adjectives in designs:
        for habit, care in [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 0.3)]:
            found = np.empty((4, n_repeats))
            for kind, each in np.ndindex(found.shape):
                felt = 1.2 * rng.normal(size=(n_objects, 1, n_adjectives))
                noise = 0.8 * np.exp(care * rng.normal(size=(1, n_people, 1)))
                shape = n_objects, n_people, n_adjectives
                felt = felt + noise * rng.normal(size=shape)
                shift, spread = habit * rng.normal(size=(2, 1, *shape[1:]))
                answers = 3 + np.exp(0.4 * spread) * felt + 0.6 * shift
                answers = np.clip(np.rint(answers), 1, 5)
                careless = [0, 1, 3, 1][kind]
                theirs = answers[:, :careless]
                random = kind != 3  # or reversed
                theirs[:] = rng.integers(1, 6, theirs.shape) if random else 6 - theirs
                objects, people = map(np.ravel, np.indices((n_objects, n_people)))
                order = rng.random((n_objects, n_people)).argsort(axis=0)
                answers[order >= n_rated] = np.nan
                answers = answers.reshape(-1, n_adjectives)
                called = outlying_raters(answers, objects, people)
                called = called["outlying"].to_numpy()
                found[kind, each] = called[:careless].mean() if kind else called.any()
            shown = [plus_minus(each, 2, sign="") for each in found]
            row(n_objects, n_people, n_rated, n_adjectives, habit, care, *shown)

    head("levels", "share of the lowest", "false alarm", title="Answers at an end")
    designs = {5: [(-2, -0.7, 0.7, 2), (1, 1.7, 2.4, 3.1)], 2: [(0,), (1.4,)]}
    for n_levels, each in designs.items():
        for cuts in each:
            alarms, lowest = [], []
            for _ in range(n_repeats):
                place = 0.5 * rng.normal(size=(36, 1, 1))
                felt = rng.normal(size=(1, 60, 5)) + rng.normal(size=(36, 60, 5))
                answers = np.digitize(felt + place, cuts).reshape(-1, 5)
                people, objects = map(np.ravel, np.indices((36, 60)))
                called = outlying_raters(answers, objects, people)["outlying"]
                alarms.append(called.any())
                lowest.append(np.mean(answers == 0))
            row(n_levels, f"{np.mean(lowest):.2f}", plus_minus(alarms, 2, sign=""))


def slips(n_repeats):
    """Sliders of people who all slip alike; or ten adjectives that go together."""
    title = "Raters called outlying where all are alike"
    head("adjectives", "slips", "noise", "together", "false alarm", title=title)
    rng = np.random.default_rng(0)
    people, objects = map(np.ravel, np.indices((20, 16)))

    def drawn(n_people, n, together):
        own, common = (rng.normal(size=(n_people, 16, each)) for each in (n, 1))
        return np.sqrt(1 - together) * own + np.sqrt(together) * common

    designs = [(3, *each, 0.0) for each in product((0.0, 0.02, 0.05), (5, 10, 15))]
    designs += [(10, 0.0, 18, together) for together in (0.0, 0.5, 0.8)]
    for n, slip, noise, together in designs:
        alarms = []
        for _ in range(n_repeats):
            felt = 50 + 18 * drawn(1, n, together) + noise * drawn(20, n, together)
            answers = np.clip(felt, 0, 100)
            at_random = rng.uniform(0, 100, answers.shape)
            answers = np.where(rng.random(answers.shape) < slip, at_random, answers)
            called = outlying_raters(answers.reshape(-1, n), objects, people)
            alarms.append(called["outlying"].any())
        row(n, slip, noise, together, plus_minus(alarms, 2, sign=""))


def report(n_repeats):
    """Ratings of generated objects, permuted over the objects; noise for features."""
    title = "Verdicts of permuted ratings"
    head("objects", "better", "worse", "dispersion", title=title)
    for n_objects in (20, 40):
        verdicts, dispersions = [], []
        for seed in range(max(n_repeats // 40, 2)):
            corpus = make_haptic_corpus(
                n_objects, 2, "slow_slide", sensors=["pac", "pdc"], random_state=seed
            )
            model = make_haptic_pipeline(["pac", "pdc"], random_state=0)
            features = model[:-1].fit_transform(corpus.trials)
            _, first, which = np.unique(
                corpus.objects, return_index=True, return_inverse=True
            )
            rng = np.random.default_rng(seed)
            permuted = {
                name: y[rng.permutation(first)[which]]
                for name, y in corpus.ratings.items()
            }
            gains = model_report(
                model[-1], features, permuted, groups=corpus.objects
            ).gains
            verdicts.append(
                [np.mean(gains["verdict"] == v) for v in ("better", "worse")]
            )
            dispersions.append(gains["dispersion"].mean())
        better, worse = np.transpose(verdicts)
        shown = [plus_minus(each, 2, sign="") for each in (better, worse, dispersions)]
        row(n_objects, *shown)
    title = "Verdicts of noise, by how evenly ratings are spread over five levels"
    head("objects", "spread", "better", "worse", "exponent", title=title)
    populations = {"even": np.ones(5), "one in the middle": (0.6, 1.8, 3.2, 1.8, 0.6)}
    for (name, prior), n_objects in product(populations.items(), (20, 40)):
        verdicts, exponents = [], []
        for seed in range(n_repeats):
            rng = np.random.default_rng(seed)
            objects = np.repeat(np.arange(n_objects), 2)
            X = rng.normal(size=(n_objects, 3))[objects]
            X = X + 0.2 * rng.normal(size=X.shape)
            y = rng.multinomial(12, rng.dirichlet(prior, n_objects))[objects]
            model = make_haptic_pipeline(["pac"], random_state=0)[-1]
            gains = model_report(model, X, y, groups=objects).gains
            verdicts.append([gains["verdict"].item() == v for v in ("better", "worse")])
            exponents.append(model.fit(X, y, groups=objects).exponent_)
        shown = [plus_minus(each, 2, sign="") for each in np.transpose(verdicts)]
        row(n_objects, name, *shown, plus_minus(exponents, 2, sign=""))


def classes(n_repeats):
    """Labels and features that have nothing to do with each other."""
    models = {"1 neighbour": KNeighborsClassifier(1), "logistic": LogisticRegression()}
    head("classes", "touches", "folds", *models, title="Classes of noise: better")
    rng = np.random.default_rng(0)
    for n_classes, n_each in [(2, 10), (2, 40), (5, 8), (10, 10)]:
        names = np.repeat(np.arange(n_classes), n_each).astype(str)
        runs = np.tile(np.arange(n_each), n_classes)
        designs = {
            "by run": (None, runs),
            "shuffled": (KFold(5, shuffle=True, random_state=0), None),
            "by object": (None, np.arange(len(names)) // 2),
        }
        for design, (cv, groups) in designs.items():
            better = np.empty((len(models), n_repeats))
            for (i, model), each in product(
                enumerate(models.values()), range(n_repeats)
            ):
                noise = rng.normal(size=(len(names), 3))
                report = model_report(model, noise, names, groups=groups, cv=cv)
                better[i, each] = report.gains["verdict"].item() == "better"
            shown = [plus_minus(each, 2, sign="") for each in better]
            row(n_classes, len(names), design, *shown)


def contributions(n_repeats):
    """One sensor of four tells the ratings of 24 objects."""
    head("score", "useless sensors, p < .05", "the useful one", title="Contributions")
    rng, found = np.random.default_rng(0), {"rps": [], "macro_mae": []}
    sensors = {f"useless {i}": [2 + 2 * i, 3 + 2 * i] for i in range(3)}
    fusion = SensorFusionNNPOM({"useful": [0, 1], **sensors})
    for seed in range(max(n_repeats // 10, 2)):
        X = rng.normal(size=(24, 8))
        weights = np.exp(-0.5 * (np.arange(5) - 2 - 1.5 * X[:, :1]) ** 2)
        counts = rng.multinomial(12, weights / weights.sum(axis=1, keepdims=True))
        scores = sensor_contributions(
            DistributionalOrdinalRegressor(fusion),
            *(X, counts),
            cv=3,
            n_repeats=2,
            random_state=seed,
        )
        for metric, shares in found.items():
            p = contribution_summary(scores, metric=metric).set_index("held_out")
            p = p["p_objects"] < 0.05
            shares.append([p[list(sensors)].mean(), p["useful"]])
    for metric, shares in found.items():
        row(metric, *(plus_minus(each, 3, sign="") for each in np.transpose(shares)))


PARTS = {
    function.__name__: function
    for function in (interval, ceiling, raters, slips, report, classes, contributions)
}


def main():
    parser = command(__doc__)
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    parser.add_argument("--n-repeats", type=int, default=200)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")  # of fits that are to end early
    machine()
    for part in arguments.parts:
        PARTS[part](arguments.n_repeats)


if __name__ == "__main__":
    main()
