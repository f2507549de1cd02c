"""A generated haptic corpus of the shape and statistics of PHAC-2.

Objects of eight materials have latent properties. These drive what the robot's
sensors record (`_simulated_touch`) and, together with a share that no robot can feel,
how people rate the objects. Each person perceives six qualities of an object,
imperfectly, and turns them into ten ratings from 1 to 5 with habits of their own. All
errors are normal, so the distribution of ratings in the whole population is known
exactly: it is a cumulative probit model.
"""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral

import numpy as np
import pandas as pd
from scipy.special import ndtr
from sklearn.utils import Bunch, check_random_state

from ..recordings._biotac import (
    PROCEDURES,
    SENSORS,
    Procedure,
    check_procedures,
    columns_of,
    rates_of,
)
from ..utils._sklearn import Interval, Names, RandomState, StrOptions, validate_params
from ..utils._validation import check_names
from ._simulated_touch import draw_conditions, touch

PERCEPTS = ("firm", "rough", "slick", "cold", "lively", "tacky")
LEVELS = np.arange(1, 6)
_CUTS = LEVELS[:-1] + 0.5

# Per adjective: mean rating of an average object; rating points per standard deviation
# (sd) of each percept, in the order of PERCEPTS; sd of a person's error.
_ADJECTIVES = {
    "hard": (3.0, (2.2, 0, 0, 0, 0, 0), 0.35),
    "soft": (2.5, (-1.7, -0.7, 0, 0, 0, 0), 0.45),
    "rough": (1.4, (0, 1.3, 0, 0, 0, 0), 0.50),
    "smooth": (3.0, (0.4, -1.5, 0.4, 0, 0, 0), 0.75),
    "slippery": (1.7, (0.3, -0.6, 0.8, 0, 0, 0), 0.50),
    "sticky": (0.5, (0, 0, 0, 0, 0, 0.4), 0.45),
    "cold": (1.6, (0.2, 0, 0, 1.2, 0, 0), 0.45),
    "warm": (1.2, (-0.1, 0, 0, -0.4, 0, 0), 0.70),
    "moldable": (2.3, (-1.2, 0, 0, 0, 0.8, 0), 0.80),
    "springy": (2.3, (-1.1, 0, 0, 0, 1.1, 0), 0.80),
}
ADJECTIVES = tuple(_ADJECTIVES)
_MEANS = np.array([mean for mean, _, _ in _ADJECTIVES.values()])
_LOADINGS = np.array([loading for _, loading, _ in _ADJECTIVES.values()], float).T
_ERRORS = np.array([error for _, _, error in _ADJECTIVES.values()])
# Sd of one person's perception of each percept, in units of the percept's sd.
_PERCEPTION = np.array([0.25, 0.4, 0.4, 0.35, 0.7, 0.4])
_BIAS = 0.3  # sd of a person's shift of an adjective's ratings
_STRETCH = 0.15  # sd of a person's relative use of the scale about its middle

# Per material: first digit of its ids, share of the objects, median compression beyond
# that of the finger itself (mm) and standard deviation of its logarithm, relaxation,
# conduction, roughness, friction and liveliness.
_MATERIALS = {
    "foam": (1, 16, 10.0, 0.40, 0.240, 0.08, 0.2, 0.65, 0.8),
    "plastic": (2, 13, 1.9, 0.90, 0.030, 0.52, -0.4, 0.38, 0.0),
    "paper": (3, 12, 2.8, 0.70, 0.040, 0.47, -0.4, 0.38, -0.3),
    "fabric": (4, 7, 7.0, 0.35, 0.170, 0.14, 0.4, 0.50, -0.2),
    "organic": (5, 5, 3.0, 0.50, 0.050, 0.42, 1.2, 0.55, -0.4),
    "stone": (5, 2, 1.1, 0.30, 0.021, 0.97, 1.3, 0.60, -0.9),
    "glass": (6, 2, 0.9, 0.30, 0.020, 0.80, -1.4, 0.30, -0.9),
    "metal": (7, 3, 1.0, 0.30, 0.020, 1.00, -0.9, 0.30, -0.9),
}
# How much of a percept's standard deviation the robot can feel.
_TANGIBLE = np.array([0.97, 0.8, 0.7, 0.9, 0.6, 0.0])

_DESCR = """Synthetic haptic corpus
=======================

{n_objects} objects touched {n_trials} times each ({procedure}), each rated by
{n_raters} people on ten adjectives from 1 to 5. Signals are counts above rest of two
BioTac fingers, finger 0 first; nothing was recorded. The statistics follow those
published for PHAC-2 (Chu et al. 2015, https://doi.org/10.1016/j.robot.2014.09.021;
Richardson and Kuchenbecker 2020, https://doi.org/10.3389/fnbot.2019.00116).

trials        one row per trial, one column per sensor
objects       object id of each trial
object_names  name of each trial's object
ratings       adjective -> how many people chose each level, per trial
rater_ratings each person's ratings, one row per object and person
true_proba    adjective -> probability of each level in the whole population
properties    latent properties of each object
"""


@validate_params(
    {
        "n_objects": [Interval(Integral, 1, None, closed="left")],
        "n_trials": [Interval(Integral, 1, None, closed="left")],
        "procedure": [StrOptions(set(PROCEDURES)), "array-like"],
        "sensors": ["array-like", None],
        "n_raters": [Interval(Integral, 1, None, closed="left")],
        "random_state": ["random_state"],
    },
    prefer_skip_nested_validation=True,
)
def make_haptic_corpus(
    n_objects: int = 60,
    n_trials: int = 10,
    procedure: Procedure | Sequence[Procedure] = "hold",
    *,
    sensors: Names | None = None,
    n_raters: int = 12,
    random_state: RandomState = None,
) -> Bunch:
    """Generate a corpus of robotic touches of objects and of people's ratings.

    The corpus has the shape and statistics of PHAC-2 and stands in for it where its
    recordings are not at hand. Latent properties of each object (compliance, heat
    conduction, texture, friction, …) drive both the signals of five sensors in each of
    two BioTac fingers and a crowd's ratings on ten adjectives. As in the real corpus,
    the robot can feel much of hardness and cold, and little of texture.

    Parameters
    ----------
    n_objects : int, default=60
        Number of objects, of eight materials in the shares of PHAC-2.
    n_trials : int, default=10
        How many times the robot touches each object. A trial does not depend on the
        number of trials.
    procedure : {"squeeze", "hold", "slow_slide", "fast_slide"} or list of them, \
            default="hold"
        The exploratory procedure. With one seed, all procedures have the same
        objects, trials and ratings. Of a list, each trial has all procedures, in
        columns such as ``"hold_pac"``.
    sensors : array-like of str, default=None
        Some of ``"pac"``, ``"pdc"``, ``"tac"``, ``"tdc"`` and ``"electrodes"``, in
        the order of the columns wanted; by default all, in this order. The signals
        of a sensor do not depend on which others are asked for.
    n_raters : int, default=12
        How many people rate each object. There are three groups of people, each of
        which rates a third of the objects.
    random_state : int, RandomState instance or None, default=None
        Seed of objects, touches and ratings. Pass an int for the same corpus in
        every call.

    Returns
    -------
    corpus : :class:`~sklearn.utils.Bunch`
        Dictionary-like object with the attributes of
        :func:`~sklearn_haptic.datasets.load_phac2`, where signals are in counts above
        rest, an object is named by its material, and the number of a person stands for
        different people in the three groups; and with the truth behind them:

        true_proba : dict of str to ndarray of shape (n_objects * n_trials, 5)
            For each adjective, the probability of each level in the population of
            which the raters are a sample.
        properties : DataFrame of shape (n_objects, n_properties)
            The latent properties of each object, indexed by its id: compression
            in mm, relaxation as a fraction in ten seconds, coefficient of friction,
            conduction and firmness from about 0 to 1, roughness and liveliness as
            standard scores, and the logarithms of four gains that depend on shape
            alone and that people do not rate.

    Raises
    ------
    ValueError
        If a number is below 1, or a procedure or sensor is unknown.

    See Also
    --------
    load_phac2 : The real corpus.

    Notes
    -----
    The crowd reproduces what was published of the real ratings [1]_: on which
    adjectives people agree (medians of r_wg above .75, above .70 or below), that
    hardly anything is sticky, and Spearman's correlations of all single ratings.
    Over eight seeds these are on average −.75 for hard–soft (published: −.71), −.70
    for rough–smooth (−.64), −.35 for cold–warm (−.30), .72 for moldable–springy (.70)
    and within .04 of 0 for sticky. All other correlations are guesses, and so is how
    people differ on one object (those who call it harder call it less soft: −.28).

    References
    ----------
    .. [1] Richardson and Kuchenbecker (2020). :doi:`10.3389/fnbot.2019.00116`
    .. [2] V. Chu et al., "Robotic learning of haptic adjectives through physical
       interaction", Robotics and Autonomous Systems 63, 279–292, 2015,
       :doi:`10.1016/j.robot.2014.09.021`.

    Examples
    --------
    >>> from sklearn_haptic.datasets import make_haptic_corpus
    >>> corpus = make_haptic_corpus(20, 2, sensors=["pdc", "tdc"], random_state=0)
    >>> corpus.trials.shape
    (40, 2)
    >>> corpus.trials["pdc"].iloc[0].shape
    (1000, 2)
    >>> corpus.ratings["hard"].shape
    (40, 5)
    """
    sensors = check_names(sensors, list(SENSORS), "sensor", "the corpus")
    procedures = check_procedures(procedure, "the corpus")
    columns = sensors if isinstance(procedure, str) else columns_of(procedures, sensors)
    seed = int(check_random_state(random_state).randint(np.iinfo(np.int32).max))

    properties = _draw_properties(n_objects, np.random.default_rng([seed, 0]))
    crowd_rng = np.random.default_rng([seed, 1])
    percepts = _percepts(properties, crowd_rng)
    groups = crowd_rng.permutation(n_objects) % 3
    answers = rate(percepts, groups, n_raters, crowd_rng)
    counts = (answers[..., None] == LEVELS).sum(axis=1)
    proba = population(percepts)

    materials = [dict(zip(properties, row)) for row in zip(*properties.values())]
    cells = {column: np.empty(n_objects * n_trials, dtype=object) for column in columns}
    for i, material in enumerate(materials):
        for run in range(n_trials):
            signals = _touch_by_all(material, procedures, sensors, (seed, i, run))
            for column, signal in zip(columns, signals):
                cells[column][i * n_trials + run] = signal

    ids = properties.pop("object_id")
    of_object = np.repeat(np.arange(n_objects), n_trials)
    names = [
        f"{material}_{identity}_{run:02d}"
        for material, identity in zip(properties["material"], ids)
        for run in range(1, n_trials + 1)
    ]
    return Bunch(
        trials=pd.DataFrame(cells, index=pd.Index(names, name="trial", dtype=object)),
        objects=ids[of_object],
        object_names=properties["material"][of_object],
        ratings={a: counts[of_object, k] for k, a in enumerate(ADJECTIVES)},
        levels=LEVELS.copy(),
        sampling_rates=rates_of(columns),
        rater_ratings=pd.DataFrame(
            answers.reshape(-1, len(ADJECTIVES)),
            index=pd.MultiIndex.from_product(
                [ids, range(1, n_raters + 1)], names=["object", "rater"]
            ),
            columns=list(ADJECTIVES),
        ),
        true_proba={a: proba[of_object, k] for k, a in enumerate(ADJECTIVES)},
        properties=pd.DataFrame(properties, index=pd.Index(ids, name="object")),
        DESCR=_DESCR.format(
            n_objects=n_objects,
            n_trials=n_trials,
            procedure=", ".join(procedures),
            n_raters=n_raters,
        ),
    )


def _draw_properties(n_objects, rng):
    """Draw the properties of objects, ordered by id, with materials in their shares."""
    table = np.array(list(_MATERIALS.values()))
    ends = np.cumsum(table[:, 1]) / table[:, 1].sum()
    which = np.searchsorted(ends, (np.arange(n_objects) + 0.5) / n_objects)
    digit, _, excess, spread, lost, conduction, rough, friction, lively = table[which].T
    z = rng.normal(size=(n_objects, 6)).T
    compression = 3.9 + excess * np.exp(spread * z[0])
    roughness = rough + 0.75 * z[3]
    friction = friction * np.exp(0.22 * z[4] + 0.08 * roughness)
    quirks = rng.normal(size=(n_objects, 4)).T
    hundred = 10 ** max(2, len(str(n_objects)))
    digit = digit.astype(int)
    place = np.arange(n_objects) - np.searchsorted(digit, digit) + 1
    return {
        "object_id": digit * hundred + place,
        "material": np.array(list(_MATERIALS))[which],
        "compression": compression,
        "firmness": 1 - np.log(compression / 4.4) / np.log(5),
        "relaxation": lost * np.exp(0.25 * z[0] + 0.25 * z[1]),
        "conduction": np.clip(conduction - 0.06 * z[0] + 0.08 * z[2], 0.02, 1.05),
        "roughness": roughness,
        "friction": friction,
        "liveliness": lively + 0.7 * z[5],
        "grip": 0.17 * quirks[0],
        "buzz": 0.35 * quirks[1],
        "shear": 0.2 * quirks[2],
        "contact": 0.18 * quirks[3],
    }


def _percepts(properties, rng):
    """Return standard scores (n_objects, 6) of what people feel of each object."""
    felt = [
        (properties["firmness"] - 0.62) / 0.33,
        properties["roughness"] / 0.95,
        np.log(0.45 / properties["friction"]) / 0.35,
        (properties["conduction"] - 0.4) / 0.29,
        properties["liveliness"] / 0.8,
        np.zeros_like(properties["firmness"]),
    ]
    unfelt = rng.normal(size=(len(felt[0]), len(PERCEPTS)))
    return _TANGIBLE * np.transpose(felt) + np.sqrt(1 - _TANGIBLE**2) * unfelt


def _touch_by_all(material, procedures, sensors, trial):
    """Yield the signals of one trial, sensor by sensor in each procedure."""
    for i in map(PROCEDURES.index, procedures):
        # Random streams depend on seed, object and run alone.
        conditions = draw_conditions(np.random.default_rng([*trial, 2]))

        def stream(k, at=3 + i):
            return np.random.default_rng([*trial, at, k])

        yield from touch(material, conditions, PROCEDURES[i], sensors, stream).values()


def population(percepts):
    """Return the distribution of ratings in the whole population.

    Percepts are standard scores of shape (n_objects, 6), in the order of ``PERCEPTS``;
    the probabilities of each level of each adjective have the shape (n_objects, 10, 5).
    """
    centre = _MEANS + percepts @ _LOADINGS
    variance = (
        _ERRORS**2
        + _BIAS**2
        + _PERCEPTION**2 @ _LOADINGS**2
        + _STRETCH**2 * (centre - 3) ** 2
    )
    below = ndtr((_CUTS - centre[..., None]) / np.sqrt(variance)[..., None])
    return np.diff(below, axis=-1, prepend=0.0, append=1.0)


def rate(percepts, groups, n_raters, rng):
    """Draw the ratings of disjoint groups of people, each with its own objects.

    Percepts are as in `population`; `groups` tells which group of people, of `n_raters`
    each, rates each object. The levels, from 1 to 5, have the shape (n_objects,
    n_raters, 10).
    """
    people = (groups.max() + 1, n_raters, len(ADJECTIVES))
    bias = rng.normal(scale=_BIAS, size=people)[groups]
    stretch = rng.normal(scale=_STRETCH, size=people)[groups]
    shape = (len(percepts), n_raters)
    slips = rng.normal(scale=_PERCEPTION, size=(*shape, len(PERCEPTS)))
    errors = rng.normal(scale=_ERRORS, size=(*shape, len(ADJECTIVES)))
    centre = (_MEANS + percepts @ _LOADINGS)[:, None]
    latent = centre + stretch * (centre - 3) + bias + slips @ _LOADINGS + errors
    return 1 + np.searchsorted(_CUTS, latent)
