"""Extreme input to this package and to its peers, and what each makes of it.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/extremes.py \
        [--parts codes models]

prints a Markdown table, in under a minute. Peers are optional, best in an environment
of their own that has this package too: ``pip install spams-bin dictlearn numba
skordinal``. Every call has a process of its own, so that one that crashes ends nothing
else.
"""

import math
import warnings
from functools import partial
from importlib.util import find_spec
from multiprocessing import get_context
from signal import Signals

import numpy as np
from measure import command, head, machine, unit_rows
from measure import row as print_row
from mord import LogisticAT
from sklearn.decomposition import SparseCoder
from sklearn.linear_model import orthogonal_mp_gram
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import NNPOM, KSVDTransformer

# Probabilities at given parameters; in public these are only fitted.
from sklearn_haptic.models._proportional_odds import level_probabilities

if find_spec("spams"):
    import spams
if find_spec("dictlearn"):
    import dictlearn
if find_spec("skordinal"):
    from skordinal.classifiers import NNPOM as Peer

OURS = "this package"
MODULES = {"spams", "dictlearn", "skordinal"}


def outcome(function, seconds=60):
    """The text that a function returns, or how it or its process ended."""

    def run():
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            warnings.simplefilter("ignore", DeprecationWarning)
            try:
                text = function()
            except Exception as error:
                sentence = " ".join(str(error).split()).split(". ")[0]
                text = f"{type(error).__name__}: {sentence[:120].rstrip('.')}"
        sender.send(text + ", with a warning" * bool(caught))

    context = get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=run)
    process.start()
    process.join(seconds)
    if process.is_alive():
        process.kill()
        return f"not done after {seconds} s"
    if process.exitcode < 0:
        return f"ends the process ({Signals(-process.exitcode).name})"
    return receiver.recv()


def row(case, judge, rivals, describe, *given):
    """Print what is said of each rival; peers of the same outcome share their words."""
    said = {}
    for name, rival in rivals.items():
        if name not in MODULES or find_spec(name):
            text = outcome(partial(describe, rival, *given))
            said.setdefault(text, []).append(name)
    ours = next(text for text, names in said.items() if OURS in names)
    peers = {t: ", ".join(n for n in names if n != OURS) for t, names in said.items()}
    peers = "; ".join(f"{names}: {text}" for text, names in peers.items() if names)
    print_row(case, peers, ours, judge)


# Sparse codes ---------------------------------------------------------------


def code_by_ksvd_transformer(signals, atoms, n_coefs):
    model = KSVDTransformer(
        len(atoms), n_coefs, dict_init=atoms, max_iter=0, remove_mean=False, sign="none"
    )
    return model.fit_transform(signals)


def code_by_gram(signals, atoms, n_coefs):
    gram, products = atoms @ atoms.T, atoms @ signals.T
    return orthogonal_mp_gram(gram, products, n_nonzero_coefs=n_coefs).T


def code_by_spams(signals, atoms, n_coefs):
    columns, dictionary = np.asfortranarray(signals.T), np.asfortranarray(atoms.T)
    codes = spams.omp(columns, dictionary, L=n_coefs, eps=0.0, numThreads=1)
    return codes.toarray().T


CODERS = {
    OURS: code_by_ksvd_transformer,
    "SparseCoder": lambda X, D, n: SparseCoder(
        D, transform_n_nonzero_coefs=n
    ).transform(X),
    "orthogonal_mp_gram": code_by_gram,
    "spams": code_by_spams,
    "dictlearn": lambda X, D, n: dictlearn.SparseCoder(
        D, n_nonzero_coefs=n
    ).fit_transform(X),
}


def relative_error(codes, signals, atoms):
    """Norm of what codes leave of signals, relative to that of the signals."""
    unit = np.abs(signals).max().astype(float)
    codes, signals = codes.astype(float) / unit, signals.astype(float) / unit
    return np.linalg.norm(signals - codes @ atoms) / np.linalg.norm(signals)


def code_by_least_squares(signals, atoms, n_coefs):
    """Orthogonal matching pursuit by its definition, in double precision."""
    unit = np.abs(signals).max().astype(float)
    norms = np.linalg.norm(atoms.astype(float), axis=1)
    norms[norms == 0] = 1
    atoms = atoms / norms[:, None]
    codes = np.zeros((len(signals), len(atoms)))
    for signal, code in zip(signals / unit, codes):
        taken, residual = [], signal
        for _ in range(min(n_coefs, *atoms.shape)):
            score = np.abs(atoms @ residual)
            if score.max() < 1e-10 * np.linalg.norm(signal):
                break
            taken.append(score.argmax())
            coefs = np.linalg.lstsq(atoms[taken].T, signal)[0]
            residual = signal - coefs @ atoms[taken]
        code[taken] = coefs if taken else 0
    return unit * codes / norms


def code_error(coder, signals, atoms, n_coefs):
    codes = coder(signals, atoms, n_coefs)
    lost = ~np.isfinite(codes).all(axis=1)
    if lost.any():
        return f"NaN for {lost.sum()} of {len(codes)} signals, and no error"
    if not codes.any():
        return "all codes zero"
    return f"{relative_error(codes, signals, atoms):.3f}"


def coding_row(case, signals, atoms, n_coefs):
    judge = "refused in words"
    if np.isfinite(signals).all():
        codes = code_by_least_squares(signals, atoms, n_coefs)
        judge = f"least squares: {relative_error(codes, signals, atoms):.3f}"
    row(case, judge, CODERS, code_error, signals, atoms, n_coefs)


def coding():
    rng = np.random.default_rng(0)
    atoms, signals = unit_rows(rng.normal(size=(20, 10))), rng.normal(size=(100, 10))
    single, single_atoms = signals.astype(np.float32), atoms.astype(np.float32)
    for size in ("1", "1e-12", "1e-150"):
        coding_row(f"Codes: signals × {size}", float(size) * signals, atoms, 4)
    largest = 3e38 / np.abs(single).max()
    for size in ("1e-30", "1e30", f"{largest:.2g}"):
        scaled = np.float32(size) * single
        coding_row(f"float32 signals × {size}", scaled, single_atoms, 4)
    coding_row("3 atoms, 5 coefficients", signals, atoms[:3], 5)
    merged = unit_rows(atoms[:1] + 1e-9 * np.vstack((np.zeros(10), atoms[1])))
    coding_row("2 atoms 1e-9 apart", signals, merged, 2)
    missing = np.where(signals == signals[0, 0], np.nan, signals)
    coding_row("NaN in a signal", missing, atoms, 4)


# Ordinal models -------------------------------------------------------------


def tail_of_ours():
    return level_probabilities(np.array([-40.0]), np.array([-1.0, 0.0, 1.0]))[0, -1]


def tail_of_mord():
    model = LogisticAT()
    model.coef_, model.theta_ = np.array([1.0]), np.array([-1.0, 0.0, 1.0])
    return model.predict_proba(np.array([[-40.0]]))[0, -1]


def tail_of_skordinal():
    model = Peer(n_hidden=1).fit([[0.0], [1.0], [2.0], [3.0]], [0, 1, 2, 3])
    model.theta1_, model.theta2_ = np.zeros((1, 2)), np.array([[-80.0]])
    model.thresholds_ = np.array([-1.0, 0.0, 1.0])
    return model.predict_proba([[0.0]])[0, -1]


MODELS = {
    OURS: lambda **params: NNPOM(0, random_state=0, **params),
    "mord": LogisticAT,
    "skordinal": lambda **params: Peer(n_hidden=3, random_state=0, **params),
}
STANDARDISED = {
    f"{name} after StandardScaler": lambda make=make: make_pipeline(
        StandardScaler(), make()
    )
    for name, make in MODELS.items()
    if name != OURS and (name not in MODULES or find_spec(name))
}


def touches():
    """Features, and ratings from 0 to 4."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(80, 3))
    latent = X @ [1.5, -1.0, 0.5] + rng.logistic(size=80)
    return X, np.digitize(latent, [-3, -1, 1, 3])


def described(make, X, y, ratings, **params):
    """Columns of the probabilities, and how often the ratings are predicted."""
    model = make(**params) if make is MODELS[OURS] or "levels" not in params else make()
    proba = model.fit(X, y).predict_proba(X)
    if not np.isfinite(proba).all():
        return "NaN probabilities"
    right = np.mean(model.predict(X) == ratings)
    return f"{proba.shape[1]} columns, {right:.0%} right"


def log_score(make, X, y):
    """In training, in nats."""
    proba = make().fit(X, y).predict_proba(X)
    with np.errstate(divide="ignore"):
        return f"{-np.log(proba[np.arange(len(y)), y]).mean():.3f}"


def rare(make):
    """Probability of a rating of weight 1, without features."""
    weight = np.array([1e12, 1, 1e12])
    X = np.zeros((3, 1))
    model = make().fit(X, np.arange(3), sample_weight=weight)
    return f"{model.predict_proba(X)[0, 1]:.2e}"


def ordinal():
    X, y = touches()
    tails = {OURS: tail_of_ours, "mord": tail_of_mord, "skordinal": tail_of_skordinal}
    case = "Probability of a level that begins 41 above the response"
    judge = f"exp(-41) / (1 + exp(-41)) = {math.exp(-41):.2e}"
    row(case, judge, tails, lambda tail: f"{tail():.2e}")
    line, thirds = np.arange(60.0)[:, None] - 29.5, np.arange(60) // 20
    separable = partial(described, alpha=0)
    case = "Three separable levels, alpha = 0"
    row(case, "100% right", MODELS, separable, line, thirds, thirds)
    gap = np.where(y == 2, 1, y)
    told = partial(described, levels=range(5))  # if it can be
    row("A level of five that nobody gave", "5 columns", MODELS, told, X, gap, gap)
    row("One rating of weight 1 between two of 1e12", f"{1 / 2e12:.2e}", MODELS, rare)
    for change, shifted in {"": X, " × 1e12": 1e12 * X, " + 1e6": X + 1e6}.items():
        case = f"Log score in training, features{change}"
        rivals = MODELS | STANDARDISED if change else MODELS
        row(case, "as without", rivals, log_score, shifted, y)
    for change, scaled in {"": X, " × 1e-310": 1e-310 * X}.items():
        case = f"Share of right ratings, features{change}"
        row(case, "as without, or refused in words", MODELS, described, scaled, y, y)


PARTS = {"codes": coding, "models": ordinal}


def main():
    parser = command(__doc__)
    parser.add_argument("--parts", nargs="+", default=list(PARTS), choices=PARTS)
    arguments = parser.parse_args()
    machine("mord", "spams-bin", "dictlearn", "skordinal")
    head("case", "peers", "this package", "judged by")
    for name in arguments.parts:
        PARTS[name]()


if __name__ == "__main__":
    main()
