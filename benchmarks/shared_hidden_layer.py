"""Does learning all adjectives together help? One shared hidden layer or none.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        SKLEARN_HAPTIC_SHARED=FOLDER python benchmarks/shared_hidden_layer.py \
        [--seed SEED] [--quick]

FOLDER holds ``data/phac2_static/``; without it only the synthetic corpus is used. The
seed is that of the corpus and of all folds; --quick leaves out separate networks.
The joint network has one hidden layer, whose inputs are the features of a touch and
the position p of a rater in the population; each adjective has output weights and
thresholds of its own. It is fitted to the observations of all adjectives at once.

Five folds, objects kept whole, features learnt from the training objects. In each,
hidden units and alpha are chosen by the RPS in an inner cross-validation of three folds
of training objects: for each adjective apart, or one setting for all. Scores are means
over adjectives and objects, each object in one test fold; the standard errors of
differences are those over objects, which is a little too small as the folds share
training objects. Units and alpha say how often each was chosen. Seconds are of
processor time, medians over folds: of search and fit, and of the fit alone.
"""

import argparse
import os
import time
import warnings
from collections import defaultdict
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from real_ratings import phac2
from scipy import sparse
from scipy.optimize import approx_fprime
from scipy.special import logit
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.exceptions import ConvergenceWarning
from sklearn.model_selection import GroupKFold
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import scale

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, make_haptic_pipeline
from sklearn_haptic._positions import population_quadrature, training_observations
from sklearn_haptic._proportional_odds import (
    EvenedFeatures,
    NetworkLoss,
    change_weights,
    forward,
    level_probabilities,
    thresholds_from,
    total_spread,
    unpack,
)
from sklearn_haptic._solvers import lbfgs
from sklearn_haptic.datasets import make_haptic_corpus
from sklearn_haptic.metrics import (
    earth_movers_distance,
    log_score,
    macro_mae_per_trial,
    ranked_probability_score,
)

HIDDEN = (5, 10, 20, 30)
ALPHAS = (3.0, 10.0, 30.0, 100.0)
OPTIONS = {"max_iter": 200, "tol": 1e-3}
SCORES = {
    "RPS": ranked_probability_score,
    "MAE^M": macro_mae_per_trial,
    "EMD": earth_movers_distance,
    "log score": log_score,
}


# ----------------------------------------------------------------------------------
# The joint network


def split_heads(params, n_inputs, n_hidden, n_levels):
    """Weights of the inputs, hidden biases, and each adjective's own parameters."""
    coef, bias, *_ = unpack(params, n_inputs, n_hidden)
    sizes = [n_hidden + k - 1 for k in n_levels]  # output weights and thresholds
    starts = list(accumulate(sizes, initial=coef.size + bias.size))
    return coef, bias, np.split(params, starts)[1:-1]


class SharedLoss:
    """Penalised mean negative log-likelihood of the joint network, and its gradient.

    The parameters are the weights of the inputs, those of the position last, the
    hidden biases, then the output weights and thresholds of each adjective. What
    follows the product of features and weights is for each adjective a network of
    its own, whose inputs are the trials one by one.

    Parameters
    ----------
    X : ndarray of shape (n_trials, n_features)
    observations : list of (positions, level, weight)
        For each adjective as in `NetworkLoss`.
    n_hidden : int
    alpha : ndarray of shape (n_features + 2,)
        Penalty of the weights of each input, of the position's and the output's.
    """

    def __init__(self, X, observations, n_hidden, alpha):
        self.X, self.n_hidden, self.input_alpha = X, n_hidden, alpha[:-1]
        self.n_levels = [level.max() + 1 for _, level, _ in observations]
        trials = sparse.eye_array(len(X), format="csr")
        head_alpha = np.append(np.zeros(len(X) + 1), alpha[-1])
        self.networks = [
            NetworkLoss(trials, *observed, n_hidden, head_alpha)
            for observed in observations
        ]
        self.total = sum(network.total for network in self.networks)

    def __call__(self, params):
        coef, bias, heads = split_heads(
            params, len(self.input_alpha), self.n_hidden, self.n_levels
        )
        common = np.concatenate(((self.X @ coef[:-1]).ravel(), coef[-1], bias))
        g_coef = (self.input_alpha * coef.T).T
        loss = 0.5 * np.vdot(g_coef, coef)
        g_common, g_heads = np.zeros_like(common), []
        for network, head in zip(self.networks, heads):
            mean, grad = network(np.concatenate((common, head)))
            loss += network.total * mean
            grad *= network.total
            g_common += grad[: len(common)]
            g_heads.append(grad[len(common) :])
        g_shared, g_position, g_bias = np.split(
            g_common.reshape(-1, self.n_hidden), [len(self.X), len(self.X) + 1]
        )
        g_coef[:-1] += self.X.T @ g_shared
        g_coef[-1:] += g_position
        grad = np.concatenate((g_coef.ravel(), g_bias.ravel(), *g_heads))
        return loss / self.total, grad / self.total


class SharedNetwork:
    """The joint network, with everything else as in `DistributionalOrdinalRegressor`.

    Features are centred, as all here are. Fitted to a list of rating counts, an array
    of shape (n_trials, n_levels) for each adjective, it predicts a list of
    probabilities.
    """

    def __init__(self, n_hidden, alpha):
        self.n_hidden = n_hidden
        self.alpha = alpha

    def fit(self, X, ratings):
        rng = np.random.RandomState(0)
        # An adjective's levels that no training rating has get probability 0; with a
        # single level left there is nothing to learn.
        self.present_ = [counts.sum(axis=0) > 0 for counts in ratings]
        self.n_levels_ = [p.sum() for p in self.present_ if p.sum() > 1]
        observations = []
        for counts, present in zip(ratings, self.present_):
            if present.sum() == 1:
                continue
            positions, level, weight = training_observations(
                counts, 15, "level", None, rng
            )
            level = (np.cumsum(present) - 1)[level]
            observations.append((logit(positions), level, weight))

        n_features, n_hidden = X.shape[1], self.n_hidden
        trial_weight = sum(weight.sum(axis=1) for _, _, weight in observations)
        spread = total_spread(X, trial_weight)
        evened = EvenedFeatures(X / spread, self.alpha, trial_weight.mean())
        alpha = np.append(evened.alpha, (self.alpha, self.alpha))
        loss = SharedLoss(evened.inputs, observations, n_hidden, alpha)

        n_head = sum(n_hidden + k - 1 for k in self.n_levels_)
        params = rng.uniform(-0.5, 0.5, (n_features + 2) * n_hidden + n_head)
        params = change_weights(
            params, evened.to_inputs, n_features, n_hidden, n_features + 1
        )
        params, *_ = lbfgs(
            loss, params, bounds=None, **OPTIONS, callback=lambda *_: False
        )

        def to_features(weights):
            return evened.to_features(weights) / spread

        rank = evened.inputs.shape[1]
        self.params_ = change_weights(params, to_features, rank, n_hidden, rank + 1)
        return self

    def predict_proba(self, X):
        coef, bias, heads = split_heads(
            self.params_, X.shape[1] + 1, self.n_hidden, self.n_levels_
        )
        positions, weight = population_quadrature(20)
        output = np.stack([head[: self.n_hidden] for head in heads], axis=1)
        latent, _ = forward(X, logit(positions)[None], coef, bias, output)
        learnt = zip(np.moveaxis(latent, -1, 0), heads)
        proba = []
        for present in self.present_:
            proba.append(np.tile(present.astype(float), (len(X), 1)))
            if present.sum() > 1:
                f, head = next(learnt)
                first, gap_logits = head[self.n_hidden], head[self.n_hidden + 1 :]
                at_position = level_probabilities(f, thresholds_from(first, gap_logits))
                proba[-1][:, present] = np.einsum("tpk,p->tk", at_position, weight)
        return proba


# ----------------------------------------------------------------------------------
# Its rivals, and the choice of settings


class Separate:
    """One `DistributionalOrdinalRegressor` an adjective; a setting each, or for all."""

    def __init__(self, n_hidden, alpha):
        self.n_hidden = n_hidden
        self.alpha = alpha

    def fit(self, X, ratings):
        n_hidden = np.broadcast_to(self.n_hidden, len(ratings)).tolist()
        alpha = np.broadcast_to(self.alpha, len(ratings)).tolist()
        self.models_ = [
            DistributionalOrdinalRegressor(
                NNPOM(*setting, **OPTIONS, random_state=0)
            ).fit(X, counts)
            for *setting, counts in zip(n_hidden, alpha, ratings)
        ]
        return self

    def predict_proba(self, X):
        return [model.predict_proba(X) for model in self.models_]


def check():
    """The gradient is exact, and of one adjective the network is `NNPOM`."""
    rng = np.random.RandomState(0)
    X, n_hidden = scale(rng.normal(size=(8, 3))), 4
    ratings = [rng.randint(1, 5, (8, n_levels)).astype(float) for n_levels in (5, 2, 3)]
    observations = []
    for counts in ratings:
        positions, *others = training_observations(counts, 6, "level", None, rng)
        observations.append((logit(positions), *others))
    loss = SharedLoss(X, observations, n_hidden, rng.uniform(size=5))
    params = rng.normal(size=5 * n_hidden + 3 * n_hidden + 4 + 1 + 2)
    numeric = approx_fprime(params, lambda params: loss(params)[0], 1e-7)
    np.testing.assert_allclose(loss(params)[1], numeric, atol=1e-6)

    shared, single = (
        model(n_hidden, 1.0).fit(X, ratings[:1]).predict_proba(X)[0]
        for model in (SharedNetwork, Separate)
    )
    np.testing.assert_allclose(shared, single, atol=1e-8)


LINEAR = [(0, alpha) for alpha in (1.0, *ALPHAS)]
NETWORKS = [(n_hidden, alpha) for n_hidden in HIDDEN for alpha in ALPHAS]
JOINT = "joint network"
RIVALS = [  # class, settings, whether each adjective chooses its own
    (Separate, LINEAR, {"linear": True, "linear, one alpha": False}),
    (Separate, NETWORKS, {"networks": True, "networks, one setting": False}),
    (SharedNetwork, NETWORKS, {JOINT: False}),
]


def timed(function, *arguments):
    """Result of a call, and its seconds."""
    start = time.process_time()
    result = function(*arguments)
    return result, time.process_time() - start


def split(n_splits, groups, seed):
    folds = GroupKFold(n_splits, shuffle=True, random_state=seed)
    return folds.split(groups, groups=groups)


def of_rows(ratings, rows):
    return [counts[rows] for counts in ratings]


def inner_rps(model, settings, X, ratings, groups, seed):
    """RPS of each setting and adjective on held-out groups."""
    rps = np.zeros((len(settings), len(ratings)))
    for train, held_out in split(3, groups, seed):
        known, unknown = of_rows(ratings, train), of_rows(ratings, held_out)
        for i, setting in enumerate(settings):
            proba = model(*setting).fit(X[train], known).predict_proba(X[held_out])
            rps[i] += [*map(ranked_probability_score, unknown, proba)]
    return rps


def best_setting(settings, rps, own):
    """Hidden units and alpha, each a tuple if every adjective has its own."""
    if own:
        return tuple(zip(*[settings[i] for i in rps.argmin(axis=0)]))
    return settings[rps.mean(axis=1).argmin()]


# ----------------------------------------------------------------------------------
# Data


class Data(NamedTuple):
    title: str
    trials: pd.DataFrame  # recordings or features
    ratings: dict  # name -> counts
    objects: np.ndarray
    features: object  # transformer, to be fitted to training trials


def synthetic(seed):
    corpus = make_haptic_corpus(60, 10, procedure="slow_slide", random_state=seed)
    features = make_pipeline(make_haptic_pipeline(random_state=0)[:-1], PCA())
    title = "Synthetic corpus, 600 slow slides of 60 objects, ten adjectives"
    return Data(title, corpus.trials, corpus.ratings, corpus.objects, features)


def real(folder):
    """Adjectives that enough objects have, yes or no, and votes from 0 to 5."""
    X, hardness, objects, standardise, _ = phac2(folder)
    stored = np.load(folder / "phac2_static" / "phac2_static.npz")
    has = dict(zip(stored["adjectives"].tolist(), stored["Y_binary"].T.astype(int)))
    binary = {
        name: np.eye(2)[column]
        for name, column in has.items()
        if len(np.unique(objects[column == 1])) >= 5
    }
    roughness = sum(has[name] for name in ("rough", "scratchy", "textured", "bumpy"))
    roughness += 1 - has["smooth"]
    votes = {"hardness": np.eye(6)[hardness], "roughness": np.eye(6)[roughness]}
    features = make_pipeline(standardise, PCA())
    for title, ratings in [
        (f"PHAC-2, {len(binary)} adjectives, yes or no", binary),
        ("PHAC-2, hardness and roughness votes from 0 to 5", votes),
    ]:
        yield Data(title, pd.DataFrame(X), ratings, objects, features)


# ----------------------------------------------------------------------------------
# Cross-validation and tables


def score(ratings, proba):
    """Scores of shape (n_trials, n_adjectives, n_scores)."""
    scores = [
        [function(counts, p, average=False) for function in SCORES.values()]
        for counts, p in zip(ratings, proba)
    ]
    return np.transpose(scores, (2, 0, 1))


def evaluate(data, rivals, seed):
    """Scores of each model, settings chosen, and seconds of search and fit."""
    ratings = list(data.ratings.values())
    shape = len(data.trials), len(ratings), len(SCORES)
    scores, chosen, seconds = {}, defaultdict(list), defaultdict(list)
    for train, test in split(5, data.objects, seed):
        features = clone(data.features).fit(data.trials.iloc[train])
        A, B = (
            features.transform(data.trials.iloc[rows]).astype(np.float64)
            for rows in (train, test)
        )
        known, unknown = of_rows(ratings, train), of_rows(ratings, test)
        for model, settings, names in rivals:
            rps, search = timed(
                inner_rps, model, settings, A, known, data.objects[train], seed
            )
            for name, own in names.items():
                setting = best_setting(settings, rps, own)
                fitted, fit = timed(model(*setting).fit, A, known)
                predicted = score(unknown, fitted.predict_proba(B))
                scores.setdefault(name, np.empty(shape))[test] = predicted
                chosen[name].append(setting)
                seconds[name].append((search + fit, fit))
    return scores, chosen, seconds


def report(data, scores, chosen, seconds):
    objects = np.unique(data.objects)

    def of_objects(scores):
        """Mean over adjectives and the trials of each object."""
        scores = scores.mean(axis=1)
        return np.stack([scores[data.objects == i].mean(axis=0) for i in objects])

    scores = {name: of_objects(values) for name, values in scores.items()}
    print(f"\n**{data.title}**\n")
    print("| | " + " | ".join(SCORES) + " | units | alpha | search, s | fit, s |")
    print("|---" * (len(SCORES) + 5) + "|")
    for name, values in scores.items():
        cells = [f"{value:.4f}" for value in values.mean(axis=0)]
        cells += [describe(values) for values in zip(*chosen[name])]
        cells += [f"{value:.1f}" for value in np.median(seconds[name], axis=0)]
        print(f"| {name} | " + " | ".join(cells) + " |")
    for other in [name for name in scores if name != JOINT]:
        difference = scores[JOINT] - scores[other]
        error = difference.std(axis=0, ddof=1) / np.sqrt(len(objects))
        cells = [
            f"{mean:+.4f} ± {se:.4f}"
            for mean, se in zip(difference.mean(axis=0), error)
        ]
        print(f"| {JOINT} − {other} | " + " | ".join(cells) + " | | | | |", flush=True)


def describe(values):
    """How often each value was chosen."""
    values, counts = np.unique(np.ravel(values), return_counts=True)
    return ", ".join(f"{value:g} ({n})" for value, n in zip(values, counts))


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    check()
    warnings.simplefilter("ignore", ConvergenceWarning)
    rivals = [RIVALS[0], RIVALS[-1]] if arguments.quick else RIVALS
    data = [synthetic(arguments.seed)]
    if "SKLEARN_HAPTIC_SHARED" in os.environ:
        data += real(Path(os.environ["SKLEARN_HAPTIC_SHARED"]) / "data")
    for item in data:
        report(item, *evaluate(item, rivals, arguments.seed))


if __name__ == "__main__":
    main()
