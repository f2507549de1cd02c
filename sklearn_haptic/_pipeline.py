"""A whole model in one call."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import repeat
from typing import Any, Self

from numpy.typing import ArrayLike
from sklearn.base import clone
from sklearn.pipeline import FeatureUnion, Pipeline, make_pipeline

from .ensembles import DistributionBlend
from .features import (
    KSVDTransformer,
    SignalStatistics,
    STHMPTransformer,
    TemporalMaxPool,
)
from .features._sensor_features import SensorColumns, SensorFeatures, SensorUnion
from .models import (
    NNPOM,
    DistributionalOrdinalRegressor,
    RegressedDistribution,
)
from .recordings._biotac import PROCEDURES, SENSORS, columns_of
from .recordings._sensors import BIOTAC, Sensor, Signal, TaxelGrid
from .utils._row_order import check_orders
from .utils._sklearn import Memory, RandomState, Trials, all_or_nothing

# Atoms of the sensors that have not 25 in the 2020 paper.
_N_ATOMS = {"pac": 40, "tdc": 10}

# Sensors of a BioTac by their columns in corpora of one procedure and of several.
_COLUMNS = {name: name for name in SENSORS} | {
    column: column.rsplit("_", 1)[-1] for column in columns_of(PROCEDURES, SENSORS)
}

_MAX_TRAIN = 5000  # windows or patches, of which the atoms are drawn


def _described(sensors):
    """Return sensors as a dictionary of descriptions, or the one that has no name."""
    if sensors is None or isinstance(sensors, Sensor):
        return sensors
    if isinstance(sensors, str):
        sensors = [sensors]
    if not isinstance(sensors, Mapping):
        sensors = {name: BIOTAC.get(_COLUMNS.get(name)) for name in sensors}
    if not sensors:
        raise ValueError(
            f"sensors is empty; name a sensor or more, such as {list(SENSORS)}."
        )
    for name, description in sensors.items():
        if not isinstance(name, str) or not name:
            raise ValueError(
                f"sensors names {name!r}; name sensors by the columns of the trials, "
                "which must be text: trials.rename(columns=str)."
            )
        if not (description is None or isinstance(description, Sensor)):
            raise ValueError(
                f"sensors[{name!r}]={description!r} must be a Signal, a TaxelGrid, or "
                "None to find out from the trials."
            )
    # ColumnTransformer refuses names that are numpy.str_.
    return {str(name): each for name, each in sensors.items()}


class _Features:
    """Transformers of sensors: roots of pooled codes, and statistics of channels."""

    def __init__(self, memory, random_state):
        self.options = {
            "n_nonzero_coefs": 2,
            "max_iter": 0,  # training windows as atoms
            "remove_mean": False,
            "memory": memory,
            "random_state": random_state,
        }

    def of(self, sensor, name=None):
        """Return what makes the blocks of features of a sensor, with their names."""
        rate = sensor.rate if isinstance(sensor, Signal) else None
        statistics = SignalStatistics(cells=(2, 1), rate=rate)
        if sensor is None:
            images = FeatureUnion(self.of(TaxelGrid()))
            return [("features", SensorFeatures(statistics, images))]
        if sensor == Signal():
            return [("statistics", statistics)]
        # Codes and bands tell how a signal varies.
        statistics.set_params(statistics=("mean", "max", "min", "bands"))
        name = _COLUMNS.get(name)
        of_biotac = name is not None and BIOTAC[name] == sensor
        codes = self.codes(sensor, _N_ATOMS.get(name, 25) if of_biotac else 25)
        return [("codes", codes), ("statistics", statistics)]

    def step(self, sensor, name):
        """Return the transformer of a sensor in a column."""
        blocks = self.of(sensor, name)
        return FeatureUnion(blocks) if len(blocks) > 1 else blocks[0][1]

    def codes(self, sensor, n_atoms=25):
        """Return roots of statistics of codes over training windows or patches."""
        if isinstance(sensor, Signal):
            coder = KSVDTransformer(
                n_atoms,
                window=sensor.n_samples,
                max_train_windows=_MAX_TRAIN,
                **self.options,
            )
        else:
            coder = STHMPTransformer(
                layout=sensor.weights,
                patch_size=(3, 3) if sensor.layout == "biotac" else None,
                max_train_patches=_MAX_TRAIN,
                **self.options,
            )
        pool = TemporalMaxPool(
            (4, 2, 1),
            statistics=("mean", "share", "max"),
            root=True,
            memory=self.options["memory"],
        )
        return make_pipeline(coder, pool)


def _model_of_ratings(random_state):
    """Return a blend of two linear models and of trees, which err differently."""
    members = [
        (name, DistributionalOrdinalRegressor(NNPOM(n_hidden=0, alpha=alpha)))
        for name, alpha in (("weak", 0.3), ("strong", 3.0))
    ]
    trees = RegressedDistribution(random_state=random_state)
    return DistributionBlend([*members, ("trees", trees)])


class HapticPipeline(Pipeline):
    """A Pipeline of which a fit that fails or is interrupted leaves the old model.

    Its steps are fitted in place, as those of scikit-learn, but all or none. As they
    take over the state of clones, they keep no other state: ``warm_start=True`` of a
    step has no effect.
    """

    @all_or_nothing
    def fit(self, X: Trials, y: ArrayLike | None = None, **params: Any) -> Self:
        """Fit clones of the steps, whose state the steps then take over."""
        check_orders(X=X, y=y, **params)
        steps = self.steps
        self.steps: list[Any] = clone(steps, safe=False)
        super().fit(X, y, **params)
        of_steps = zip(steps, self.steps)
        pairs = [(old, new) for (_, old), (_, new) in of_steps if hasattr(old, "fit")]
        olds, states = [old for old, _ in pairs], [vars(new) for _, new in pairs]
        self.steps = steps
        fitted: Any = self
        # In one call, which nothing interrupts.
        return [fitted, *map(setattr, olds, repeat("__dict__"), states)][0]

    def score(
        self,
        X: Trials,
        y: ArrayLike | None = None,
        sample_weight: ArrayLike | None = None,
        **params: Any,
    ) -> float:
        """Return the score of the last step; rows of `y` belong to those of `X`."""
        check_orders(X=X, y=y, sample_weight=sample_weight, **params)
        return float(super().score(X, y, sample_weight, **params))


def make_haptic_pipeline(
    sensors: Sequence[str] | Mapping[str, Sensor | None] | Sensor | None = tuple(
        SENSORS
    ),
    *,
    memory: str | Memory | None = None,
    random_state: RandomState = None,
) -> Pipeline:
    """Build a model of raw recordings of BioTac fingers or of any other sensors.

    Signals and electrodes are coded over a dictionary of their own, whose atoms are
    training windows or patches, and the codes are pooled over time. Beside them stand
    statistics of each channel. All features are standardised, and codes and statistics
    of a sensor are scaled to equal total variance. Each feature of a new touch is
    limited to the range of the training touches, widened by its width at both ends. The
    features are given to a model of distributions of ratings: a `DistributionBlend` of
    linear models with a weak and a strong penalty, of trees and of the marginal, whose
    weights are learned on held-out objects. The result is a Pipeline, whose parameters
    can be set and searched, with the steps ``"features"`` (a ColumnTransformer with one
    transformer per sensor) and ``"model"``, which any other model can take the place
    of. Unlike those of scikit-learn, it is the old model if a fit fails or is
    interrupted, and steps always begin anew (``warm_start`` has no effect).

    Parameters
    ----------
    sensors : sequence of str, mapping of str to Signal, TaxelGrid or None, Signal, \
            TaxelGrid or None, default=("pac", "pdc", "tac", "tdc", "electrodes")
        Names of sensors are columns of the DataFrame of trials. Those of a BioTac, all
        of which are taken by default, are columns of what `load_phac2` and
        `make_haptic_corpus` return, also with the name of a procedure before them,
        such as ``"hold_pac"``. Describe other sensors by a mapping, such as
        ``{"skin": TaxelGrid((4, 4)), "acc": Signal(rate=1000)}``. One description
        alone, without a name, is that of a model of one sensor, whose trials are a
        list. What has no description (None, or a name alone) is found out from the
        trials when they are fitted: those of shape (n_times, n_rows, n_columns) are
        images, and all others signals, of which statistics are taken.
    memory : str or object with the joblib.Memory interface, default=None
        Where the transformers cache dictionaries and pooled codes, so that a search
        over the model computes these once per fold. Statistics are computed for every
        candidate.
    random_state : int, RandomState instance or None, default=None
        Seeds the dictionaries and the trees.

    Returns
    -------
    pipeline : sklearn.pipeline.Pipeline
        Unfitted.

    Raises
    ------
    ValueError
        If no sensor is named, or a description is none.

    Notes
    -----
    The settings were chosen by measurements on generated and on recorded touches.
    Training windows and patches are the atoms, because those that K-SVD learns from
    them predict no better. Their means are kept, because the level of pressure and
    temperature carries information and the level of other signals did no harm as it
    was; levels of 10 to 1000 deviations added to vibrations cost up to 2 % of RPS,
    which ``RepairTrials(rest=10)`` avoids. Levels that differ by touch, as the gravity
    of a tilted accelerometer, cost up to 15 %, which ``remove_mean=True`` of its codes
    avoids. To taxels levels do more harm: 35 deviations made .978 of fabrics named
    .880, so give a :class:`TaxelGrid` readings relative to those without contact. The
    features are square roots of mean, share and maximum of each code. Statistics tell
    what codes of normalised frames do not. As a block that weighs as much as the codes,
    they gain on slides and on generated touches. With only five materials to learn
    from, they cost accuracy on grips of four procedures.

    Examples
    --------
    >>> from sklearn_haptic import make_haptic_pipeline
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(n_objects=6, n_trials=2, random_state=0)
    >>> model = make_haptic_pipeline(["pdc", "tdc"], random_state=0)
    >>> model.fit(corpus.trials, corpus.ratings["hard"])
    HapticPipeline(...)
    >>> model.predict_proba(corpus.trials).shape
    (12, 5)

    In a search or cross-validation, metadata routing brings the objects to the blend:

    >>> from sklearn import config_context
    >>> from sklearn.model_selection import GroupKFold, cross_val_score
    >>> from sklearn_haptic.metrics import neg_rps_scorer
    >>> model = make_haptic_pipeline(["tdc"], random_state=0)
    >>> with config_context(enable_metadata_routing=True):
    ...     scores = cross_val_score(
    ...         model, corpus.trials, corpus.ratings["hard"], cv=GroupKFold(3),
    ...         scoring=neg_rps_scorer, params={"groups": corpus.objects},
    ...     )

    Other sensors are described, here an array of pressure and an accelerometer:

    >>> import numpy as np
    >>> import pandas as pd
    >>> from sklearn_haptic import Signal, TaxelGrid
    >>> rng = np.random.default_rng(0)
    >>> touches = [(rng.normal(size=(n, 16)), rng.normal(size=(20 * n, 3)))
    ...            for n in range(30, 42)]
    >>> touches = pd.DataFrame(touches, columns=["skin", "acc"])
    >>> sensors = {"skin": TaxelGrid((4, 4)), "acc": Signal(rate=1000)}
    >>> model = make_haptic_pipeline(sensors, random_state=0)
    >>> model.fit(touches, corpus.ratings["hard"]).predict_proba(touches).shape
    (12, 5)
    """
    described = _described(sensors)
    build = _Features(memory, random_state)
    if isinstance(described, dict):
        features = SensorColumns(
            [(s, build.step(d, s), s) for s, d in described.items()]
        )
    else:
        features = SensorUnion(build.of(described))
    model = _model_of_ratings(random_state)
    return HapticPipeline([("features", features), ("model", model)])
