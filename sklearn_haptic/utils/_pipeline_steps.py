"""Steps of pipelines within pipelines."""

from sklearn.pipeline import Pipeline


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
