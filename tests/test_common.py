"""scikit-learn's own checks on every estimator, none expected to fail."""

import pytest
from sklearn.base import BaseEstimator
from sklearn.kernel_ridge import KernelRidge
from sklearn.linear_model import LogisticRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import estimator_checks
from sklearn.utils.estimator_checks import parametrize_with_checks

import sklearn_haptic
from sklearn_haptic import (
    NNPOM,
    AnytimeRegressor,
    ConformalRatings,
    ContinuousRatingsRegressor,
    DistributionalOrdinalRegressor,
    DistributionBlend,
    DummyDistribution,
    KSVDTransformer,
    NoveltyGuard,
    RegressedDistribution,
    RepairTrials,
    SensorFusionNNPOM,
    SignalStatistics,
    STHMPTransformer,
    TemporalMaxPool,
    TouchPool,
)

pytestmark = pytest.mark.slow

TRANSFORMERS = [
    KSVDTransformer(),
    KSVDTransformer(5, 2, update="exact", sign="none", remove_mean=False),
    KSVDTransformer(5, 2, sign="absolute", max_train_windows=20),
    STHMPTransformer(),
    TemporalMaxPool(),
    TemporalMaxPool(split="floor"),
    TemporalMaxPool((2, 1), statistics=("mean", "share", "max")),
    SignalStatistics(),
    SignalStatistics(("bands",), n_bands=5),
    RepairTrials(),
    RepairTrials(limits=(-100, 100), rest=2),
]
PREDICTORS = [
    # With this tolerance weights equal repeated rows to seven digits.
    NNPOM(n_hidden=3, tol=1e-10, max_iter=5000),
    NNPOM(n_hidden=0, tol=1e-10),
    NNPOM(2, gaps="squared", solver="irprop+", tol=1e-10, max_iter=10_000),
    DistributionalOrdinalRegressor(NNPOM(0, tol=1e-10)),
    DistributionalOrdinalRegressor(
        LogisticRegression(tol=1e-12, max_iter=5000), decode="quantile"
    ),
    SensorFusionNNPOM(
        estimator=NNPOM(n_hidden=2, tol=1e-10, max_iter=5000),
        final_estimator=NNPOM(n_hidden=2, tol=1e-10, max_iter=5000),
    ),
    DummyDistribution(),
    DummyDistribution("barycentre"),
    RegressedDistribution(Ridge()),
    RegressedDistribution(KernelRidge(), random_state=0),
    DistributionBlend(
        [("ordinal", NNPOM(0, tol=1e-10)), ("ridge", RegressedDistribution(Ridge()))]
    ),
    ContinuousRatingsRegressor(NNPOM(0, tol=1e-10), n_cells=5),
    ConformalRatings(NNPOM(0, tol=1e-10)),
]
# Their X is no table, so that scikit-learn's suite leaves them out.
OF_TRIALS = [
    AnytimeRegressor(
        make_pipeline(TemporalMaxPool(), DistributionalOrdinalRegressor()),
        durations=[1, 2],
        sampling_rates=100,
    ),
    TouchPool([("a", NNPOM(0), [0])]),
    NoveltyGuard(make_pipeline(StandardScaler(), NNPOM(0))),
]
NEED_NO_TABLE = [
    "check_estimator_cloneable",
    "check_estimator_repr",
    "check_no_attributes_set_in_init",
    "check_get_params_invariance",
    "check_set_params",
    "check_estimator_tags_renamed",
    "check_valid_tag_types",
    "check_param_validation",
]
BEYOND_THE_SUITE = [
    (estimator, name)
    for estimator in [*TRANSFORMERS, NNPOM(), *PREDICTORS[3:]]
    for name in [
        "check_param_validation",
        "check_dataframe_column_names_consistency",
        "check_n_features_in_after_fitting",
        *(
            [
                "check_set_output_transform",
                "check_set_output_transform_pandas",
                "check_set_output_transform_polars",
                "check_global_output_transform_pandas",
                "check_global_set_output_transform_polars",
                "check_transformer_get_feature_names_out",
                "check_transformer_get_feature_names_out_pandas",
            ]
            if estimator in TRANSFORMERS
            else []
        ),
    ]
] + [(estimator, name) for estimator in OF_TRIALS for name in NEED_NO_TABLE]


def test_every_public_estimator_is_here():
    public = [getattr(sklearn_haptic, name) for name in sklearn_haptic.__all__]
    checked = {
        type(estimator) for estimator in [*TRANSFORMERS, *PREDICTORS, *OF_TRIALS]
    }
    assert {
        each
        for each in public
        if isinstance(each, type) and issubclass(each, BaseEstimator)
    } == checked


# The checks' data are not scaled, so 10 hidden units take long to converge on some.
# Their columns have no names of sensors, and their words no order.
@pytest.mark.filterwarnings("ignore:y has words, which have no order of their own")
@pytest.mark.filterwarnings("ignore:y does not name its levels")
@pytest.mark.filterwarnings("ignore:X has no column names to tell sensors by")
@pytest.mark.filterwarnings("ignore:.*fit was given no groups")
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@parametrize_with_checks([*TRANSFORMERS, *PREDICTORS])
def test_common_checks(estimator, check):
    check(estimator)


# Some of these checks fit on a data frame and transform an array, or the reverse.
@pytest.mark.filterwarnings("ignore:X (has|does not have valid) feature names")
@pytest.mark.filterwarnings("ignore:y does not name its levels")
@pytest.mark.filterwarnings("ignore:X has no column names to tell sensors by")
@pytest.mark.filterwarnings("ignore:.*fit was given no groups")
@pytest.mark.parametrize(("estimator", "name"), BEYOND_THE_SUITE, ids=str)
def test_checks_beyond_the_common_suite(estimator, name):
    getattr(estimator_checks, name)(type(estimator).__name__, estimator)
