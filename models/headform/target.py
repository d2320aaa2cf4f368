"""What a headform strikes, as an interface: inputs, loading curve, and the impact itself."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from models import data
from models.contact.headform import HeadformContact
from models.contact.law import ForceCurve, combine_curves, law_of
from models.effects.chain import EffectChain
from models.headform.impact import Impactor
from models.protocol import Input

Array = NDArray[np.float64]

SAMPLING_RATE = 20_000.0
"""Hz of the accelerometer (SAE J211 asks for ten times the channel frequency class)."""
LONGEST_CONTACT = 1.0
"""s of contact after which a run counts as failed."""
FINEST = 5
"""Smallest number of steps per sample."""
PHASE = 0.05
"""Largest step times the highest natural frequency of the contact (1 is a radian)."""
DAMPING_WEIGHT = 25.0
"""Weight of a damping rate against a frequency in the step: its force starts with a jump."""
MAX_STEPS = 4000
"""Largest number of steps per sample."""
ELASTIC = 1.000001
"""Unloading ratio of an elastic spring; a force curve requires more than one."""


@dataclass(frozen=True)
class Strike:
    """Raw results of a step loop.

    Attributes
    ----------
    speeds : tuple of float
        Initial speeds into and along the surface at the point struck, m/s.
    record : (samples, columns) array
        First columns as in ``models.headform.impact.strike``.
    summary : (SUMMARY,) array
        See ``models.headform.impact.strike``.
    force : (samples, 2 or 3) array
        Components of the force on the headform, the first along the initial normal, N.
    dent : tuple of float
        Largest and permanent penetration of the surface, m.
    doubtful : bool
        Whether the mesh was too coarse for what happened.
    guide : (samples + 2,) array, optional
        Force of the rig's guide on the headform along the normal, against the way in, before
        contact, at each sample and after it, N; by default the headform flies freely.
    """

    speeds: tuple[float, float]
    record: Array
    summary: Array
    force: Array
    dent: tuple[float, float]
    doubtful: bool = False
    guide: Array | None = None


class Target(Protocol):
    """A surface that a headform strikes.

    Attributes
    ----------
    inputs : tuple of Input
        Inputs of the test, those of the headform included.
    effects : tuple of str
        Effects that apply to it.
    without : tuple of str
        Names ``<effect>_<parameter>`` of their parameters that it does not have.
    digest : str
        Identifies a user's own file; part of the model's version.
    """

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs of the test."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects that apply."""

    @property
    def without(self) -> tuple[str, ...]:
        """Parameters of effects that it does not have."""

    @property
    def digest(self) -> str:
        """Digest of a user's own file, or an empty text."""

    def hood_curve(self, values: Mapping[str, float], chain: EffectChain) -> ForceCurve:
        """Return the loading curve of the hood, with effects.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name.
        chain : EffectChain
            Effects that are switched on.
        """

    def strike(
        self, values: Mapping[str, float], chain: EffectChain, impactor: Impactor
    ) -> Strike | None:
        """Return the impact, or None if the headform does not meet the surface.

        Parameters
        ----------
        values : mapping of str to float
            All inputs by name, with effects.
        chain : EffectChain
            Effects that are switched on.
        impactor : Impactor
            The headform.
        """


def steps_per_sample(stiffest: float, damping: float, mass: float) -> int:
    """Return the number of steps of a sample that the stiffest contact needs.

    Parameters
    ----------
    stiffest : float
        Largest slope of the force, N/m.
    damping : float
        N s/m.
    mass : float
        kg.
    """
    frequency = np.sqrt(stiffest / mass) + DAMPING_WEIGHT * damping / mass
    stride = int(np.ceil(frequency / (PHASE * SAMPLING_RATE)))
    return min(max(stride, FINEST), MAX_STEPS)


def impact_axes(normal: Array, heading: Array) -> Array:
    """Return the normal, the direction of the slide and their normal as rows (3, 3).

    Parameters
    ----------
    normal : (3,) array
        Outward unit normal of the surface.
    heading : (3,) array
        Unit vector of the headform's velocity.
    """
    along = heading - (heading @ normal) * normal
    size = float(np.linalg.norm(along))
    slide = np.array([normal[2], 0.0, -normal[0]]) if size < 1e-9 else along
    slide = slide / np.linalg.norm(slide)
    return np.stack([normal, slide, np.cross(normal, slide)])


def vinyl_skin() -> ForceCurve:
    """Return the loading curve of the headforms' vinyl skin."""
    row = data.load("headforms.toml")["skin"]
    knots = np.array(row["curve"])
    return ForceCurve(knots[:, 0].copy(), knots[:, 1].copy(), row["unloading_ratio"])


SKIN_KNOTS = (0.02, 0.06, 0.12, 0.22, 0.36, 0.55, 0.8, 1.1, 1.5, 2.0)
"""Forces of the knots of a curved skin, over the reference force."""
SKIN_REFERENCE = 4000.0
"""N at which the compliance of a skin is given (a usual peak of a headform test)."""


def skin_of(skin: ForceCurve | None, contact: HeadformContact, force: float) -> ForceCurve | None:
    """Return a headform's skin in series with an elastic spring.

    Parameters
    ----------
    skin : ForceCurve, optional
        By default the headform is rigid.
    contact : HeadformContact
        With compliance and exponent of the spring.
    force : float
        Force up to which a linear spring alone has a knot, N.
    """
    if contact.skin_compliance == 0.0:
        return skin
    forces = np.array([0.0, force])
    if skin is not None:
        forces = skin.force
    elif contact.skin_power != 1.0:
        forces = SKIN_REFERENCE * np.array([0.0, *SKIN_KNOTS])
    given = contact.skin_compliance * SKIN_REFERENCE
    spring = given * (forces / SKIN_REFERENCE) ** contact.skin_power
    if skin is None:
        return ForceCurve(spring, forces, ELASTIC)
    return ForceCurve(skin.penetration + spring, forces, skin.unloading_ratio)


def write_law(curve: ForceCurve, skin: ForceCurve | None, law: Array) -> int:
    """Write the combined law of a surface and a headform and return its number of knots.

    Parameters
    ----------
    curve : ForceCurve
        The surface.
    skin : ForceCurve, optional
        The headform's skin; by default it is rigid.
    law : (KNOTS, 4) array
        Filled.
    """
    if skin is None:
        return int(law_of(curve, law))
    return int(
        combine_curves(
            curve.penetration, curve.force, curve.unloading_ratio,
            skin.penetration, skin.force, skin.unloading_ratio, law,
        )
    )  # fmt: skip
