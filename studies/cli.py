"""The command line: one verb per task, with the same options and exit codes for all.

Exit codes: 0 done, 1 the study failed, 2 the user's input is wrong, 130 interrupted.
"""

import os
import re
import sys
from pathlib import Path
from typing import Annotated, NoReturn

import typer

import studies.folder_commands  # noqa: F401  # registers its commands
from mcstudy.errors import StudyError, UserError, on_one_line
from studies.command_line import (
    Channel,
    Cluster,
    Json,
    Out,
    Quiet,
    Study,
    Workers,
    app,
    print_analysis,
    print_json,
)
from studies.terminal import accept_any_text, print_lines, print_path, print_table


@app.command()
def run(
    study: Study,
    out: Out = None,
    workers: Workers = -1,
    cluster: Cluster = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say runs, time and memory to expect; run nothing.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Run a study, or resume it where it stopped, and write its report."""
    from studies import api

    if dry_run:
        _expect(study, out, workers, as_json=as_json)
        return
    where = workers if cluster is None else cluster
    folder = api.run_study(study, out=out, workers=where, quiet=quiet or as_json)
    analysis = folder.read_json("analysis.json")
    summary = api.summarise(folder)
    print_analysis(analysis, summary, folder.path, quiet=quiet, as_json=as_json)


@app.command()
def reconstruct(study: Study, out: Out = None, quiet: Quiet = False, as_json: Json = False) -> None:
    """Run one case, compare it with published tables and draw it."""
    from studies import api
    from studies.published_tables import as_table

    case, tables, folder = api.run_case(study, out=out, quiet=quiet or as_json)
    if as_json:
        print_json(dict(case.outputs) | {"status": case.status})
    elif not quiet:
        for comparison in tables:
            table = as_table(comparison)
            print_table(table.caption, table.head, table.rows)
        print_lines([f"ended: {case.end_reason.replace('_', ' ')}"])
        print_path("report", folder.path / "report.html")


@app.command("fit-stiffness")
def fit_stiffness(
    data: Annotated[
        Path, typer.Argument(help="Folder of headform tests: measured data or ISO-MME.")
    ],
    out: Out = None,
    zone: Annotated[str, typer.Option(help="Zone of the car that the corridor is for.")] = "hood",
    method: Annotated[
        str, typer.Option(help="How the corridor is built: quantiles or components.")
    ] = "quantiles",
    knots: Annotated[int, typer.Option(help="Maximum knots of a loading curve, 2 to 8.")] = 6,
    channel: Channel = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit force-penetration curves to headform tests and build their stiffness corridor."""
    from mcstudy.execution.results import ResultsFolder
    from studies.stiffness_fit import report as stiffness_report
    from studies.stiffness_fit.study import fit_stiffness_of

    folder = ResultsFolder(out or Path("results") / f"stiffness_{data.resolve().name}")
    analysis = fit_stiffness_of(
        data, folder, zone=zone, method=method, knots=knots, channels=channel or (),
        quiet=quiet or as_json,
    )  # fmt: skip
    summary = [stiffness_report.summary_table(analysis), *analysis.notes]
    print_analysis(analysis, summary, folder.path, quiet=quiet, as_json=as_json)


@app.command("risk-curve")
def risk_curve(
    cases: Annotated[
        Path, typer.Argument(help="Table of cases (CSV, Parquet) or folder of an injury study.")
    ],
    stimulus: Annotated[str, typer.Option(help="Column that the risk depends on.")],
    level: Annotated[
        int,
        typer.Option(min=1, max=6, help="AIS that counts as injured, where there is a column ais."),
    ] = 3,
    scenario: Annotated[
        str | None, typer.Option(help="Scenario of an injury study; by default the reference.")
    ] = None,
    out: Out = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit injury-risk curves to censored cases, as ISO/TS 18506 does."""
    from mcstudy.execution.results import ResultsFolder
    from studies.risk_curve import study as risk_curve

    name = re.sub(r"[^A-Za-z0-9_-]+", "_", f"risk_{cases.resolve().stem}_{stimulus}")
    folder = ResultsFolder(out or Path("results") / name)
    analysis = risk_curve.fit_risk_curves(cases, stimulus, folder, level=level, scenario=scenario)
    summary = [*risk_curve.summarise(analysis), *risk_curve.tables(analysis)]
    print_analysis(analysis, summary, folder.path, quiet=quiet, as_json=as_json)


@app.command()
def diagnose(
    data: Annotated[
        Path,
        typer.Argument(help="Folder of measured data or of ISO-MME tests.", show_default=False),
    ],
    model_config: Annotated[
        Path | None, typer.Option(help="Study file whose model is diagnosed.")
    ] = None,
    channel: Channel = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the simulated data sets.")] = 0,
    out: Out = None,
    workers: Workers = -1,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Find where a model disagrees with tests, the likely cause, and the gain of correcting it."""
    from mcstudy.execution.results import ResultsFolder
    from studies.diagnosis import report as diagnosis_report
    from studies.diagnosis import study as diagnosis

    folder = ResultsFolder(out or Path("results") / f"diagnosis_{data.resolve().name}")
    answer = diagnosis.diagnose(
        data, folder, model_config=model_config, channels=channel or (), seed=seed, workers=workers,
        quiet=quiet or as_json,
    )  # fmt: skip
    summary = [*diagnosis_report.summarise(answer), *diagnosis_report.table_of(answer)]
    print_analysis(answer, summary, folder.path, quiet=quiet, as_json=as_json)


@app.command()
def validate(
    out: Out = None,
    measured: Annotated[
        Path, typer.Option(help="Folder of real measurements; skipped if it is missing.")
    ] = Path("../shared/measured"),
    only: Annotated[list[str] | None, typer.Option(help="Part to run; may be repeated.")] = None,
    diagnosis: Annotated[
        bool, typer.Option("--diagnosis", help="Hide effects in data and measure detection rates.")
    ] = False,
    sets: Annotated[int, typer.Option(min=20, help="Approximate sets with --diagnosis.")] = 300,
    full_scale: Annotated[
        int,
        typer.Option(min=0, help="Sets a cause of full-scale tests and accidents to diagnose."),
    ] = 0,
    workers: Workers = -1,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Run the models against closed forms, published numbers and measurements.

    With --diagnosis: hide effects in data, diagnose them, and print the detection rates (hours; an
    interrupted validation goes on with the same command); with --full-scale N the same for N sets a
    cause of full-scale tests and accidents (minutes a set).
    """
    from mcstudy.execution.results import ResultsFolder
    from studies.validation import report
    from studies.validation.diagnosis import full_scale as full
    from studies.validation.diagnosis import tier

    if full_scale:
        target = ResultsFolder(out or Path("results/validation_full_scale"))
        found = full.validate_full_scale(
            target, Path("configs/accidents.toml"), sets=full_scale, workers=workers,
            quiet=quiet or as_json,
        )  # fmt: skip
        print_analysis(found, full.summarise(found), target.path, quiet=quiet, as_json=as_json)
        return

    if diagnosis:
        target = ResultsFolder(out or Path("results/validation_diagnosis"))
        found = tier.validate_diagnosis(target, sets=sets, workers=workers, quiet=quiet or as_json)
        print_analysis(found, tier.summarise(found), target.path, quiet=quiet, as_json=as_json)
        if missed := tier.failed(found):
            raise StudyError(f"targets missed: {'; '.join(missed)}")
        return
    folder = ResultsFolder(out or Path("results/validation"))
    analysis = report.validate(
        folder, measured=measured, only=only or (), workers=workers, quiet=quiet or as_json
    )
    counts = ", ".join(f"{n} {word}" for word, n in analysis["counts"].items())
    summary = [report.table_of(analysis), f"{len(analysis['checks'])} checks: {counts}"]
    print_analysis(analysis, summary, folder.path, quiet=quiet, as_json=as_json)
    report.check_exact(analysis)


@app.command()
def models(
    name: Annotated[
        str | None, typer.Argument(help="A model, to list its inputs and outputs.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List the models, or the inputs and outputs of one."""
    from studies import listing as catalogue

    if name is None:
        if as_json:
            print_json({"models": list(catalogue.model_names())})
        else:
            print("\n".join(catalogue.model_names()))
        return
    described = catalogue.describe(name)
    if as_json:
        print_json(described)
        return
    for title in ("inputs", "outputs"):
        rows = described[title]
        cells = [
            [f"{v:.5g}" if isinstance(v, float) else str(v) for v in row.values()] for row in rows
        ]
        print_table(title, list(rows[0]), cells)


@app.command()
def effects(
    name: Annotated[
        str | None, typer.Argument(help="An effect, to show its parameters and signature.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List the effects that a model can be extended with, or describe one."""
    from studies import listing as catalogue

    if as_json:
        print_json(
            {"effects": catalogue.describe_effects()}
            if name is None
            else catalogue.describe_effect(name)
        )
        return
    if name is None:
        rows = [
            [row["name"], row["title"], ", ".join(row["models"]),
             ", ".join(p["name"] for p in row["parameters"])]
            for row in catalogue.describe_effects()
        ]  # fmt: skip
        print_table("", ["effect", "description", "models", "parameters"], rows)
        return
    described = catalogue.describe_effect(name)
    lines = [f"{described['name']}: {described['title']}"]
    for key in ("signature", "confusable", "separated_by", "source"):
        text = described[key] if isinstance(described[key], str) else ", ".join(described[key])
        lines.append(f"{key.replace('_', ' ')}: {text or 'nothing'}")
    print_lines(lines)
    head = ["parameter", "unit", "none", "prior", "range", "meaning"]
    keys = ["name", *head[1:]]
    cells = [[str(row[key]) for key in keys] for row in described["parameters"]]
    print_table("", head, cells)


@app.command()
def vehicle(
    mesh: Annotated[
        str,
        typer.Argument(help="STL, PLY, OBJ or LS-DYNA file, car file (TOML), or a vehicle's name."),
    ],
    out: Out = None,
    unit: Annotated[
        str, typer.Option(help="Unit of the file's coordinates: m, cm, mm, in, ft.")
    ] = "m",
    lift: Annotated[float, typer.Option(help="Height to add, in m.")] = 0.0,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Show what is understood of a car's mesh: regions, wrap-around lines, open edges."""
    from studies.vehicle_surface import draw_summary, understand_surface

    summary = understand_surface(mesh, unit, lift)
    picture = draw_summary(summary, out or Path("results") / f"vehicle_{Path(mesh).stem}")
    if as_json:
        print_json(summary.numbers() | {"picture": str(picture)})
    elif not quiet:
        table = summary.table()
        print_table(table.caption, table.head, table.rows)
        print_lines(summary.notes)
        print_path("picture", picture)


def _expect(path: Path, out: Path | None, workers: int, *, as_json: bool) -> None:
    """Print what a study takes."""
    from dataclasses import asdict

    from studies import api, expectation
    from studies.kinds import load_study

    study = load_study(path)
    expected = expectation.expect_study(study, api.results_folder(study, out))
    if as_json:
        print_json({label: asdict(entry) for label, entry in expected.items()})
        return
    table = expectation.expectation_table(expected, workers)
    print_table(table.caption, table.head, table.rows)
    print_lines(expectation.expectation_notes(study))


def main() -> None:
    """Run the command line and exit."""
    accept_any_text((sys.stdout, sys.stderr))
    try:
        # Out of standalone mode Typer returns the code of an exit; an interrupt is one with 130.
        code = app(standalone_mode=False)
    except UserError as error:
        _fail(str(error), 2)
    except StudyError as error:
        _fail(str(error), 1)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Exception as error:
        # Typer's own errors (unknown option, missing file) carry an exit code and a message.
        if hasattr(error, "exit_code") and hasattr(error, "format_message"):
            _fail(error.format_message(), 2)
        raise
    if code == 130:
        _print_failure("interrupted; finished runs are kept, run the same command again to resume")
        sys.stdout.flush()
        # After an interrupt exit at once, without waiting for libraries to shut down.
        os._exit(130)
    sys.exit(code if isinstance(code, int) else 0)


def _fail(message: str, code: int) -> NoReturn:
    _print_failure(message)
    sys.exit(code)


def _print_failure(message: str) -> None:
    print(f"mcstudy: {on_one_line(message)}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
