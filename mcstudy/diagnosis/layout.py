"""The measured data of one test as one vector, and the nuisances of the test.

The nuisances of a test are, in this order: the inputs that are recorded with an uncertainty, the
time origin, the offset of each signal, and the repeatability of the pulse: a few smooth factors in
time and one factor a scalar. All are standard-normal latents.
"""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from mcstudy.diagnosis.problem import Observation, Signal, Test
from mcstudy.diagnosis.time_origin import time_shift

Array = NDArray[np.float64]

TIME_ORIGIN = 2e-4
"""s, standard deviation of a test's time origin (assumed: a few samples)."""
MODES = 5
"""Smooth factors of the pulse from test to test: cosines over its duration."""
PULSE = 0.02
"""Share of the peak at which a pulse begins and ends."""
BIN = 5e-5
"""s: finer samples are averaged."""
LEAD = 5e-3
"""s by which a simulation may begin before the recording."""


@dataclass(frozen=True)
class Scatter:
    """Relative size of the test-to-test repeatability.

    Attributes
    ----------
    level : standard deviation of the whole pulse and of scalars, relative.
    shape : standard deviation of the slowest cosine, relative; the k-th has 1/k^2 of it, as the
        coefficients of a smooth function do.
    """

    level: float
    shape: float

    def sizes(self, modes: int, scalars: int) -> Array:
        """Return the standard deviations of the modes of the pulse, then of the scalars."""
        waves = [self.shape / k**2 for k in range(1, modes)]
        return np.array([*([self.level] if modes else []), *waves, *[self.level] * scalars])


NO_SCATTER = Scatter(0.0, 0.0)


@dataclass(frozen=True)
class Layout:
    """The data vector of a test.

    Attributes
    ----------
    test : the measured test.
    shift : s, shift of its time origin.
    window : s, begin and end of the pulse.
    """

    test: Test
    shift: float
    window: tuple[float, float]

    @functools.cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the nuisances."""
        return (
            *self.test.doubtful,
            *(("time_origin",) if self.test.signals else ()),
            *(f"offset:{signal.name}" for signal in self.test.signals),
            *(f"pulse:{k}" for k in range(MODES) if self.test.signals),
            *(f"scatter:{scalar.name}" for scalar in self.test.scalars if scalar.scatters),
        )

    @functools.cached_property
    def scattering(self) -> NDArray[np.bool_]:
        """Which nuisances describe the repeatability."""
        own = [name.startswith(("pulse:", "scatter:")) for name in self.names]
        return np.array(own, dtype=bool)

    def scatter_sizes(self, scatter: Scatter) -> Array:
        """Return the standard deviations of the repeatability nuisances, in order."""
        scalars = sum(scalar.scatters for scalar in self.test.scalars)
        return scatter.sizes(MODES if self.test.signals else 0, scalars)

    @functools.cached_property
    def roughness(self) -> Array:
        """Jumps (n,) of the whitened simulated vector between neighbouring inputs."""
        samples = sum(signal.time.size for signal in self.test.signals)
        own = [s.roughness / s.sd if s.roughness > 0.0 else 0.0 for s in self.test.scalars]
        return np.concatenate([np.zeros(samples), own])

    @functools.cached_property
    def _modes(self) -> tuple[Array, ...]:
        """The smooth factors (n, MODES) at the times of each signal."""
        return tuple(self.modes(signal.time) for signal in self.test.signals)

    def inputs(self, scores: Array, ranges: Mapping[str, tuple[float, float]]) -> dict[str, float]:
        """Return the inputs of the test at the latents of its nuisances."""
        values = dict(self.test.inputs)
        for (name, sd), score in zip(self.test.doubtful.items(), scores, strict=False):
            low, high = ranges[name]
            values[name] = min(max(values[name] + sd * float(score), low), high)
        return values

    def modes(self, time: Array) -> Array:
        """Return the smooth factors (n, MODES) at times."""
        begin, end = self.window
        phase = np.clip((time - begin) / (end - begin), 0.0, 1.0)
        return np.asarray(np.cos(np.pi * phase[:, None] * np.arange(MODES)))

    def residual(
        self,
        seen: Observation,
        scores: Array,
        scatter: Scatter,
        wide: Mapping[str, float] | None = None,
    ) -> Array:
        """Return the whitened difference of measured and simulated data.

        Parameters
        ----------
        seen : Observation
            Simulated test.
        scores : (q,) array
            Latents of the test's nuisances.
        scatter : Scatter
            Size of the repeatability.
        wide : mapping of str to float, optional
            Factors on the standard deviations of scalars, in place of those of ``seen``.

        Returns
        -------
        (n,) array
        """
        return self._assemble(seen, scores, scatter, wide)[0]

    def widths(self, seen: Observation) -> Array:
        """Return the factors (n,) on the stated deviations of the data that a simulation gives.

        Data that are missing have one.

        Parameters
        ----------
        seen : Observation
            Simulated test.
        """
        samples = sum(signal.time.size for signal in self.test.signals)
        own = [
            seen.widening.get(scalar.name, 1.0) if np.isfinite(scalar.sd) else 1.0
            for scalar in self.test.scalars
        ]
        return np.concatenate([np.ones(samples), own])

    def expand(self, seen: Observation, scores: Array, scatter: Scatter) -> tuple[Array, Array]:
        """Return the whitened residual and the analytic Jacobian of the simulated vector.

        Parameters
        ----------
        seen : Observation
            Simulated test.
        scores : (q,) array
            Latents of the test's nuisances.
        scatter : Scatter
            Size of the repeatability.

        Returns
        -------
        residual : (n,) array
        jacobian : (n, k) array
            In the nuisances other than the recorded inputs.
        """
        residual, columns = self._assemble(seen, scores, scatter, slope=True)
        assert columns is not None
        return residual, columns

    def whitened(self, seen: Observation, scores: Array) -> Array:
        """Return the simulated vector (n,) without repeatability, over the stated deviations."""
        return -self._assemble(
            seen, np.where(self.scattering, 0.0, scores), NO_SCATTER, {}, measured=False
        )[0]

    def simulated(self, seen: Observation, scores: Array, scatter: Scatter) -> Array:
        """Return the simulated vector with all nuisances applied, over the stated deviations.

        Parameters
        ----------
        seen : Observation
            Simulated test.
        scores : (q,) array
            Latents of the test's nuisances.
        scatter : Scatter
            Size of the repeatability.

        Returns
        -------
        (n,) array
        """
        return -self._assemble(seen, scores, scatter, {}, measured=False)[0]

    def cosine(self, signal: str, order: int) -> Array:
        """Return a cosine over the pulse of one signal, as high as its peak, whitened (n,).

        Parameters
        ----------
        signal : str
            Name of the signal.
        order : int
            Half periods over the pulse.
        """

        def values(channel: Signal, phase: Array) -> Array:
            inside = (phase >= 0.0) & (phase <= 1.0)
            peak = np.abs(channel.values).max()
            return np.asarray(peak * np.cos(np.pi * order * phase) * inside)

        return self._of_signal(signal, values)

    def factor(self, signal: str, order: int, seen: Observation, scores: Array) -> Array:
        """Return the response of one simulated signal times a cosine over its pulse, whitened (n,).

        The cosine goes on as it ends beyond the pulse, as the repeatability does: a change that all
        tests share must not look like one of each test.

        Parameters
        ----------
        signal : str
            Name of the signal.
        order : int
            Half periods over the pulse.
        seen : Observation
            Simulated test.
        scores : (q,) array
            Latents of the test's nuisances.
        """
        origin = self.shift + TIME_ORIGIN * scores[len(self.test.doubtful)]
        time, response = seen.response(signal)

        def values(channel: Signal, phase: Array) -> Array:
            wave = np.cos(np.pi * order * np.clip(phase, 0.0, 1.0))
            return np.asarray(wave * np.interp(channel.time - origin, time, response))

        return self._of_signal(signal, values)

    def part(self, signal: str, window: int, windows: int) -> Array:
        """Return a box over one of equal parts of the pulse, as high as the peak, whitened (n,).

        Parameters
        ----------
        signal : str
            Name of the signal.
        window : int
            Number of the part, from 0.
        windows : int
            Number of parts.
        """
        begin, end = self.window

        def values(channel: Signal, _phase: Array) -> Array:
            place = windows * (channel.time - begin) / (end - begin)
            inside = (place >= window) & (place < window + 1)
            return np.asarray(np.abs(channel.values).max() * inside)

        return self._of_signal(signal, values)

    def _of_signal(self, signal: str, values: Callable[[Signal, Array], Array]) -> Array:
        """Return the whitened vector (n,) with the values of one signal and zeros elsewhere.

        ``values`` takes the signal and the phase of its samples, 0 to 1 over the pulse.
        """
        begin, end = self.window
        parts = []
        for channel in self.test.signals:
            table = np.zeros((channel.time.size, 1))
            if channel.name == signal:
                table[:, 0] = values(channel, (channel.time - begin) / (end - begin))
            parts.append(_whiten(table, channel.sd, channel.correlation)[:, 0])
        return np.concatenate([*parts, np.zeros(len(self.test.scalars))])

    def unwhiten(self, vector: Array) -> dict[str, Array]:
        """Return the signals of a whitened vector (n,) in their units, by name."""
        found = {}
        start = 0
        for channel in self.test.signals:
            part = vector[start : start + channel.time.size].copy()
            if channel.correlation > 0.0:
                part[1:] *= np.sqrt(1.0 - channel.correlation**2)
                part = lfilter([1.0], [1.0, -channel.correlation], part)
            found[channel.name] = channel.sd * part
            start += channel.time.size
        return found

    def unit_scalar(self, name: str, seen: Observation) -> Array:
        """Return the whitened vector (n,) that holds one simulated scalar and zeros elsewhere.

        A measured one would go with its own error where it scatters much.

        Parameters
        ----------
        name : str
            Name of the scalar.
        seen : Observation
            Simulated test.
        """
        size = sum(signal.time.size for signal in self.test.signals)
        own = [
            seen.scalars[name] / (s.sd * seen.widening.get(name, 1.0)) if s.name == name else 0.0
            for s in self.test.scalars
        ]
        return np.concatenate([np.zeros(size), own])

    def _assemble(
        self,
        seen: Observation,
        scores: Array,
        scatter: Scatter,
        wide: Mapping[str, float] | None = None,
        *,
        slope: bool = False,
        measured: bool = True,
    ) -> tuple[Array, Array | None]:
        test = self.test
        start = len(test.doubtful)
        signals = len(test.signals)
        own = len(self.names) - start
        parts: list[Array] = []
        slopes: list[Array] = []
        if signals:
            origin = self.shift + TIME_ORIGIN * scores[start]
            offsets = scores[start + 1 : start + 1 + signals]
            sizes = scatter.sizes(MODES, 0)
            pulse = sizes * scores[start + 1 + signals : start + 1 + signals + MODES]
            for k, signal in enumerate(test.signals):
                time, values = seen.signals[signal.name]
                shape = np.interp(signal.time - origin, time, values)
                # What scatters is the acceleration that is felt, before the sensor reads it.
                response = shape
                if signal.name in seen.responses:
                    response = np.interp(signal.time - origin, *seen.response(signal.name))
                modes = self._modes[k]
                factor = 1.0 + modes @ pulse
                simulated = shape + response * (modes @ pulse) + signal.sd * offsets[k]
                given = signal.values if measured else 0.0
                parts.append(
                    _whiten((given - simulated)[:, None], signal.sd, signal.correlation)[:, 0]
                )
                if slope:
                    table = np.zeros((signal.time.size, own))
                    table[:, 0] = -TIME_ORIGIN * np.gradient(shape, signal.time) * factor
                    table[:, 1 + k] = signal.sd
                    table[:, 1 + signals : 1 + signals + MODES] = sizes * modes * response[:, None]
                    slopes.append(_whiten(table, signal.sd, signal.correlation))
        column = own - sum(scalar.scatters for scalar in test.scalars)
        factors = seen.widening if wide is None else wide
        for scalar in test.scalars:
            value = seen.scalars[scalar.name]
            sd = scalar.sd * factors.get(scalar.name, 1.0)
            off = scatter.level * scores[start + column] if scalar.scatters else 0.0
            given = scalar.value if measured else 0.0
            parts.append(np.array([(given - value * (1.0 + off)) / sd]))
            if slope:
                row = np.zeros((1, own))
                if scalar.scatters:
                    row[0, column] = scatter.level * value / sd
                slopes.append(row)
            column += scalar.scatters
        return np.concatenate(parts), np.concatenate(slopes) if slope else None


def _whiten(table: Array, sd: float, correlation: float) -> Array:
    """Return (n, k) columns divided by the noise, neighbouring samples decorrelated."""
    scaled = table / sd
    if correlation == 0.0:
        return scaled
    scaled[1:] = (scaled[1:] - correlation * scaled[:-1]) / np.sqrt(1.0 - correlation**2)
    return scaled


def lay_out(test: Test, seen: Observation) -> Layout:
    """Return the layout of a test; pulse and time origin come from a first simulation."""
    if not test.signals:
        return Layout(test, 0.0, (0.0, 1.0))
    signal = test.signals[0]
    time, values = seen.signals[signal.name]
    # A simulation may last longer than the record and contain later impacts.
    recorded = time - time[0] <= signal.time[-1] - signal.time[0] + LEAD
    time, values = time[recorded], values[recorded]
    large = np.flatnonzero(np.abs(values) >= PULSE * np.abs(values).max())
    window = (float(time[large[0]]), float(time[large[-1]]))
    step = max(float(np.median(np.diff(signal.time))), BIN)
    shift = time_shift(signal.time, signal.values, time, values, step)
    return Layout(test, shift, (window[0] + shift, window[1] + shift))
