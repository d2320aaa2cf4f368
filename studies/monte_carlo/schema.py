"""The study file of a Monte Carlo study."""

from typing import Any, Literal

from mcstudy.studyfile.schema import Design, Report, SampledStudy


class MonteCarloStudy(SampledStudy):
    """``kind = "monte-carlo"``: sample inputs, run, describe the outputs."""

    kind: Literal["monte-carlo"]
    design: Design = Design()
    report: Report = Report()

    def design_topics(self) -> dict[str, Any]:
        """Return the parts of the design that affect the values of a run, by topic."""
        return {
            "design.method": self.design.method,
            "design.replicate_size": self.design.size,
        }
