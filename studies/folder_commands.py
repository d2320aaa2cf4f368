"""Commands on the results folder of a finished or unfinished study."""

from pathlib import Path
from typing import Annotated

import typer

from studies.command_line import Folder, Json, Quiet, app, print_analysis, print_json
from studies.terminal import print_lines, print_path


@app.command()
def report(folder: Folder, quiet: Quiet = False, as_json: Json = False) -> None:
    """Rebuild analysis, figures and report of a results folder without running the model."""
    from mcstudy.execution.results import ResultsFolder
    from studies import api

    results = ResultsFolder(folder)
    analysis = api.build_report(results)
    summary = api.summarise(results)
    print_analysis(analysis, summary, folder, quiet=quiet, as_json=as_json)


@app.command()
def sensitivity(
    folder: Folder,
    output: Annotated[
        list[str] | None, typer.Option(help="An output to rank; may be repeated.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Report folder; by default sensitivity in the folder.")
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Estimate the sensitivity of outputs to inputs from the runs of a results folder."""
    from mcstudy.execution.results import ResultsFolder
    from studies.sensitivity import measure as sensitivity
    from studies.sensitivity import report as sensitivity_report

    target = ResultsFolder(out or folder / "sensitivity")
    analysis = sensitivity.measure_sensitivity(
        ResultsFolder(folder), target, outputs=output or (), quiet=quiet or as_json
    )
    summary = sensitivity_report.summarise(analysis)
    print_analysis(analysis, summary, target.path, quiet=quiet, as_json=as_json)


@app.command()
def status(folder: Folder, as_json: Json = False) -> None:
    """Show the progress of the study in a results folder."""
    from mcstudy.execution.results import ResultsFolder

    results = ResultsFolder(folder)
    manifest, total = results.read_json("manifest.json"), results.design()["n"]
    done, counts = results.progress()
    if as_json:
        print_json({"done": done, "total": total, "counts": counts})
        return
    detail = ", ".join(f"{n} {name}" for name, n in counts.items())
    print(
        f"{manifest.get('study', folder.name)}: {done} of {total} runs done"
        + (f" ({detail})" if detail else "")
    )


@app.command()
def view(
    folder: Folder,
    run: Annotated[
        list[int] | None, typer.Option(help="Number of a run to write as a page; may be repeated.")
    ] = None,
    beside: Annotated[
        list[Path] | None,
        typer.Option(help="Another folder whose runs of these numbers are shown too."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="HTML file of --run; by default viewer.html in the folder.")
    ] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the server; 0 for a free one.")
    ] = 0,
    quiet: Quiet = False,
) -> None:
    """Serve a study on this machine: its explorer and any run in 3-D; or write runs as a page."""
    from mcstudy.errors import UserError
    from mcstudy.execution.results import ResultsFolder

    results = ResultsFolder(folder)
    if not run:
        from studies.serving import serve_study

        with serve_study(results, port) as server:
            print_lines([f"{server.address} (Ctrl-C ends it)"])
            server.serve_forever()
        return
    from studies import api
    from studies.viewing import view_runs

    numbers = list(dict.fromkeys(run))
    runs = {f"run {k}": api.rerun(results, k) for k in numbers}
    title = f"{folder.name}: {', '.join(runs)}"
    for other in beside or []:
        held = ResultsFolder(other)
        runs |= {f"{other.name}, run {k}": api.rerun(held, k) for k in numbers}
    page = view_runs(title, runs)
    if not page:
        raise UserError(f"{folder}: the model of this study has no scene to view")
    target = out or folder / "viewer.html"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page, encoding="utf-8")
    if not quiet:
        print_path("viewer", target)


@app.command()
def infer(
    folder: Folder,
    evidence: Annotated[
        Path, typer.Option(help="Evidence file (TOML), or a posterior study's.", show_default=False)
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Report folder; by default posterior_<name of the file> in the folder."),
    ] = None,
    draws: Annotated[
        Path | None, typer.Option(help="CSV file for equally weighted draws of the posterior.")
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Infer the speed, or another input, from evidence and the runs of a results folder."""
    from mcstudy.execution.results import ResultsFolder
    from studies.inference import evidence as inference
    from studies.posterior.report import summarise

    target = ResultsFolder(out or folder / f"posterior_{evidence.stem}")
    analysis = inference.infer(ResultsFolder(folder), evidence, target)
    if draws is not None:
        inference.posterior_draws(ResultsFolder(folder), evidence).to_csv(draws, index=False)
    print_analysis(analysis, summarise(analysis), target.path, quiet=quiet, as_json=as_json)


@app.command()
def contours(
    folder: Folder,
    output: Annotated[str, typer.Option(help="Output on the vertical axis.")] = "throw_distance",
    over: Annotated[str, typer.Option(help="Input on the horizontal axis.")] = "impact_speed",
    by: Annotated[
        str, typer.Option(help="Input or output that the curves are grouped by.")
    ] = "friction_body_road",
    groups: Annotated[int, typer.Option(min=1, max=6, help="Number of curves.")] = 3,
    out: Annotated[
        Path | None, typer.Option(help="Report folder; by default contours in the folder.")
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Draw an output over an input as a family of curves with bands, from a results folder."""
    from mcstudy.execution.results import ResultsFolder
    from studies.inference.contours import write_contours

    target = ResultsFolder(out or folder / "contours")
    analysis, summary = write_contours(
        ResultsFolder(folder), target, output=output, over=over, by=by, groups=groups
    )
    print_analysis(analysis, summary, target.path, quiet=quiet, as_json=as_json)
