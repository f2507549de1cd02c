"""Are sensors' networks and combined network better optimised together?"""

import numpy as np
from paper_questions_data import (
    CHOICE,
    FEW,
    SEEDS,
    SOLVER,
    Clock,
    corpus_of,
    each_adjective,
    out_of_fold,
    report,
    stacked,
)
from scipy.optimize import minimize
from scipy.sparse import csr_array
from scipy.special import expit

from sklearn_haptic import NNPOM, DistributionalOrdinalRegressor, SensorFusionNNPOM

# Parts of one cost of all weights; each public network has a cost of its own.
from sklearn_haptic.models._conditioning import EvenedFeatures, total_spread
from sklearn_haptic.models._proportional_odds import ordinal_loss, thresholds_from

APART, ADJECTIVES = "apart", FEW[:2]
ALPHAS = (10.0, 30.0, 100.0)


class Sensor:
    """Features of a sensor as the solver of `NNPOM` sees them, and the way back."""

    def __init__(self, X, alpha):
        self.centre = X.mean(axis=0)
        self.spread = total_spread(X, np.ones(len(X)))
        self.axes = EvenedFeatures((X - self.centre) / self.spread, alpha, 1.0)
        self.inputs = self.axes.inputs
        self.alpha = np.append(self.axes.alpha, alpha)[:, None]  # the position's last

    def from_network(self, network):
        """Weights and biases of a network of the features, for the inputs."""
        of_features, of_position = np.split(network.coefs_[0], [len(self.centre)])
        bias = network.intercepts_ + self.centre @ of_features
        weights = self.axes.to_inputs(of_features * self.spread)
        return np.vstack((weights, of_position)), bias

    def to_network(self, network, weights, bias):
        of_features = self.axes.to_features(weights[:-1]) / self.spread
        network.coefs_[0] = np.vstack((of_features, weights[-1:]))
        network.intercepts_ = bias - self.centre @ of_features


class JointCost:
    """Penalised cost of the whole network, and its gradient by backpropagation.

    Parameters are a list of arrays: weights and biases of each sensor's units; weights
    and biases of the combined units; output weights; first threshold; raw gaps.
    """

    def __init__(self, sensors, positions, level, weight, alpha):
        used = weight > 0
        self.trial = np.nonzero(used)[0]
        each = np.arange(len(self.trial))
        self.sum_by_trial = csr_array(
            (np.ones(len(each)), (self.trial, each)), (len(weight), len(each))
        )
        self.positions, self.level = positions[used], level[used]
        self.weight, self.alpha, self.sensors = weight[used], alpha, sensors

    def penalties(self):
        """The penalty of each part; biases and thresholds have none."""
        of_sensors = [each for s in self.sensors for each in (s.alpha, 0.0)]
        return [*of_sensors, self.alpha, 0.0, self.alpha, 0.0, 0.0]

    def __call__(self, params, shapes):
        parts = divide(params, shapes)
        *of_sensors, V, c, output, first, gaps = parts
        layers = []
        for sensor, W, b in zip(self.sensors, of_sensors[::2], of_sensors[1::2]):
            shared = sensor.inputs @ W[:-1] + b
            layers.append(expit(shared[self.trial] + self.positions[:, None] * W[-1]))
        hidden = np.hstack(layers)
        combined = expit(hidden @ V + c)
        loss, g, g_first, g_gaps = ordinal_loss(
            combined @ output, self.level, self.weight, first[0], gaps
        )
        g_combined = g[:, None] * output * combined * (1 - combined)
        g_hidden = g_combined @ V.T * hidden * (1 - hidden)
        grads, start = [], 0
        for sensor, W in zip(self.sensors, of_sensors[::2]):
            g_layer = g_hidden[:, start : start + W.shape[1]]
            start += W.shape[1]
            of_inputs = sensor.inputs.T @ (self.sum_by_trial @ g_layer)
            grads.append(np.vstack((of_inputs, self.positions @ g_layer)))
            grads.append(g_layer.sum(axis=0))
        grads += [hidden.T @ g_combined, g_combined.sum(axis=0), g @ combined]
        grads += [np.array([g_first]), g_gaps]
        total = self.weight.sum()
        for grad, part, alpha in zip(grads, parts, self.penalties()):
            loss += 0.5 * np.sum(alpha * part**2)
            grad += alpha * part
        return loss / total, np.concatenate([grad.ravel() for grad in grads]) / total


def divide(params, shapes):
    """Parts of a flat vector."""
    ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
    return [p.reshape(s) for p, s in zip(np.split(params, ends[:-1]), shapes)]


class EndToEnd(SensorFusionNNPOM):
    """The networks fitted apart, then optimised together from where they are."""

    def _fit_networks(self, X, positions, level, weight, levels, validation):
        super()._fit_networks(X, positions, level, weight, levels, validation)
        final, alpha = self.final_network_, self.estimator.alpha
        sensors = [Sensor(X[:, columns], alpha) for columns in self.sensors_.values()]
        networks = self.sensor_networks_.values()
        parts = [p for s, n in zip(sensors, networks) for p in s.from_network(n)]
        parts += [final.coefs_[0], final.intercepts_, final.coefs_[1]]
        first, gaps = final.thresholds_[:1], np.diff(final.thresholds_)
        parts += [first, np.log(np.expm1(gaps))]
        parts = self.start(parts, sensors)
        shapes = [part.shape for part in parts]
        cost = JointCost(sensors, positions, level, weight, alpha)
        found = minimize(
            cost,
            np.concatenate([part.ravel() for part in parts]),
            args=(shapes,),
            jac=True,
            method="L-BFGS-B",
            options={
                "maxiter": SOLVER["max_iter"],
                "gtol": SOLVER["tol"],
                "maxcor": 10,
            },
        )
        *of_sensors, V, c, output, first, gaps = divide(found.x, shapes)
        for i, (sensor, network) in enumerate(zip(sensors, networks)):
            sensor.to_network(network, *of_sensors[2 * i : 2 * i + 2])
        final.coefs_, final.intercepts_ = [V, output], c
        self.thresholds_ = final.thresholds_ = thresholds_from(first[0], gaps)
        return self

    def start(self, parts, sensors):
        return parts


class FromScratch(EndToEnd):
    """All networks optimised together from start values as `NNPOM` draws them."""

    def start(self, parts, sensors):
        rng = np.random.default_rng(0)
        parts = [rng.uniform(-0.5, 0.5, part.shape) for part in parts]
        for i, sensor in enumerate(sensors):
            of_features = rng.uniform(
                -0.5, 0.5, (len(sensor.centre), parts[2 * i].shape[1])
            )
            parts[2 * i][:-1] = sensor.axes.to_inputs(of_features)
        return parts


RIVALS = {
    APART: SensorFusionNNPOM,
    "together, from the networks fitted apart": EndToEnd,
    "together, from random values": FromScratch,
}


def scores_of(name, alpha, seed, folder, n_folds=None):
    """Scores of each object."""
    y = stacked(corpus_of(seed).ratings, ADJECTIVES)

    def predict(fold):
        network = NNPOM(10, alpha, **SOLVER)
        fusion = RIVALS[name](fold.sensors, network, network)
        model = DistributionalOrdinalRegressor(fusion, random_state=0)
        return each_adjective(model, fold.A, y[fold.train], fold.B)

    return out_of_fold(predict, y, seed, folder, n_folds=n_folds)


def end_to_end(folder):
    """Print the scores of networks optimised apart and together.

    Networks optimised apart also have the penalties chosen for the others, which tells
    the effect of the penalty from that of optimising together.
    """
    chosen = {}
    for name in RIVALS:
        rps = [scores_of(name, a, CHOICE, folder, 2)[:, 0].mean() for a in ALPHAS]
        chosen[name] = ALPHAS[int(np.argmin(rps))]
    rows = dict.fromkeys([*chosen.items(), *((APART, a) for a in chosen.values())])
    results = {seed: {} for seed in SEEDS}
    for name, alpha in rows:
        clock = Clock()
        for seed in SEEDS:
            scores = scores_of(name, alpha, seed, folder)
            results[seed][f"{name}, alpha {alpha:g}"] = scores
        seconds = clock.seconds() / len(SEEDS) / 5 / len(ADJECTIVES)
        print(f"{name}, alpha {alpha:g}: {seconds:.2f} s a fit", flush=True)
    report(results, f"{APART}, alpha {chosen[APART]:g}")
