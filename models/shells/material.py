"""Plane-stress plasticity of sheet metal: von Mises, isotropic hardening, Cowper-Symonds rate.

The yield stress is ``s(p) (1 + (p' / C)^(1 / q))`` with the plastic strain p, its rate p' and the
static curve ``s(p) = yield + slope p + saturation (1 - exp(-p / scale))``. The return is radial in
the two invariants of plane stress (J. C. Simo and R. L. Taylor, Int. J. Numer. Methods Eng. 22,
649, 1986): the trial sum of the normal stresses is divided by ``1 + E g / (3 (1 - nu))``, the
trial difference and the shear stress by ``1 + 2 G g``, with the multiplier g.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models.compilation import inlined_kernel

Array = NDArray[np.float64]

ITERATIONS = 60
TOLERANCE = 1e-8
"""Relative error of the plastic strain of a step, or of the yield condition without a rate."""
ROOT = math.sqrt(2.0 / 3.0)


class Materials(NamedTuple):
    """Sheet metals, one row each.

    Attributes
    ----------
    young : (k,) array
        Young's modulus, Pa.
    poisson : (k,) array
        Poisson's ratio.
    density : (k,) array
        kg/m3.
    yield_stress : (k,) array
        Static initial yield stress, Pa; infinite for an elastic material.
    slope : (k,) array
        Hardening that lasts, Pa.
    saturation, scale : (k,) array
        Hardening that ends (Pa), and the plastic strain over which it does.
    rate, exponent : (k,) array
        C (1/s) and q of Cowper and Symonds; an infinite C for none.
    """

    young: Array
    poisson: Array
    density: Array
    yield_stress: Array
    slope: Array
    saturation: Array
    scale: Array
    rate: Array
    exponent: Array


@inlined_kernel
def static_yield(materials, k, strain):
    """Return the static yield stress (Pa) at a plastic strain."""
    return (
        materials.yield_stress[k]
        + materials.slope[k] * strain
        + materials.saturation[k] * (1.0 - math.exp(-strain / materials.scale[k]))
    )


@inlined_kernel
def static_slope(materials, k, strain):
    """Return the slope (Pa) of the static yield stress at a plastic strain."""
    return materials.slope[k] + materials.saturation[k] / materials.scale[k] * math.exp(
        -strain / materials.scale[k]
    )


@inlined_kernel
def flow_stress(materials, k, strain, rate):
    """Return the yield stress (Pa) at a plastic strain and its rate (1/s)."""
    factor = 1.0
    if rate > 0.0 and materials.rate[k] < math.inf:
        factor += (rate / materials.rate[k]) ** (1.0 / materials.exponent[k])
    return static_yield(materials, k, strain) * factor


@inlined_kernel
def return_to_yield(materials, k, total, difference, shear, strain, step):
    """Return multiplier and plastic strain of a trial stress beyond the static yield stress.

    Newton's method on the plastic strain that the overstress produces in the step, or on the yield
    condition itself without a rate; halved brackets where it leaves them.

    Parameters
    ----------
    materials : Materials
    k : int
        Row of the material.
    total, difference, shear : float
        Trial sum and difference of the normal stresses, and shear stress, Pa.
    strain : float
        Plastic strain before.
    step : float
        Time step, s.

    Returns
    -------
    multiplier, strain : float
        1/Pa, and the plastic strain after.
    """
    young, poisson = materials.young[k], materials.poisson[k]
    a = young / (3.0 * (1.0 - poisson))
    b = young / (1.0 + poisson)
    s = total * total / 6.0
    d = 0.5 * difference * difference + 2.0 * shear * shear
    viscous = materials.rate[k] < math.inf
    pace, power = materials.rate[k] * step, materials.exponent[k]
    # At the upper end the stress is below the initial yield stress, whatever the rate.
    high = 2.0 * math.sqrt(1.5 * (s + d)) / (materials.yield_stress[k] * min(a, b))
    low, g, found = 0.0, 0.0, strain
    for _ in range(ITERATIONS):
        pa, pb = 1.0 / (1.0 + a * g), 1.0 / (1.0 + b * g)
        length = math.sqrt(s * pa * pa + d * pb * pb)
        shrink = -(s * a * pa * pa * pa + d * b * pb * pb * pb) / length
        found = strain + ROOT * g * length
        gain = ROOT * (length + g * shrink)
        static, slope = static_yield(materials, k, found), static_slope(materials, k, found)
        over = length / (ROOT * static) - 1.0
        change = (shrink / ROOT - (over + 1.0) * slope * gain) / static
        if viscous:
            if over > 0.0:
                flow = pace * over**power
                excess, change = flow - (found - strain), power * flow / over * change - gain
                scale = max(flow, found - strain)
            else:
                excess, change, scale = -(found - strain), -gain, found - strain
        else:
            excess, scale = over, 1.0
        if abs(excess) <= TOLERANCE * scale:
            break
        if excess > 0.0:
            low = g
        else:
            high = g
        g -= excess / change
        if not low < g < high:
            g = 0.5 * (low + high)
    return g, found
