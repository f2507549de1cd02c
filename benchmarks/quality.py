"""How well ratings and classes are predicted: this package beside its rivals.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/quality.py FOLDER \
        [--sets bolt phac2 …] [--rows linear MiniRocket …] [--csv FILE]

The sets are those of ratings in `data.py`; "slides", of which twenty materials one
BioTac slides over, and how rough a material is that it never touched; and "sensors",
fabrics and materials by sensors that are described, named, or left to be found out.
All take hours on one core, one small set (phac2, films, bolt) minutes, "sensors" a
minute. ``--quick`` takes "default" and "marginal" on one adjective.

Rows are the default; the same where ratings are permuted over objects, so that there is
nothing to learn; other features with its model of the ratings; and other models of its
features, which choose their settings inside the training trials. Whole objects are left
out. Scores are means over objects, lower is better; differences are paired with the
default, that of permuted ratings with the marginal; ± is the standard error over
objects. Dispersions are the least and the largest of all adjectives. Probabilities
below 1e-3 count as 1e-3 in the log score. On the slides, the score is the share of
materials taken for another, by a ridge classifier, three blocks of five runs left out
in turn. Costs are processor time: learning features and model for one adjective, and of
features and prediction per touch. MB is the size of the pickled features and model. The
CSV file keeps the rows of earlier runs.
"""

import pickle
import warnings
from pathlib import Path

import data
import numpy as np
import pandas as pd
from heads import DEFAULT, RIDGE, OfAeon, families, minirocket, models, with_ridge
from measure import (
    SCORES,
    command,
    head,
    of_groups,
    plus_minus,
    row,
    standard_error,
    timed,
)
from sklearn import config_context
from sklearn.base import clone
from sklearn.compose import make_column_transformer
from sklearn.model_selection import GroupKFold, LeaveOneGroupOut, cross_val_score
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import (
    DummyDistribution,
    SignalStatistics,
    TaxelGrid,
    make_haptic_pipeline,
)
from sklearn_haptic.metrics import dispersion, ranked_probability_score

COLUMNS = ["set", "row", "score", "difference", "error", "log", "least_dispersion"]
COLUMNS += ["largest_dispersion", "learning_s", "ms", "mb", "mae_m", "emd"]
PERMUTED = "the same, permuted"
SETS = [*data.RATED, "slides", "sensors"]
ONCE = {"MiniRocket"}  # its kernels need no ratings
N_PERMUTATIONS = 3
ROUGHNESS = [2, 0, 1, 0, 0, 0, 2, 0, 0, 0, 2, 1, 0, 0, 0, 2, 2, 2, 2, 0]


def rows(n_features, only=()):
    """Name of the row: features, and model."""
    default = make_haptic_pipeline(random_state=0)[-1]
    found = dict.fromkeys((DEFAULT, PERMUTED), (DEFAULT, default))
    found |= {name: (name, default) for name in families() if name != DEFAULT}
    found |= {name: (DEFAULT, model) for name, model in models(n_features).items()}
    return {
        n: r for n, r in found.items() if not only or n in {DEFAULT, PERMUTED, *only}
    }


# Features and scores ------------------------------------------------------------------


class Tables:
    """Features of the folds of a set, computed once for each family."""

    def __init__(self, trials, folds, given=None):
        self.trials, self.folds, self.given, self.found = trials, folds, given, {}

    def has(self, family):
        """Whether the set has touches that the family takes, or its features."""
        if self.given is not None:
            return family == DEFAULT
        return family in families(list(self.trials))

    def of(self, family):
        """Features of each fold, and seconds to learn, seconds a touch, and bytes."""
        if family not in self.found:
            self.found[family] = self.learned(family)
        return self.found[family]

    def learned(self, family):
        found, learning, making, n_fits = [], 0.0, 0.0, 0
        at = getattr(self.trials, "iloc", self.trials)
        model = self.given or families(list(self.trials))[family]
        for train, test in self.folds:
            if not n_fits or family not in ONCE:
                seconds, model = timed(clone(model).fit, at[train])
                learning += seconds
                seconds, X = timed(model.transform, self.trials)
                making += seconds
                n_fits += 1
                X = np.asarray(X, dtype=float if self.given else np.float32)
            found.append((train, test, X[train], X[test]))
        size = len(pickle.dumps(model))
        if self.given:
            return found, (0.0, 0.0, 0)
        return found, (learning / n_fits, making / n_fits / len(X), size)


def fold_proba(model, found, y, groups):
    """Predictions of all trials; seconds to learn and to predict; the last model."""
    proba, fitting, predicting = np.zeros(y.shape), 0.0, 0.0
    for train, test, A, B in found:
        routes = hasattr(model, "cv") or isinstance(model, Pipeline)
        takes = {"groups": groups[train]} if routes else {}
        seconds, fitted = timed(clone(model).fit, A, y[train], **takes)
        fitting += seconds
        seconds, proba[test] = timed(fitted.predict_proba, B)
        predicting += seconds
    return proba, fitting, predicting, fitted


def permuted(targets, groups):
    """Ratings of other objects, several times; of other trials if theirs differ."""
    found, rng = {}, np.random.default_rng(0)
    for name, y in targets.items():
        _, first, which = np.unique(groups, return_index=True, return_inverse=True)
        if (y != y[first][which]).any():
            first = which = np.arange(len(y))
        for k in range(N_PERMUTATIONS):
            found[name, k] = y[rng.permutation(first)][which]
    return found


def evaluate(tables, family, model, targets, groups):
    """RPS of objects; log score, dispersions, costs, MAE^M and EMD."""
    found, (learning, making, size) = tables.of(family)
    rps, others, fitting, predicting = [], [], 0.0, 0.0
    for y in targets.values():
        proba, *seconds, fitted = fold_proba(model, found, y, groups)
        fitting, predicting = fitting + seconds[0], predicting + seconds[1]
        rps.append(of_groups(ranked_probability_score(y, proba, average=False), groups))
        floor = np.maximum(proba, 1e-3)
        floor /= floor.sum(axis=1, keepdims=True)
        log, errors = SCORES["log score"](y, floor), (SCORES["MAE^M"], SCORES["EMD"])
        others.append((log, dispersion(y, proba), *(e(y, proba) for e in errors)))
    log, _, mae, emd = np.mean(others, axis=0)
    spread = [each[1] for each in others]
    n_fits, n_touches = len(targets) * len(found), len(targets) * len(groups)
    costs = (
        learning + fitting / n_fits,
        1000 * (making + predicting / n_touches),
        (size + len(pickle.dumps(fitted))) / 1e6,
    )
    return np.mean(rps, axis=0), (log, min(spread), max(spread), *costs, mae, emd)


# Tables -------------------------------------------------------------------------------


def of_ratings(name, folder, only, adjectives):
    """Print the table of a set; return its rows."""
    found = data.RATED[name](folder)
    tables = Tables(found.trials, found.folds, found.given)
    groups, default, result = np.asarray(found.groups), None, []
    targets = {a: y for a, y in found.targets.items() if a in (adjectives or [])}
    targets = {a: np.asarray(y, float) for a, y in (targets or found.targets).items()}
    n_features = tables.of(DEFAULT)[0][0][2].shape[1]
    title = f"{name}: {len(groups)} touches, {len(set(groups))} objects"
    scores = "RPS", "difference", "log", "dispersion", "MAE^M", "EMD"
    head("row", *scores, "s", "ms", "MB", title=title)
    for label, (family, model) in rows(n_features, only).items():
        if not tables.has(family):
            continue
        used, base = targets, default
        if label == PERMUTED:
            used = permuted(targets, groups)
            base, _ = evaluate(tables, family, DummyDistribution(), used, groups)
        try:
            rps, others = evaluate(tables, family, model, used, groups)
        except (ImportError, ValueError) as error:  # a rival that cannot do this set
            print(f"{label} left out: {str(error)[:80]}")
            continue
        if default is None:
            default = base = rps
        log, least, largest, learning, ms, size, mae, emd = others
        spread = f"{least:.2f} to {largest:.2f}" if len(targets) > 1 else f"{least:.2f}"
        costs = f"{learning:.2f}", f"{ms:.2f}", f"{size:.1f}"
        cells = f"{log:.3f}", spread, f"{mae:.3f}", f"{emd:.3f}", *costs
        row(label, f"{rps.mean():.4f}", plus_minus(rps - base), *cells)
        difference = (rps - base).mean(), standard_error(rps - base)
        result.append((name, label, rps.mean(), *difference, *others))
    return result


def folds_of_blocks(run):
    """Three blocks of five runs, left out; or one, two or five runs to learn from."""
    block, folds = (run - 1) // 5, []
    for n_runs in (None, 1, 2, 5):
        for b in range(3):
            train, test = np.flatnonzero(block != b), np.flatnonzero(block == b)
            if n_runs:
                train, test = test[(run[test] - 1) % 5 < n_runs], train
            folds.append((train, test))
    return folds


def folds_of_materials(material):
    """Pairs of materials that were never touched."""
    out = (np.random.default_rng(0).permutation(20) + 1).reshape(10, 2)
    tests = [np.isin(material, pair) for pair in out]
    return [(np.flatnonzero(~test), np.flatnonzero(test)) for test in tests]


def known(found, material):
    """Accuracy over blocks and from 1, 2 and 5 runs; errors of each material."""
    right, accuracy = np.zeros(len(material)), []
    for at, (train, test, A, B) in enumerate(found):
        hit = clone(RIDGE).fit(A, material[train]).predict(B) == material[test]
        accuracy.append(hit.mean())
        if at < 3:
            right[test] = hit
    errors = of_groups(1 - right, material)
    return np.reshape(accuracy, (4, 3)).mean(axis=1), errors


def of_slides(name, folder, only, _):
    """Print how features tell known materials apart, and the roughness of unknown."""
    frames, material, run = data.slide_frames(folder, 599)
    trials, rough = data.by_sensor(frames), np.array(ROUGHNESS)[material - 1]
    blocks = Tables(trials, folds_of_blocks(run))
    pairs = Tables(trials, folds_of_materials(material))
    targets, result = {"rough": np.eye(3)[rough]}, []
    head(
        "row", "accuracy over blocks, from 1, 2, 5 runs", "errors, difference",
        "roughness", "difference", "dispersion", "s", "ms", title=name,
    )  # fmt: skip
    for label, (family, model) in rows(1, only).items():
        if family == DEFAULT and label not in (DEFAULT, PERMUTED, "marginal"):
            continue
        used = permuted(targets, material) if label == PERMUTED else targets
        try:
            rps, others = evaluate(pairs, family, model, used, material)
            found, costs = blocks.of(family)
        except ImportError as error:
            print(f"{label} left out: {error}")
            continue
        accuracy, errors = known(found, material)
        if label == DEFAULT:
            first, first_rps = errors, rps
        base = first_rps
        if label == PERMUTED:
            base, _ = evaluate(pairs, family, DummyDistribution(), used, material)
        cells = " ".join(f"{a:.3f}" for a in accuracy), plus_minus(errors - first)
        rough = f"{rps.mean():.4f}", plus_minus(rps - base), f"{others[1]:.2f}"
        row(label, *cells, *rough, f"{costs[0]:.2f}", f"{1000 * costs[1]:.1f}")
        if label not in (PERMUTED, "marginal"):
            gain = (errors - first).mean(), standard_error(errors - first)
            costs = costs[0], 1000 * costs[1], costs[2] / 1e6
            empty = np.full(5, np.nan)
            result.append(
                (name, label, errors.mean(), *gain, *empty[:3], *costs, *empty[3:])
            )
    return result


def of_channels(described, **settings):
    """Statistics and spectral bands of each sensor, over whole touches."""
    each = SignalStatistics(**settings)
    if isinstance(described, dict):
        each = make_column_transformer(*((clone(each), name) for name in described))
    return make_pipeline(each, StandardScaler())


def classes(described, undescribed, trials, frames):
    """Name of the row: features to fit, and what to fit them to.

    The kernels of MiniRocket are drawn from all trials, which favours it.
    """
    made = {
        "described": make_haptic_pipeline(described, random_state=0)[0],
        "not described": make_haptic_pipeline(undescribed, random_state=0)[0],
        "named": make_haptic_pipeline(random_state=0)[0],
        "statistics, 32 bands": of_channels(described, n_bands=32),
        "statistics": of_channels(described),
    }
    if not isinstance(described, dict):
        del made["named"]
    made = {name: (features, trials) for name, features in made.items()}
    for how in ("cut", "stretched"):
        X = OfAeon(minirocket, stretch=how != "cut").fit_transform(frames)
        made[f"MiniRocket, {how}"] = StandardScaler(), X
    return made


def of_sensors(name, folder, only, _):
    """Print the accuracy of every row, and its difference to the better rival."""
    frames, fabric, force, condition = data.fabric_slides(folder)
    slides, material, run = data.slide_frames(folder)
    sets = [
        (TaxelGrid((4, 4)), None, frames, frames, fabric, {
            "fabric, force and speed": (condition, GroupKFold(5)),
            "fabric, force": (force, LeaveOneGroupOut()),
        }),
        (data.BIOTAC, dict.fromkeys(data.BIOTAC), data.by_sensor(slides), slides,
         material, {"material, runs": ((run - 1) // 5, LeaveOneGroupOut())}),
    ]  # fmt: skip
    head("left out", "features", "accuracy", "to the better rival", title=name)
    for described, undescribed, trials, channels, y, splits in sets:
        made = classes(described, undescribed, trials, channels)
        for left_out, (groups, folds) in splits.items():
            cv = list(folds.split(y, groups=groups))
            scores = {
                label: cross_val_score(with_ridge(features), X, y, cv=cv)
                for label, (features, X) in made.items()
            }
            best = max(list(made)[-3:], key=lambda label: scores[label].mean())
            for label, each in scores.items():
                texts = plus_minus(each, 3, ""), plus_minus(each - scores[best], 3, "")
                row(left_out, label, *texts)
    return []


def main():
    parser = command(__doc__, folder=True)
    parser.add_argument("--sets", nargs="+", default=SETS, choices=SETS)
    parser.add_argument("--rows", nargs="+", default=[], help="beside the default")
    parser.add_argument("--adjectives", nargs="+", help="of generated touches")
    parser.add_argument("--csv", type=Path, help="file that further rows are added to")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.rows, arguments.adjectives = ["marginal"], ["hard"]
    tables = {"slides": of_slides, "sensors": of_sensors}
    results = []
    warnings.simplefilter("ignore")  # of mord and few iterations
    with config_context(enable_metadata_routing=True):
        for name in arguments.sets:
            of_set = tables.get(name, of_ratings)
            results += of_set(
                name, arguments.folder, arguments.rows, arguments.adjectives
            )
    if arguments.csv:
        results = pd.DataFrame(results, columns=COLUMNS)
        if arguments.csv.exists():
            results = pd.concat([pd.read_csv(arguments.csv), results]).infer_objects()
        results = results.drop_duplicates(["set", "row"], keep="last")
        results = results.sort_values(
            "set", kind="stable", key=lambda s: s.map(SETS.index)
        )
        results.to_csv(arguments.csv, index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
