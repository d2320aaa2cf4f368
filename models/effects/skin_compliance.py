"""Skin compliance: the headform's skin deforms elastically in series with the hood."""

from collections.abc import Mapping
from dataclasses import replace

from models.contact.headform import HeadformContact


def apply(contact: HeadformContact, parameters: Mapping[str, float]) -> HeadformContact:
    """Return the contact with the effect."""
    return replace(contact, skin_compliance=contact.skin_compliance + parameters["compliance"])
