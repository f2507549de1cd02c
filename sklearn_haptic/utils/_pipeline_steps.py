"""Steps of pipelines within pipelines."""

from sklearn.base import BaseEstimator
from sklearn.frozen import FrozenEstimator
from sklearn.pipeline import Pipeline

from ._sklearn import BaseSearchCV


def flat_steps(pipeline):
    """Return the steps that do something, with those of inner pipelines in their place.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> from sklearn_haptic.utils._pipeline_steps import flat_steps
    >>> flat_steps(make_pipeline(None, make_pipeline(StandardScaler())))
    [('pipeline-standardscaler', StandardScaler())]
    """
    steps = []
    for name, step in pipeline.steps:
        if isinstance(step, Pipeline):
            steps += [(f"{name}-{inner}", each) for inner, each in flat_steps(step)]
        elif step is not None and step != "passthrough":
            steps.append((name, step))
    return steps


def last_step(model, X=None):
    """Return what predicts at the end of pipelines, searches and what is frozen.

    Return also its input.

    X is what the whole model is given; if it is not None, all steps are fitted.

    Examples
    --------
    >>> from sklearn.linear_model import Ridge
    >>> from sklearn.model_selection import GridSearchCV
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn_haptic.utils._pipeline_steps import last_step
    >>> last_step(make_pipeline(None, GridSearchCV(Ridge(), {})))
    (Ridge(), None)
    """
    while isinstance(model, (Pipeline, BaseSearchCV, FrozenEstimator)):
        if not isinstance(model, Pipeline):
            model = getattr(model, "best_estimator_", model.estimator)
        else:
            X = model[:-1].transform(X) if X is not None and len(model) > 1 else X
            model = model[-1]
    return model, X


def learned_before(part):
    """Whether something is a frozen model, not frozen features."""
    return isinstance(part, FrozenEstimator) and hasattr(part, "predict")


def is_frozen(part):
    """Whether an estimator is, or has, a model that learned before and stays so.

    It may have it in a list or dict, such as those of steps and of candidates.
    """
    if isinstance(part, FrozenEstimator):
        return learned_before(part)
    if isinstance(part, BaseEstimator):
        part = part.get_params(deep=False)
    parts = part.values() if isinstance(part, dict) else part
    return isinstance(part, (dict, list, tuple)) and any(map(is_frozen, parts))
