"""Shoulder and chest give way more than the tissue data say, so that the head swings further."""

from collections.abc import Mapping

from models.contact.law import ForceCurve

SHOULDER = ("upper_arm", "chest")


def apply(
    tissue: Mapping[str, ForceCurve], parameters: Mapping[str, float]
) -> dict[str, ForceCurve]:
    """Return the force-penetration curves of the body regions with the effect."""
    factor = parameters["factor"]
    softer = {region: tissue[region].scaled(penetration=factor) for region in SHOULDER}
    return {**tissue, **softer}
