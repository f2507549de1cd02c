"""Seconds and memory that linear models of ratings take to learn, by number of touches.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/linear_models.py

Generated float32 features whose variances fall as those of codes and spectra of touches
do, and the ratings of twelve people. "24 at once" are four penalties times all touches
and five folds; "default" is the model of `make_haptic_pipeline`, and "linear_members"
the same without its trees. "off by" is the largest difference of a probability at any
position to a fit of float64 features to a tolerance of 1e-9. LogisticRegression learns
the most frequent rating of a touch with the same penalty. Processor time; the largest
memory is that of a process of its own, with the features. Pass numbers of touches to
measure fewer.
"""

import resource
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from measure import command, head, machine, row, timed
from sklearn.linear_model import LogisticRegression

from sklearn_haptic import (
    NNPOM,
    DistributionalOrdinalRegressor,
    make_haptic_pipeline,
)
from sklearn_haptic.models._linear_models import fit_linear_models

N_FEATURES, N_AXES = 16_584, 500
ALPHAS = (1, 3, 10, 30)
POSITIONS = np.array([-2.0, 0.0, 2.0])


def touches(n_touches):
    """Features of a total variance of 1, and counts of five levels."""
    rng = np.random.default_rng(0)
    axes = rng.standard_normal((N_AXES, N_FEATURES), np.float32)
    variance = np.arange(1, N_AXES + 1) ** -1.4
    axes *= np.sqrt(0.9 * variance / variance.sum() / N_FEATURES)[:, None]
    X = np.empty((n_touches, N_FEATURES), np.float32)
    latent = np.empty(n_touches)
    felt = rng.normal(size=N_AXES) * np.arange(1, N_AXES + 1) ** -0.3
    for start in range(0, n_touches, 1000):
        rows = slice(start, start + 1000)
        factors = rng.standard_normal((len(X[rows]), N_AXES), np.float32)
        X[rows] = factors @ axes
        noise = rng.standard_normal(X[rows].shape, np.float32)
        X[rows] += np.sqrt(0.1 / N_FEATURES) * noise
        latent[rows] = factors @ (felt * np.sqrt(variance))
    latent *= 1.5 / latent.std()
    ratings = latent[:, None] + rng.logistic(size=(n_touches, 12))
    level = np.digitize(ratings, [-2, -0.5, 0.5, 2])
    return X, (level[:, :, None] == np.arange(5)).sum(axis=1), level[:, 0]


def linear(alpha=3.0, tol=1e-4):
    return DistributionalOrdinalRegressor(NNPOM(0, alpha, tol=tol))


def one(X, counts, level):
    return linear().fit(X, counts)


def many(X, counts, level):
    folds = np.arange(len(X)) % 5 != np.arange(6)[:, None]
    models = [linear(alpha) for alpha in ALPHAS for _ in folds]
    weights = np.tile(1.0 * folds, (len(ALPHAS), 1))
    return fit_linear_models(models, X, counts, weights, np.arange(1, 6))


def default(X, counts, level):
    return make_haptic_pipeline(random_state=0)[-1].fit(X, counts)


def linear_members(X, counts, level):
    model = make_haptic_pipeline(random_state=0)[-1]
    return model.set_params(estimators=model.estimators[:2]).fit(X, counts)


def logistic(X, counts, level):
    return LogisticRegression(C=15 / 3, max_iter=1000).fit(X, counts.argmax(axis=1))


def measured(fit, n_touches, exact=False):
    """Seconds, GB and, if asked for, the distance to the optimum."""
    data = touches(n_touches)
    seconds, model = timed(fit, *data)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    if not exact:
        return seconds, memory, np.nan
    X, counts, _ = data
    optimum = linear(tol=1e-9).fit(X.astype(np.float64), counts)
    proba = [
        each.estimator_.predict_proba_with_positions(X, POSITIONS)
        for each in (model, optimum)
    ]
    return seconds, memory, np.abs(np.subtract(*proba)).max()


def main():
    parser = command(__doc__)
    sizes = [100, 500, 2000, 5000, 10_000, 20_000]
    parser.add_argument("n_touches", type=int, nargs="*", default=sizes)
    sizes = parser.parse_args().n_touches
    machine()
    head("model", "touches", "seconds", "GB", "off by")
    most = {one: 20_000, many: 20_000, linear_members: 20_000, default: 20_000}
    for fit, n_most in (most | {logistic: 2000}).items():
        for n in [size for size in sizes if size <= n_most]:
            exact = fit is one and n <= 5000
            context = get_context("spawn")
            with ProcessPoolExecutor(1, mp_context=context) as process:
                taken = process.submit(measured, fit, n, exact).result()
            row(
                fit.__name__,
                f"{n:,}",
                *map("{:{}}".format, taken, (".2f", ".1f", ".0e")),
            )


if __name__ == "__main__":
    main()
