"""What all commands share: the application, its options, and how results are printed."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from mcstudy.errors import UserError
from studies.terminal import print_lines, print_path, print_table

app = typer.Typer(
    help="Monte Carlo uncertainty and injury-risk studies of crash simulations.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

Study = Annotated[Path, typer.Argument(help="Study file (TOML).", show_default=False)]
Folder = Annotated[Path, typer.Argument(help="Results folder.", show_default=False)]
Out = Annotated[
    Path | None, typer.Option(help="Results folder; by default results/<name of the study>.")
]


def _check_workers(value: int) -> int:
    if value == 0 or value < -1:
        raise UserError(f"--workers must be 1 or more, or -1 for one per core, given {value}")
    return value


Workers = Annotated[
    int,
    typer.Option(
        help="Worker processes; -1 for one per core, 1 to run in this process (a crash ends it).",
        callback=_check_workers,
    ),
]
Cluster = Annotated[
    str | None,
    typer.Option(help="Address of a dask scheduler (tcp://...), or local, in place of --workers."),
]
Channel = Annotated[
    list[str] | None,
    typer.Option(
        help="Of ISO-MME tests: code or file of the head channels to take, with ? and * for any "
        "characters; may be repeated."
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print no progress and no summary.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


def print_analysis(
    analysis: Any, summary: Iterable[Any], path: Path, *, quiet: bool, as_json: bool
) -> None:
    """Print an analysis as its summary or as one JSON object, and where its report is.

    Parameters
    ----------
    analysis : Any
        Every number of the report.
    summary : iterable
        Paragraphs and tables.
    path : Path
        Folder of the report.
    quiet : bool
        Print nothing.
    as_json : bool
        Print one JSON object.
    """
    if as_json:
        print_json({"folder": str(path), "analysis": analysis})
        return
    if quiet:
        return
    for part in summary:
        if isinstance(part, str):
            print_lines([part])
        else:
            print_table(part.caption, part.head, part.rows)
    print_path("report", path / "report.html")


def print_json(content: dict[str, Any]) -> None:
    """Print one JSON object."""
    from mcstudy.execution.results import to_json

    sys.stdout.write(to_json(content))
