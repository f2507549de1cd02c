"""What the paper leaves to others (section 4.2), measured on the synthetic corpus.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
        python benchmarks/paper_questions.py QUESTION [--cache FOLDER]

QUESTION is one of

    adjectives    all adjectives at once in the combined network, with holdouts
    positions     how many random quantile positions, for crowds of 5, 15 and 50
    ratings       careless raters and outlying answers: found, and left out
    touches       touches that went wrong: found, and left out
    end_to_end    sensors' networks and combined network optimised together
    dictionaries  atoms chosen for the adjective

Each prints tables for two corpora of 300 slow slides of 60 objects (seeds 0 and 1).
There are five folds; objects are kept whole, and what is learned or chosen never sees
the test objects. Settings are chosen on a third corpus (seed 2). Scores are means over
adjectives and objects; differences are paired, with standard errors over objects.
FOLDER keeps the features, which are computed once and shared by all questions.
"""

import argparse
import importlib
import warnings

from paper_questions_data import Clock
from sklearn.exceptions import ConvergenceWarning

MODULES = {
    "adjectives": "paper_questions_adjectives",
    "positions": "paper_questions_positions",
    "ratings": "paper_questions_outliers",
    "touches": "paper_questions_outliers",
    "end_to_end": "paper_questions_end_to_end",
    "dictionaries": "paper_questions_dictionaries",
}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("question", choices=MODULES)
    parser.add_argument("--cache", metavar="FOLDER")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", ConvergenceWarning)
    clock = Clock()
    module = importlib.import_module(MODULES[arguments.question])
    getattr(module, arguments.question)(arguments.cache)
    print(f"\n{clock}")


if __name__ == "__main__":
    main()
