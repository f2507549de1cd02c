"""Predict while a robot touches: a node for ROS 2, or any loop of callbacks.

``TouchNode`` does not depend on ROS. A driver calls `on_samples` when it has samples of
a sensor; a timer calls `on_timer` ten times per second. Both must run in one thread,
as the callbacks of a ROS node do by default.

    python examples/run_touch_node.py model.joblib      # a ROS 2 node, with rclpy
    python examples/run_touch_node.py --replay          # a generated touch, without ROS

The node reads a fitted `AnytimeRegressor` from a file that you trust, takes samples
from the topics ``touch/<sensor>`` (``std_msgs/Float32MultiArray``, channels in the last
dimension) and publishes each new prediction to ``touch/proba``. It sends ``touch/done``
(``std_msgs/Empty``) when the finger may be lifted; an empty message on ``touch/start``
begins a new touch.
"""

import sys
import time

import numpy as np


class TouchNode:
    """A touch, fed by callbacks.

    Parameters
    ----------
    model : AnytimeRegressor
    on_proba : callable
        Called with seconds and distribution whenever the prediction has changed.
    on_done : callable
        Called with the seconds, once, when the touch is long enough.
    """

    def __init__(self, model, on_proba, on_done):
        self.touch = model.start()
        self._on_proba, self._on_done = on_proba, on_done
        self.on_start()

    def on_start(self):
        """Begin a new touch."""
        self.touch.reset()
        self._said, self._done = self.touch.predict_proba(), False

    def on_samples(self, sensor, samples):
        """Take new samples of a sensor, of shape (n_new, n_channels)."""
        if not self._done:
            self.touch.update({sensor: samples})

    def on_timer(self):
        """Say what is new."""
        touch = self.touch
        proba = touch.predict_proba()
        if not self._done and not np.array_equal(proba, self._said):
            self._said = proba
            self._on_proba(touch.seconds, proba)
        if touch.done and not self._done:
            self._done = True
            self._on_done(touch.seconds)


def spin(model):
    """Run as a ROS 2 node."""
    import rclpy
    from std_msgs.msg import Empty, Float32MultiArray

    rclpy.init()
    ros = rclpy.create_node("touch")
    proba = ros.create_publisher(Float32MultiArray, "touch/proba", 10)
    done = ros.create_publisher(Empty, "touch/done", 10)
    node = TouchNode(
        model,
        lambda _, shares: proba.publish(Float32MultiArray(data=shares.ravel())),
        lambda _: done.publish(Empty()),
    )

    def listen(sensor):
        shape = model.sample_shapes_[sensor]

        def on_message(message):
            samples = np.asarray(message.data, dtype=float)
            node.on_samples(sensor, samples.reshape(-1, *shape))

        ros.create_subscription(Float32MultiArray, f"touch/{sensor}", on_message, 100)

    for sensor in model.sensors_:
        listen(sensor)
    ros.create_subscription(Empty, "touch/start", lambda _: node.on_start(), 10)
    ros.create_timer(0.1, node.on_timer)
    rclpy.spin(ros)


def replay(node, touch, sampling_rates, seconds=0.01, sleep=time.sleep):
    """Give a node a recorded touch in packets, in real time unless `sleep` does not."""
    begin = time.perf_counter()
    longest = max(len(touch[sensor]) / rate for sensor, rate in sampling_rates.items())
    for packet in range(1, int(np.ceil(longest / seconds)) + 1):
        for sensor, rate in sampling_rates.items():
            start, end = (round(i * seconds * rate) for i in (packet - 1, packet))
            node.on_samples(sensor, touch[sensor][start:end])
        if packet % 10 == 0:
            node.on_timer()
        sleep(max(0.0, begin + packet * seconds - time.perf_counter()))


def main():
    """Train on a generated corpus and replay a touch of an object held out."""
    from sklearn_haptic import AnytimeRegressor, make_haptic_pipeline
    from sklearn_haptic.datasets import make_haptic_corpus
    from sklearn_haptic.streaming import ExpectedGain

    corpus = make_haptic_corpus(30, 2, sensors=["pac", "pdc"], random_state=0)
    new = corpus.objects == corpus.objects[-1]
    model = AnytimeRegressor(
        make_haptic_pipeline(["pac", "pdc"], random_state=0),
        durations=[0.5, 1, 2, 4],
        sampling_rates=corpus.sampling_rates,
        cv=3,
        stopping=ExpectedGain(0.003),
    )
    hard = corpus.ratings["hard"]
    model.fit(corpus.trials[~new], hard[~new], groups=corpus.objects[~new])
    node = TouchNode(
        model,
        lambda seconds, proba: print(f"{seconds:.2f} s", proba.round(2)),
        lambda seconds: print(f"lift the finger after {seconds:.2f} s"),
    )
    replay(node, corpus.trials[new].iloc[0], corpus.sampling_rates)


if __name__ == "__main__":
    if {"-h", "--help"} & {*sys.argv}:
        print(__doc__)
        sys.exit()
    if sys.argv[1:] == ["--replay"]:
        main()
    elif len(sys.argv) == 2 and not sys.argv[1].startswith("-"):
        import joblib

        spin(joblib.load(sys.argv[1]))
    else:
        sys.exit(__doc__)
