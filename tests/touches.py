"""Touches whose ratings follow a model of proportional odds, for many tests."""

import numpy as np

CUTS = (-2, -0.7, 0.7, 2)


def ordinal_touches(n_objects, n_trials, effects, *, spread, noise, cuts=CUTS, seed=0):
    """Features of trials, the counts of twelve people, and the objects.

    An object has a latent response of normal distribution; features are its effects,
    with noise of their own in each trial. People feel it with logistic noise.
    """
    rng = np.random.default_rng(seed)
    objects = np.repeat(np.arange(n_objects), n_trials)
    latent = spread * rng.normal(size=n_objects)
    X = latent[objects, None] * effects
    X = X + noise * rng.normal(size=X.shape)
    level = np.digitize(latent[:, None] + rng.logistic(size=(n_objects, 12)), cuts)
    counts = np.stack([(level == k).sum(axis=1) for k in range(len(cuts) + 1)], axis=1)
    return X, counts[objects], objects
