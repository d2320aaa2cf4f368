"""The study file of a Monte Carlo study."""

from typing import Literal

from mcstudy.studyfile.schema import DesignedStudy, Report


class MonteCarloStudy(DesignedStudy):
    """``kind = "monte-carlo"``: sample inputs, run, describe the outputs."""

    kind: Literal["monte-carlo"]
    report: Report = Report()
