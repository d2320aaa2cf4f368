"""The outputs that a study reports."""

from collections.abc import Sequence

from mcstudy.errors import UserError
from mcstudy.simulator import Simulator
from mcstudy.studyfile.schema import SampledStudy

USUAL_OUTPUTS = ("hic15", "throw_distance", "wad")


def report_outputs(study: SampledStudy, model: Simulator) -> list[str]:
    """Return the outputs that a study's report draws.

    Raises
    ------
    UserError
        If the model lacks one of them.
    """
    if study.report.outputs is None:
        known = [item.name for item in model.outputs]
        return [name for name in USUAL_OUTPUTS if name in known] or known[:3]
    check_outputs(study.report.outputs, model, "report.outputs")
    return study.report.outputs


def check_outputs(names: Sequence[str], model: Simulator, place: str) -> None:
    """Check that the model has each of the outputs and that none is named twice.

    Parameters
    ----------
    names : sequence of str
        Outputs.
    model : Simulator
    place : str
        Key of the study file, for messages.

    Raises
    ------
    UserError
        If an output is missing or named twice.
    """
    known = [item.name for item in model.outputs]
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"{place}: names {name!r} twice")
        if name not in known:
            raise UserError(
                f"{place}: model {model.name!r} has no output {name!r}; it has {', '.join(known)}"
            )
