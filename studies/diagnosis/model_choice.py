"""Choice of the diagnosed model: the one that the data name, or that of a study file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcstudy.errors import UserError
from mcstudy.files import read_study_text
from mcstudy.measurement.measured_data import HEADER, Measured
from mcstudy.studyfile.distributions import Distribution
from mcstudy.studyfile.schema import CommonStudy, SampledStudy
from mcstudy.studyfile.study_inputs import fixed_values
from models.registry import load_model, model_names
from studies.kinds import parse_study


@dataclass(frozen=True)
class ModelChoice:
    """The diagnosed model.

    Attributes
    ----------
    name : str
        Name of the model.
    options : dict
        Options of the model.
    effects : dict
        Effects already switched on, with their parameters.
    fixed : dict
        Values of the fixed inputs.
    uncertain : dict
        Distributions of the inputs that all tests share: those that the data call uncertain, then
        those that the study file samples and the data do not state.
    study : CommonStudy, optional
        The study file that it comes from.
    text : str
        The text of that study file, empty without one.
    """

    name: str
    options: Mapping[str, Any]
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    uncertain: Mapping[str, Distribution] = field(default_factory=dict)
    study: CommonStudy | None = None
    text: str = ""


def choose_model(data: Measured, file: Path | None) -> ModelChoice:
    """Return the model of measured data, options and inputs that the data fix included.

    Parameters
    ----------
    data : Measured
        Measured tests.
    file : path, optional
        Study file whose model is diagnosed.

    Raises
    ------
    UserError
        If there is no such model, or an option or fixed input does not fit it.
    """
    header = data.header
    place = data.source / HEADER
    if header.model not in model_names():
        raise UserError(
            f"{place}: model: no model {header.model!r}, only {', '.join(model_names())}"
        )
    options: dict[str, Any] = {}
    effects: Mapping[str, Mapping[str, float]] = {}
    fixed: dict[str, float] = {}
    study, text = None, ""
    if file is not None:
        text = read_study_text(file)
        chosen = parse_study(text, str(file))
        if not isinstance(chosen, CommonStudy):
            raise UserError(f"{file}: a model-comparison has several models; give a study of one")
        study = chosen
        if study.model.name != header.model:
            raise UserError(
                f"{file}: model.name is {study.model.name!r}, but the data are of {header.model!r}"
            )
        options, effects = dict(study.model.options), study.effects
    for name, value in header.fixed.items():
        if isinstance(value, list):
            options[name] = value
    signals = header.signals
    try:
        # The model filters as the laboratory did.
        for name, channel in load_model(header.model, options, effects).channels.items():
            if name in signals and channel.filter_option:
                options[channel.filter_option] = signals[name].channel_class
        model = load_model(header.model, options, effects)
    except (ValueError, TypeError) as error:
        raise UserError(f"{file or place}: model: {error}") from None
    if study is not None:
        fixed |= fixed_values(study.fixed, model)
    known = {item.name: item for item in model.inputs}
    for name, value in header.fixed.items():
        if isinstance(value, list):
            continue
        if name not in known:
            raise UserError(
                f"{place}: fixed.{name}: model {header.model!r} has no such input; it has "
                f"{', '.join(known)}"
            )
        item = known[name]
        if not item.low <= float(value) <= item.high:
            raise UserError(
                f"{place}: fixed.{name}: {float(value):g} {item.unit} is outside {item.low:g} to "
                f"{item.high:g} {item.unit}"
            )
        fixed[name] = float(value)
    uncertain = dict(header.uncertain)
    # Inputs that differ between accidents are not shared unknowns.
    if isinstance(study, SampledStudy) and signals:
        stated = {*header.inputs, *header.uncertain, *header.fixed}
        uncertain |= {k: d for k, d in study.inputs.items() if k not in stated}
    return ModelChoice(header.model, options, effects, fixed, uncertain, study, text)
