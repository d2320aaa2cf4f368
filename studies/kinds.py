"""The kinds of study, and study files of any kind."""

from functools import reduce
from operator import or_
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from mcstudy.files import read_study_text
from mcstudy.studyfile.reading import check_study
from mcstudy.studyfile.schema import AnyStudy
from studies.injury.study import Injury
from studies.kind import StudyKind
from studies.method_comparison.schema import MethodComparison
from studies.model_chain.study import Chain
from studies.model_comparison.study import Comparison
from studies.monte_carlo.study import MonteCarlo
from studies.morris.study import Morris
from studies.multi_fidelity.study import MultiFidelity
from studies.posterior.study import PosteriorOf
from studies.reconstruction.schema import Reconstruction
from studies.response_map.study import ResponseMap
from studies.sobol.study import Sobol

KINDS: dict[str, StudyKind[Any, Any, Any, Any]] = {
    kind.name: kind
    for kind in (
        MonteCarlo(),
        Sobol(),
        Morris(),
        Injury(),
        Comparison(),
        ResponseMap(),
        MultiFidelity(),
        Chain(),
        PosteriorOf(),
    )
}
"""A new kind of study is its folder and one line here."""

_SCHEMAS = [*(kind.schema for kind in KINDS.values()), Reconstruction, MethodComparison]
_ANY_SCHEMA: Any = Annotated[reduce(or_, _SCHEMAS), Field(discriminator="kind")]
_ANY: TypeAdapter[AnyStudy] = TypeAdapter(_ANY_SCHEMA)


def load_study(path: Path | str) -> AnyStudy:
    """Read and check a study file of any kind.

    Raises
    ------
    UserError
        If the file cannot be read or something in it is wrong; the message names the file and the
        place in it.
    """
    return parse_study(read_study_text(path), str(path))


def parse_study(text: str, source: str = "study") -> AnyStudy:
    """Check the text of a study file; see ``load_study``.

    Parameters
    ----------
    text : str
        TOML.
    source : str
        Where it comes from, for messages.
    """
    return check_study(text, source, _ANY)
