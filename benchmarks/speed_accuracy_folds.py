"""What `speed_accuracy.py` measures on one fold of a set, for each setting."""

import time
import tracemalloc
from functools import cache, cached_property
from typing import NamedTuple

import joblib
import numpy as np
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.model_selection import GridSearchCV, GroupKFold
from sklearn.utils.validation import has_fit_parameter
from speed_accuracy_settings import SENSORS, SIZES

from sklearn_haptic import KSVDTransformer, STHMPTransformer, TemporalMaxPool
from sklearn_haptic.metrics import (
    earth_movers_distance,
    log_score,
    macro_mae,
    neg_rps_scorer,
    ranked_probability_score,
)

SCORES = {
    "mae_m": macro_mae,
    "emd": earth_movers_distance,
    "rps": ranked_probability_score,
    "log": log_score,
}


class Block(NamedTuple):
    """Features of the training and the test trials, and what they cost."""

    train: np.ndarray
    test: np.ndarray
    seconds: tuple  # for the training and the test trials


class Timer:
    """Processor seconds since the last call."""

    def __init__(self):
        self.last = time.process_time()

    def __call__(self):
        last, self.last = self.last, time.process_time()
        return self.last - last


class Sensor(NamedTuple):
    """How the features of one sensor are made."""

    name: str
    remove_mean: bool
    atoms: float = 1  # times the paper's size
    n_nonzero_coefs: int = 4
    max_iter: int = 50
    max_train: int = 20_000  # windows or patches
    update: str = "approximate"
    dtype: str = "float32"
    spatial_cells: tuple = (3, 2, 1)
    cells: tuple = (16, 8, 4, 2, 1)

    @property
    def before_pooling(self):
        """What the dictionary depends on."""
        base = make_sensor(self.name)
        return self._replace(cells=base.cells, spatial_cells=base.spatial_cells)

    def coder(self, random_state):
        names = "n_nonzero_coefs", "remove_mean", "max_iter", "update"
        parameters = {name: getattr(self, name) for name in names}
        parameters["random_state"] = random_state
        if self.name == "electrodes":
            return STHMPTransformer(
                round(10 * self.atoms),
                spatial_cells=self.spatial_cells,
                max_train_patches=self.max_train,
                **parameters,
            )
        window, n_atoms = SIZES[self.name]
        return KSVDTransformer(
            round(n_atoms * self.atoms),
            window=window,
            max_train_windows=self.max_train,
            **parameters,
        )


def make_sensor(name, mean_removed=(), **changes):
    if name != "electrodes":
        changes.pop("spatial_cells", None)
    return Sensor(name, name in mean_removed, **changes)


class Fold:
    """One split of a set; everything that its settings share is computed once."""

    def __init__(self, data, repeat, fold, train, test):
        self.data, self.repeat, self.fold = data, repeat, fold
        self.train, self.test = train, test
        self._dictionary = cache(self._dictionary)
        self._block = cache(self._block)
        self._memory = cache(self._memory)
        self._learning_memory = cache(self._learning_memory)
        self._results = {}

    def _cells(self, sensor, rows):
        cells = self.data.trials[sensor.name].iloc[rows]
        return cells.map(lambda trial: trial.astype(sensor.dtype))

    def _dictionary(self, sensor):
        """The fitted coder of a sensor, and seconds."""
        trials = self._cells(sensor, self.train)
        timer = Timer()
        return sensor.coder(self.repeat).fit(trials), timer()

    def _block(self, sensor):
        """Pooled, scaled and rotated features of a sensor."""
        coder, learning = self._dictionary(sensor.before_pooling)
        train, test = (self._cells(sensor, rows) for rows in (self.train, self.test))
        pool = TemporalMaxPool(sensor.cells)
        if sensor.name == "electrodes":  # other cells, the same dictionary
            coder = clone(coder).set_params(
                spatial_cells=sensor.spatial_cells,
                dict_init=coder.components_,
                max_iter=0,
            )
            coder.fit(train)
        timer = Timer()
        pooled = pool.fit_transform(coder.transform(train))
        scale = clone(self.data.scale).fit(pooled)
        A = scale.transform(pooled)
        coding = timer()
        B = scale.transform(pool.transform(coder.transform(test)))
        return Block(A, B, (learning + coding, timer()))

    def table(self, sensors=SENSORS, **changes):
        """Features of some sensors side by side, or of the tabular set."""
        if not self.data.is_table:
            blocks = [self._block(make_sensor(s, **changes)) for s in sensors]
            if len(blocks) == 1:
                return blocks[0]
            A = np.hstack([block.train for block in blocks])
            B = np.hstack([block.test for block in blocks])
            seconds = np.sum([block.seconds for block in blocks], axis=0)
            timer = Timer()
            rotation = PCA().fit(A)
            A = rotation.transform(A)
            seconds[0] += timer()
            B = rotation.transform(B)
            seconds[1] += timer()
            return Block(A, B, tuple(seconds))
        X = self.data.trials
        timer = Timer()
        scale = clone(self.data.scale)
        A = scale.fit_transform(X[self.train])
        seconds = timer()
        return Block(A, scale.transform(X[self.test]), (seconds, timer()))

    @cached_property
    def base_table(self):
        return self.table()

    def block(self, setting):
        """The features of a setting."""
        return self.table(**setting.features) if setting.features else self.base_table

    def features_memory(self, setting):
        """Largest peak of a sensor's features in MB."""
        changes = dict(setting.features)
        sensors = changes.pop("sensors", SENSORS)
        return max(self._memory(make_sensor(s, **changes)) for s in sensors)

    def _memory(self, sensor):
        """Peak of learning the dictionary, or of coding and pooling."""
        learning = self._learning_memory(sensor.before_pooling)
        return max(learning, peak_mb(lambda: self._block.__wrapped__(sensor)))

    def _learning_memory(self, sensor):
        return peak_mb(lambda: self._dictionary.__wrapped__(sensor))

    def search(self, model, alphas, target, block):
        """Choose alpha by the RPS on grouped folds of the training trials."""
        model = clone(model).set_params(levels=self.data.levels)
        groups = self.data.groups[self.train]
        cv = GroupKFold(min(4, len(np.unique(groups))))
        search = GridSearchCV(
            model,
            {alpha_name(model): list(alphas)},
            scoring=neg_rps_scorer,
            cv=cv,
            refit=False,
            error_score="raise",
        )
        y = self.data.targets[target][self.train]
        return search.fit(block.train, y, groups=groups).best_params_[alpha_name(model)]

    def model(self, setting, target, block):
        model = clone(setting.model).set_params(levels=self.data.levels)
        if setting.alphas:
            alpha = self.search(model, setting.alphas, target, block)
            model.set_params(**{alpha_name(model): alpha})
        return model

    def run(self, setting, block, target):
        """Seconds to fit and predict, and the scores."""
        train, test = self.train, self.test
        model = self.model(setting, target, block)
        y, levels = self.data.targets[target], self.data.levels
        keywords = {}
        if has_fit_parameter(model, "groups"):
            keywords["groups"] = self.data.groups[train]
        timer = Timer()
        model.fit(block.train, y[train], **keywords)
        seconds = timer()
        proba = model.predict_proba(block.test)
        seconds = (seconds, timer())
        if levels is None:
            levels = model.levels_
        return seconds, [
            score(y[test], proba, levels=levels) for score in SCORES.values()
        ]

    def evaluate(self, setting):
        """Seconds of the four stages and the scores, means over the targets."""
        key = joblib.hash(setting)
        if key not in self._results:
            block = self.block(setting)
            runs = [self.run(setting, block, target) for target in self.data.targets]
            seconds, scores = (np.mean(values, axis=0) for values in zip(*runs))
            self._results[key] = [*block.seconds, *seconds], list(scores)
        return self._results[key]

    def head_memory(self, setting):
        """Peak of the head's fit and prediction in MB."""
        target, y = next(iter(self.data.targets.items()))
        block = self.block(setting)
        model = self.model(setting, target, block)
        return peak_mb(
            lambda: model.fit(block.train, y[self.train]).predict_proba(block.test)
        )


def alpha_name(model):
    return "estimator__alpha" if hasattr(model, "estimator") else "alpha"


def peak_mb(function):
    tracemalloc.start()
    function()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def folds(data, n_folds, n_repeats):
    for repeat in range(n_repeats):
        splits = GroupKFold(n_folds, shuffle=True, random_state=repeat)
        splits = splits.split(data.groups, groups=data.groups)
        for fold, (train, test) in enumerate(splits):
            yield Fold(data, repeat, fold, train, test)
