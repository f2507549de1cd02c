"""A callback for tests, of scikit-learn's protocol."""


class Recorder:
    """Notes the tasks that finish, also those of parts, and may stop iterations."""

    max_propagation_depth = None

    def __init__(self, stop_after=None):
        self.tasks = []
        self.owners = []  # the class of the estimator of each
        self.stop_after = stop_after

    def setup(self, estimator, context):
        self._note(estimator, "setup")

    def on_fit_task_begin(self, estimator, context):
        pass

    def on_fit_task_end(self, estimator, context):
        self._note(estimator, context.task_name)
        return context.task_name == f"iteration {self.stop_after}"

    def teardown(self, estimator, context):
        self._note(estimator, "teardown")

    def _note(self, estimator, task):
        self.tasks.append(task)
        self.owners.append(type(estimator).__name__)
