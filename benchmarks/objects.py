"""How many objects does a model need? RPS minus that of the marginal, by objects.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/objects.py FOLDER \
        FILE.png [--seeds 10]

Generated slow slides (pac and pdc, three of each object) are rated on three adjectives
that can be felt, and again with the ratings permuted over objects; of films there are
three noisy copies of each, rated by twelve people or by three. Forty or three hundred
other objects are predicted. Errors are over seeds. Three minutes.
"""

import data
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from measure import command, head, plus_minus, row, standard_error

from sklearn_haptic import DummyDistribution, make_haptic_pipeline
from sklearn_haptic.metrics import ranked_probability_score as score

N_OBJECTS = 5, 10, 20, 40, 80
SLIDES, RATERS = ("generated slides", "the same, permuted"), (12, 3)
FILMS = [f"films, {n} raters" for n in RATERS]


def gain(A, y, B, y_test, groups):
    """RPS of the default minus that of the marginal."""
    model = make_haptic_pipeline(random_state=0)[-1].fit(A, y, groups=groups)
    guess = DummyDistribution().fit(A, y)
    return np.subtract(*(score(y_test, m.predict_proba(B)) for m in (model, guess)))


def slides(rng, seed):
    """Yield the curve, the number of objects, and the gain."""
    trials, targets, objects, _, _ = data.generated(None, "slow_slide", seed, 120, 3)
    trials, which = trials[["pac", "pdc"]], np.unique(objects, return_inverse=True)[1]
    place, first = rng.permutation(120)[which], np.unique(which, return_index=True)[1]
    other, test = first[rng.permutation(120)][which], place >= 80
    for n in N_OBJECTS:
        train = place < n
        features = make_haptic_pipeline(list(trials), random_state=0)[:-1]
        A, B = features.fit_transform(trials[train]), features.transform(trials[test])
        for y in map(targets.get, ("hard", "smooth", "cold")):
            for curve, each in zip(SLIDES, (y, y[other])):
                yield curve, n, gain(A, each[train], B, each[test], place[train])


def films(rng, X, stars):
    """The same, of films with three noisy copies."""
    drawn = rng.permutation(len(X))[: 300 + max(N_OBJECTS)]
    shares = stars[drawn] / stars[drawn].sum(axis=1, keepdims=True)
    noisy = X[drawn] + rng.normal(0, 0.5, (3, len(drawn), X.shape[1]))
    for n in N_OBJECTS:
        rows, groups = noisy[:, 300 : 300 + n].reshape(3 * n, -1), np.tile(range(n), 3)
        for curve, raters in zip(FILMS, RATERS):
            y = rng.multinomial(raters, shares[300:])[groups].astype(float)
            yield curve, n, gain(rows, y, noisy[0, :300], shares[:300], groups)


def main():
    parser = command(__doc__, folder=True)
    parser.add_argument("file", help="of the figure")
    parser.add_argument("--seeds", type=int, default=10)
    arguments, table = parser.parse_args(), []
    found = data.films(arguments.folder, None)
    X, stars = found.given.fit_transform(found.trials), found.targets["stars"]
    for seed in range(arguments.seeds):
        rng = np.random.default_rng(seed)
        for part in (slides(rng, seed), films(rng, X, stars)):
            table += [(seed, *each) for each in part]
    table = pd.DataFrame(table).pivot_table(3, [1, 0], 2)  # curves and seeds, objects
    at = [f"{n} objects" for n in N_OBJECTS]
    head("RPS minus that of the marginal", *at)
    figure, ax = plt.subplots(figsize=(5.6, 3.6), layout="constrained")
    for name, form in zip((*SLIDES, *FILMS), ("o-", "s-", "^--", "v--")):
        each = table.loc[name].to_numpy()
        row(name, *(plus_minus(gains, 3) for gains in each.T))
        ax.errorbar(at, each.mean(0), 2 * standard_error(each), fmt=form, label=name)
    ax.axhline(0, color="black", lw=0.8)
    ax.set_ylabel("RPS minus that of guessing")
    ax.legend(frameon=False)
    figure.savefig(arguments.file, dpi=110)


if __name__ == "__main__":
    main()
