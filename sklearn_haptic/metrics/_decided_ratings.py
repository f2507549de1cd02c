"""Ratings that a model decides on one by one, as in the paper."""

from ..ratings._distributions import quantile_grid


def ratings_decided_on(model, X):
    """Return the ratings that a model predicts one by one, and their positions.

    None for all but a `DistributionalOrdinalRegressor` that decodes as the paper does.
    """
    if getattr(model, "decode", None) != "quantile" or model.rule != "argmax":
        return None
    p = quantile_grid(model.n_quantiles)
    return model.predict_rating(X, p), p
