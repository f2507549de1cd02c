"""Simulated recordings of two BioTac fingers while a robot touches an object.

Pressure comes first: the load of the gripper gives the fluid pressure of each finger.
From it follow vibration (rate of change, friction and the robot's own shaking), the
deformation of the skin under the electrodes (normal load, then shear in a slide), and
heat flow (contact conducts heat out of the warm finger). All functions are pure.
Levels are those of recordings of a PR2 with BioTac fingers, above the level at rest.
"""

import numpy as np
from scipy import fft, signal

from ..recordings._biotac import (
    ELECTRODE_X,
    ELECTRODE_Y,
    FRAME_RATE,
    SAMPLING_RATES,
    SENSORS,
)

_PAC_PER_FRAME = SENSORS["pac"][0]

# Rest level of each raw 12-bit channel, and its noise, in counts.
_REST = {"pac": 2040.0, "pdc": 830.0, "tac": 2040.0, "tdc": 1980.0, "electrodes": 3400}
_NOISE = {"pdc": 0.3, "tac": 0.6, "tdc": 0.3, "electrodes": 0.5}

# Pressure of a light and of a firm object, and sd of its logarithm between trials.
_GRIP = {
    "hold": (130.0, 370.0, 0.12),
    "slow_slide": (75.0, 260.0, 0.30),
    "fast_slide": (45.0, 205.0, 0.33),
}
# Mean and sd of the duration, in frames; that of a squeeze follows the compression.
_FRAMES = {"hold": (1000, 0), "slow_slide": (500, 6), "fast_slide": (290, 45)}
# State of the finger when the recording starts: how far heat flow and the cooling of
# the skin have settled, and which share of a ten-second fall of temperature is over.
_HISTORY = {
    "squeeze": (0.0, 0.0, 0.1),
    "hold": (0.25, 0.1, 0.35),
    "slow_slide": (1.0, 0.9, 1.1),
    "fast_slide": (1.0, 0.9, 1.3),
}
# In slides: friction noise, speed of shear, size of shear, wobble of pressure.
_SLIDE = {
    "slow_slide": (1.0, 1.8, 1.0, 1.0),
    "fast_slide": (2.6, 0.08, 1.25, 4.0),
}

# Electronic noise of P_AC at rest: power spectral density against frequency.
_FLOOR_HZ = [1, 3.5, 7, 14, 28, 57, 113, 226, 452, 800, 1100]
_FLOOR_DB = [-6, -7, -8.4, -9.5, -11.7, -14.3, -14.5, -21.8, -29.8, -33.7, -35]
# Each frame's 22 samples also share a fixed pattern, a trace of multiplexing.
_PATTERN = 4.0 * np.exp(-((np.arange(_PAC_PER_FRAME) + 3) % _PAC_PER_FRAME) / 2.5)
_PATTERN -= _PATTERN.mean()


def touch(material, conditions, procedure, sensors, stream):
    """Simulate one procedure of one trial.

    Parameters
    ----------
    material : mapping
        Of the object: ``firmness`` (about 0 for soft foam, 1 for steel),
        ``compression`` (mm of grip to +500 counts of pressure), ``relaxation``
        (fraction of the pressure lost in ten seconds), ``conduction`` (0 for an
        insulator, 1 for metal), ``roughness`` (standard score), ``friction``
        (coefficient) and ``grip``, ``buzz``, ``shear``, ``contact`` (natural
        logarithms of gains that depend on the object's shape alone).
    conditions : mapping
        Of the trial: what :func:`draw_conditions` returns.
    procedure : {"squeeze", "hold", "slow_slide", "fast_slide"}
        What the robot does.
    sensors : sequence of str
        Which of pac, pdc, tac, tdc and electrodes to simulate.
    stream : callable
        ``stream(k)`` returns the k-th independent random generator of this trial and
        procedure, so that no sensor depends on which others are asked for.

    Returns
    -------
    signals : dict of str to ndarray of shape (n_times, n_channels)
        Counts above rest, float32. Finger 0's channels come before finger 1's.
    """
    pressure = _pressure(material, conditions, procedure, stream(0))
    signals = {}
    for name in sensors:
        rng = stream(1 + list(_SIMULATORS).index(name))
        values = _SIMULATORS[name](pressure, material, conditions, procedure, rng)
        if name != "pac":
            values += rng.normal(scale=_NOISE[name], size=values.shape)
        rest = _REST[name] + rng.uniform(-20, 20, size=values.shape[1])
        counts = np.clip(np.rint(values + rest), 0, 4095) - rest
        signals[name] = counts.astype(np.float32)
    return signals


def draw_conditions(rng):
    """Draw what differs between the trials of an object, in all procedures."""
    share = rng.normal(scale=0.07)
    return {
        "grip": rng.normal(scale=0.1) + np.array([share, -share]),
        "offset": rng.normal(scale=0.6, size=(2, 2)),  # mm, each finger's (x, y)
        "warmth": rng.normal(scale=0.18) + rng.normal(scale=0.1, size=2),
        "drift": rng.normal(scale=3.0) + rng.normal(scale=1.5, size=2),  # counts
        "buzz": rng.normal(scale=0.3),
    }


def _pressure(material, conditions, procedure, rng):
    """Pressure of each finger above rest, in counts: (n_times, 2)."""
    if procedure == "squeeze":
        return _squeeze_pressure(material, conditions, rng)
    soft, firm, spread = _GRIP[procedure]
    level = soft * (firm / soft) ** material["firmness"]
    level = level * np.exp(
        material["grip"]
        + conditions["grip"]
        + spread * rng.normal()
        + 0.25 * spread * rng.normal(size=2)
    )
    mean, sd = _FRAMES[procedure]
    n_times = int(np.clip(rng.normal(mean, sd), mean - 2 * sd, mean + 3 * sd))
    t = (np.arange(n_times) / FRAME_RATE)[:, None]
    if procedure == "hold":
        fast, slow = -np.expm1(-t / 0.6), -np.expm1(-t / 3.5)
        lost = material["relaxation"] * (0.45 * fast + 0.58 * slow)
        closing = 0.06 * np.exp(-t / 0.1)
        return level * (1 - lost - closing) + _shaking(t, material, 0.05, rng)
    ramp = t / t[-1] * rng.normal(scale=0.08, size=2)
    return level * (1 + ramp) + _sliding(t, level, material, procedure, rng)


def _squeeze_pressure(material, conditions, rng):
    """Close at 2.5 mm/s until the pressure is reached, pause, open again."""
    n_times = material["compression"] / 2.5 * FRAME_RATE * 2
    n_times = int(np.clip(n_times * np.exp(rng.normal(scale=0.03)), 300, 1800))
    phase = np.linspace(-1, 1, n_times)[:, None]
    closed = np.clip((1 - np.abs(phase)) / 0.92, 0, 1)
    peak = 480 * np.exp(0.3 * material["grip"] + 0.4 * conditions["grip"])
    t = np.arange(n_times)[:, None] / FRAME_RATE
    late = 1 - 0.5 * material["relaxation"] * np.clip(phase + 0.1, 0, 1)
    uneven = 1 + 0.02 * _slow_noise(n_times, 60, rng)
    pressure = 15 + peak * closed**1.55 * late * uneven
    return pressure + _shaking(t, material, 0.25, rng)


def _sliding(t, level, material, procedure, rng):
    """Wobble, the shake of the start, and slips of the skin, in counts."""
    wobble = _SLIDE[procedure][3]
    start = np.exp(-t / 0.25) * np.cos(2 * np.pi * rng.uniform(6, 9) * t)
    jolt = 0.02 * level * (1 + 2 * material["firmness"]) * rng.normal(1, 0.3, size=2)
    pressure = start * jolt + _shaking(t, material, 0.18 * wobble, rng)
    pressure += 0.004 * wobble * level * _slow_noise(len(t), 12, rng)
    for _ in range(rng.poisson(1.2 * material["friction"] * (wobble > 1))):
        centre, width = rng.uniform(0, t[-1, 0]), rng.uniform(0.02, 0.06)
        depth = level * rng.uniform(0.05, 0.4)
        pressure = pressure - depth * np.exp(-0.5 * ((t - centre) / width) ** 2)
    return pressure


def _shaking(t, material, size, rng):
    """Vibration of the robot at 6–9 Hz, which firm objects pass on."""
    envelope = 1 + 0.4 * _slow_noise(len(t), 100, rng)
    phase = 2 * np.pi * (rng.uniform(6, 9) * t + rng.uniform(size=2))
    amplitude = size * np.exp(2.2 * (material["firmness"] - 0.5))
    return amplitude * envelope * np.sin(phase)


def _slow_noise(n_times, period, rng):
    """Smooth unit noise whose features last about ``period`` frames."""
    knots = rng.normal(size=(n_times // period + 4, 2))
    at = np.arange(n_times) / period
    left = at.astype(int)
    weight = (0.5 - 0.5 * np.cos(np.pi * (at - left)))[:, None]
    return (1 - weight) * knots[left] + weight * knots[left + 1]


def _pdc(pressure, material, conditions, procedure, rng):
    return pressure.copy()


def _pac(pressure, material, conditions, procedure, rng):
    """Rate of change of pressure, friction noise of a slide, electronic noise."""
    n_frames = len(pressure)
    n_samples = n_frames * _PAC_PER_FRAME
    frames = np.arange(n_samples) / _PAC_PER_FRAME
    rate = np.gradient(pressure, axis=0)
    values = np.stack(
        [-110 * np.interp(frames, np.arange(n_frames), r) for r in rate.T], axis=1
    )
    values += np.tile(_PATTERN, n_frames)[:, None]

    n_fft = fft.next_fast_len(n_samples, real=True)
    hertz = fft.rfftfreq(n_fft, 1 / SAMPLING_RATES["pac"])
    density = _pac_density(hertz, material, conditions, procedure, rng)
    noise = rng.normal(size=(len(hertz), 2)) + 1j * rng.normal(size=(len(hertz), 2))
    noise *= np.sqrt(density * n_fft * SAMPLING_RATES["pac"] / 4)
    return values + fft.irfft(noise, n_fft, axis=0)[:n_samples]


def _pac_density(hertz, material, conditions, procedure, rng):
    """One-sided power spectral density of the noise of each finger's P_AC."""
    floor = np.interp(np.log(np.maximum(hertz, 1)), np.log(_FLOOR_HZ), _FLOOR_DB)
    hum = 5.8 * material["firmness"] + 2 * conditions["buzz"]
    hum = 0.024 * np.exp(hum + rng.normal(scale=0.6, size=2))
    density = 10 ** (floor / 10)[:, None] + hum / (1 + (hertz / 14) ** 6)[:, None]
    if procedure in _SLIDE:
        corner = 28 * np.exp(0.2 * material["roughness"])
        shape = 1 / (1 + (hertz / corner) ** 4)
        audible = np.trapezoid(np.where(hertz > 20, shape, 0), hertz)
        rms = _SLIDE[procedure][0] * np.exp(
            0.55
            + 2.15 * material["firmness"]
            + 0.15 * material["roughness"]
            + material["buzz"]
            + conditions["buzz"]
            + rng.normal(scale=0.12, size=2)
        )
        density += rms**2 * shape[:, None] / audible
    return density


def _tac(pressure, material, conditions, procedure, rng):
    """Heat flow: rises within a second of contact, then falls as the skin cools."""
    conduction = material["conduction"]
    contact = np.sqrt(np.maximum(pressure, 0) / 300) * np.exp(
        material["contact"] + conditions["warmth"]
    )
    remains = 0.05 + 0.65 * conduction**1.5
    touched, cooled, _ = _HISTORY[procedure]
    quick = _low_pass(contact, 0.45, start=touched * contact[0])
    slow = _low_pass(quick, 4.0, start=cooled * contact[0])
    flow = quick - (1 - remains) * slow
    gain = 8 + 112 * conduction**0.65
    wander = 1.5 * _slow_noise(len(pressure), 150, rng)
    return gain * flow + wander + 0.5 * conditions["drift"]


def _tdc(pressure, material, conditions, procedure, rng):
    """Temperature: falls from the finger's own, the faster the better it conducts."""
    fall = 3 * (43 / 3) ** material["conduction"] * np.exp(material["contact"])
    fall = fall * np.exp(0.5 * conditions["warmth"] + rng.normal(scale=0.3, size=2))
    area = np.sqrt(np.maximum(pressure, 0) / 300) ** 0.5
    t = np.arange(len(pressure)) / FRAME_RATE
    curve = np.cumsum(area * np.exp(-t / 6)[:, None], axis=0) / FRAME_RATE
    touched, _, cooled = _HISTORY[procedure]
    curve *= (1 - 0.5 * touched) / (6 * -np.expm1(-10 / 6))
    rising = rng.normal(scale=2.0, size=2) * t[:, None] / 10
    return conditions["drift"] + rising - fall * (cooled + curve)


def _electrodes(pressure, material, conditions, procedure, rng):
    """Skin pressed in under the load, bulging at the edges, sheared by a slide."""
    load = np.maximum(pressure, 0) / 170
    progress, fingers = _shear(pressure, material, procedure, rng), []
    for k, (dx, dy) in enumerate(conditions["offset"]):
        width = 4.6 - 1.2 * material["firmness"]
        distance = ((ELECTRODE_X - 2.0 - dx) ** 2 + (ELECTRODE_Y - dy) ** 2) / (
            2 * width**2
        )
        dent = -(30 + 20 * material["firmness"]) * np.exp(-distance)
        bulge = 10 + 50 * (np.abs(ELECTRODE_Y - 0.4 * dy) / 4.9) ** 2
        bulge = bulge * (0.7 + 0.3 * np.exp(-(((ELECTRODE_X - 1) / 6) ** 2)))
        side = np.sign(ELECTRODE_Y) * (1 if k else -1)
        pull = np.where(side > 0, 1.0, -2.2) * (np.abs(ELECTRODE_Y) / 4.86) ** 3
        pull = pull * (0.3 + 0.7 * np.exp(-(((ELECTRODE_X - 1 - dx) / 4) ** 2)))
        fingers.append(
            np.outer(load[:, k] ** 1.4, dent)
            + np.outer(load[:, k] ** 0.65, bulge)
            + np.outer(progress[:, k], pull)
        )
    return np.hstack(fingers)


def _shear(pressure, material, procedure, rng):
    """Drag of a slide in counts of the most strained electrode: (n_times, 2)."""
    if procedure not in _SLIDE:
        return np.zeros_like(pressure)
    _, seconds, size, _ = _SLIDE[procedure]
    drag = (material["friction"] * np.maximum(pressure, 0) / 60) ** 0.5
    t = np.arange(len(pressure))[:, None] / FRAME_RATE
    pulled = -np.expm1(-t / seconds)
    gain = np.exp(material["shear"] + rng.normal(scale=0.15, size=2))
    return 115 * size * gain * drag * pulled


def _low_pass(x, seconds, start):
    """First-order low-pass filter of 100 Hz frames along the first axis."""
    pole = np.exp(-1 / (FRAME_RATE * seconds))
    state = pole * start[None]
    return signal.lfilter([1 - pole], [1, -pole], x, axis=0, zi=state)[0]


_SIMULATORS = {
    "pac": _pac,
    "pdc": _pdc,
    "tac": _tac,
    "tdc": _tdc,
    "electrodes": _electrodes,
}
