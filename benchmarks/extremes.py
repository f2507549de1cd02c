"""Extreme input to this package and to its peers, and what each makes of it.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python benchmarks/extremes.py \
        [--parts codes dictionaries networks models] [--data FOLDER]

prints a Markdown table, in under a minute, a part in seconds. Peers are optional, best
in an environment of their own that has this package too:
``pip install spams-bin dictlearn numba skordinal``. Every call has a process of its
own, so that one that crashes ends nothing else. FOLDER holds ``*_stress.npz``:
parameters of ordinal networks, what ORCA makes of them, and cost and gradient in
arithmetic of 60 digits, for the part "networks", which is left out without it.
"""

import math
import warnings
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from signal import Signals

import numpy as np
from measure import command, head, machine
from measure import row as print_row
from mord import LogisticAT
from sklearn.decomposition import DictionaryLearning, SparseCoder
from sklearn.linear_model import orthogonal_mp_gram
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_haptic import NNPOM, KSVDTransformer

# Cost, gradient and probabilities at given parameters; in public they are only fitted.
from sklearn_haptic.models._network import Layout
from sklearn_haptic.models._network_loss import NetworkLoss
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


def row(case, functions, judge):
    """Print a row; peers of the same outcome share their words."""
    said = {}
    for name, function in functions.items():
        if name not in MODULES or find_spec(name):
            said.setdefault(outcome(function), []).append(name)
    ours = next(text for text, names in said.items() if OURS in names)
    peers = []
    for text, names in said.items():
        names = [name for name in names if name != OURS]
        if names:
            peers.append(f"{', '.join(names)}: {text}")
    print_row(case, "; ".join(peers), ours, judge)


# Sparse codes ---------------------------------------------------------------


def code_by_ksvd_transformer(signals, atoms, n_coefs):
    model = KSVDTransformer(
        len(atoms),
        n_coefs,
        dict_init=atoms,
        max_iter=0,
        remove_mean=False,
        sign="none",
    )
    return model.fit_transform(signals)


def code_by_sparse_coder(signals, atoms, n_coefs):
    return SparseCoder(atoms, transform_n_nonzero_coefs=n_coefs).transform(signals)


def code_by_gram(signals, atoms, n_coefs):
    gram, products = atoms @ atoms.T, atoms @ signals.T
    return orthogonal_mp_gram(gram, products, n_nonzero_coefs=n_coefs).T


def code_by_spams(signals, atoms, n_coefs):
    columns, dictionary = np.asfortranarray(signals.T), np.asfortranarray(atoms.T)
    codes = spams.omp(columns, dictionary, L=n_coefs, eps=0.0, numThreads=1)
    return codes.toarray().T


def code_by_dictlearn(signals, atoms, n_coefs):
    return dictlearn.SparseCoder(atoms, n_nonzero_coefs=n_coefs).fit_transform(signals)


CODERS = {
    OURS: code_by_ksvd_transformer,
    "SparseCoder": code_by_sparse_coder,
    "orthogonal_mp_gram": code_by_gram,
    "spams": code_by_spams,
    "dictlearn": code_by_dictlearn,
}


def unit_rows(rows):
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


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
    functions = {
        name: lambda coder=coder: code_error(coder, signals, atoms, n_coefs)
        for name, coder in CODERS.items()
    }
    judge = "refused in words"
    if np.isfinite(signals).all():
        codes = code_by_least_squares(signals, atoms, n_coefs)
        judge = f"least squares: {relative_error(codes, signals, atoms):.3f}"
    row(case, functions, judge)


def coding():
    rng = np.random.default_rng(0)
    atoms, signals = unit_rows(rng.normal(size=(20, 10))), rng.normal(size=(100, 10))
    single, single_atoms = signals.astype(np.float32), atoms.astype(np.float32)
    coding_row("Codes: signals of ordinary size", signals, atoms, 4)
    for size in ("1e-12", "1e-150", "1e150"):
        coding_row(f"signals × {size}", float(size) * signals, atoms, 4)
    for size in ("1e-30", "1e30"):
        scaled = np.float32(size) * single
        coding_row(f"float32 signals × {size}", scaled, single_atoms, 4)
    largest = np.float32(3e38) * (single / np.abs(single).max())
    coding_row("float32 signals up to 3e38", largest, single_atoms, 4)
    coding_row("3 atoms, 5 coefficients", signals, atoms[:3], 5)
    merged = unit_rows(atoms[:1] + 1e-9 * np.vstack((np.zeros(10), atoms[1])))
    coding_row("2 atoms 1e-9 apart", signals, merged, 2)
    coding_row(
        "NaN in a signal", np.where(signals == signals[0, 0], np.nan, signals), atoms, 4
    )


# Dictionaries ---------------------------------------------------------------


def learn_by_ksvd_transformer(signals, start):
    model = KSVDTransformer(len(start), 2, dict_init=start, remove_mean=False)
    return model.set_params(random_state=0).fit(signals).components_


def learn_by_scikit_learn(signals, start):
    model = DictionaryLearning(
        len(start),
        alpha=0.1 * (np.abs(signals).max() or 1),  # in the units of the signals
        max_iter=50,
        dict_init=start,
        random_state=0,
    )
    return model.fit(signals).components_


def learn_by_spams(signals, start):
    atoms = spams.trainDL(
        np.asfortranarray(signals.T),
        D=np.asfortranarray(start.T),
        mode=3,
        lambda1=2,
        iter=100,
        numThreads=1,
        verbose=False,
    )
    return np.asarray(atoms).T


def learn_by_dictlearn(signals, start):
    model = dictlearn.DictionaryLearning(
        len(start),
        fit_algorithm="aksvd",
        n_nonzero_coefs=2,
        max_iter=50,
        dict_init=start,
        random_state=0,
    )
    return model.fit(signals).components_


LEARNERS = {
    OURS: learn_by_ksvd_transformer,
    "DictionaryLearning": learn_by_scikit_learn,
    "spams": learn_by_spams,
    "dictlearn": learn_by_dictlearn,
}


def learning_row(case, signals, start, judge):
    def learn(learner):
        atoms = learner(signals, start)
        if not np.isfinite(atoms).all():
            return "NaN atoms"
        n_unit = np.isclose(np.linalg.norm(atoms, axis=1), 1, rtol=1e-6).sum()
        text = f"{n_unit} of {len(start)} atoms of norm 1"
        if signals.any():
            codes = code_by_least_squares(signals, atoms, 2)
            text += f", error {relative_error(codes, signals, atoms):.3f}"
        return text

    functions = {
        name: lambda learner=learner: learn(learner)
        for name, learner in LEARNERS.items()
    }
    row(case, functions, judge)


def learning():
    rng = np.random.default_rng(0)
    planted, start = (unit_rows(rng.normal(size=(8, 12))) for _ in range(2))
    codes = rng.normal(size=(300, 8))
    codes[rng.random(codes.shape).argsort(axis=1).argsort(axis=1) >= 2] = 0
    signals = codes @ planted
    codes = code_by_least_squares(signals, planted, 2)
    judge = f"error over planted atoms: {relative_error(codes, signals, planted):.3f}"
    learning_row("Dictionaries: signals of ordinary size", signals, start, judge)
    for size in ("1e-12", "1e-150", "1e150"):
        scaled = float(size) * signals
        learning_row(f"signals × {size}", scaled, start, "the row of ordinary size")
    learning_row("all signals zero", 0 * signals, start, "atoms of norm 1")


# Ordinal models -------------------------------------------------------------


def costs(case):
    """ORCA's, skordinal's and our cost and gradient at parameters in ORCA's layout."""
    X, y = case["X_train"], case["y_train"].ravel().astype(int)
    n_hidden, penalty = case["hidden"].item(), case["lam"].item()
    params, n_features = case["params"].ravel(), X.shape[1]
    yield "ORCA", case["orca_cost"].item(), case["orca_grad"].ravel()
    if find_spec("skordinal"):
        indicator = (y[:, None] == np.unique(y)).astype(int)
        sizes = n_features, n_hidden, indicator.shape[1]
        yield "skordinal", *Peer()._objective(params, *sizes, X, indicator, penalty)

    layer, output, t = np.split(
        params, np.cumsum((n_hidden * (n_features + 1), n_hidden))
    )
    layer = layer.reshape(n_hidden, n_features + 1, order="F")
    gap_logits = t[1:] ** 2 + np.log(-np.expm1(-(t[1:] ** 2)))  # its gaps are squares
    ours = np.concatenate(
        (layer[:, 1:].T.ravel(), layer[:, 0], output, t[:1], gap_logits)
    )
    level, weight = y[:, None] - 1, np.ones((len(y), 1))
    layout = Layout(n_features, n_hidden, (len(t) + 1,))
    cost, grad = NetworkLoss(layout, X, [(None, level, weight)], penalty)(ours)
    coef, bias, [(output, first, gaps)] = layout.split(grad)
    gaps = gaps * 2 * t[1:] / -np.expm1(-(t[1:] ** 2))
    layer = np.column_stack((bias, coef.T)).ravel(order="F")
    yield OURS, cost, np.concatenate((layer, output, first, gaps))


def stressed(folder):
    for path in sorted(folder.glob("*_stress.npz")):
        case = np.load(path)
        exact_cost, exact_grad = case["exact_cost"].item(), case["exact_grad"].ravel()
        largest = np.abs(exact_grad).max()
        texts = {}
        for name, cost, grad in costs(case):
            errors = cost / exact_cost - 1, (grad - exact_grad) / largest
            texts[name] = "cost off by {:.0e}, gradient by {:.0e}".format(
                *(np.abs(error).max() for error in errors)
            )
            if not (np.isfinite(cost) and np.isfinite(grad).all()):
                n_lost = (~np.isfinite(grad)).sum()
                texts[name] = f"cost {cost}, {n_lost} of {len(grad)} slopes not finite"
        functions = {name: lambda text=text: text for name, text in texts.items()}
        data = path.name.split("_")[0]
        row(f"Network of saturated units, {data}", functions, "60 digits")


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


def model_row(case, describe, judge, models=MODELS):
    functions = {
        name: lambda make=make: describe(make) for name, make in models.items()
    }
    row(case, functions, judge)


def described(model, X, y, ratings):
    """Columns of the probabilities, and how often the ratings are predicted."""
    proba = model.fit(X, y).predict_proba(X)
    if not np.isfinite(proba).all():
        return "NaN probabilities"
    right = np.mean(model.predict(X) == ratings)
    return f"{proba.shape[1]} columns, {right:.0%} right"


def with_levels(make, levels):
    """A model, told all levels if it can be."""
    return make(levels=levels) if make is MODELS[OURS] else make()


def log_score(model, X, y):
    """In training, in nats."""
    proba = model.fit(X, y).predict_proba(X)
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
    row(
        "Probability of a level that begins 41 above the response",
        {name: lambda tail=tail: f"{tail():.2e}" for name, tail in tails.items()},
        f"exp(-41) / (1 + exp(-41)) = {math.exp(-41):.2e}",
    )
    line, thirds = np.arange(60.0)[:, None] - 29.5, np.arange(60) // 20
    model_row(
        "Three separable levels, alpha = 0",
        lambda make: described(make(alpha=0), line, thirds, thirds),
        "100% right",
    )
    gap = np.where(y == 2, 1, y)
    model_row(
        "A level of five that nobody gave",
        lambda make: described(with_levels(make, range(5)), X, gap, gap),
        "5 columns",
    )
    model_row("One rating of weight 1 between two of 1e12", rare, f"{1 / 2e12:.2e}")
    model_row(
        "Log score in training", lambda make: log_score(make(), X, y), "next two rows"
    )
    for change, shifted in {"× 1e12": 1e12 * X, "+ 1e6": X + 1e6}.items():
        model_row(
            f"the same, features {change}",
            lambda make, shifted=shifted: log_score(make(), shifted, y),
            "the row before",
            MODELS | STANDARDISED,
        )
    model_row(
        "Features × 1e-310",
        lambda make: described(make(), 1e-310 * X, y, y),
        "as without, or refused in words",
    )


PARTS = {"codes": coding, "dictionaries": learning, "models": ordinal}


def main():
    parser = command(__doc__)
    parser.add_argument("--parts", nargs="+", choices=[*PARTS, "networks"])
    parser.add_argument("--data", type=Path, metavar="FOLDER")
    arguments = parser.parse_args()
    parts = PARTS | {"networks": lambda: stressed(arguments.data)}
    machine("mord", "spams-bin", "dictlearn", "skordinal")
    head("case", "peers", "this package", "judged by")
    for name in arguments.parts or parts:
        if name != "networks" or arguments.data:
            parts[name]()


if __name__ == "__main__":
    main()
