"""The base model, without any cause: layouts of the tests and its fit."""

from mcstudy.diagnosis.fit import Fit, fit, start_scores
from mcstudy.diagnosis.layout import Layout, lay_out
from mcstudy.diagnosis.problem import Problem
from mcstudy.diagnosis.repeatability import rescale
from mcstudy.diagnosis.roughness import measure_roughness, widen
from mcstudy.diagnosis.screening import estimate_scatter
from mcstudy.diagnosis.survey import FAR, SCAN, weight_of
from mcstudy.diagnosis.templates import smooth_discrepancy
from mcstudy.errors import UserError


def fit_base(problem: Problem) -> tuple[tuple[Layout, ...], Fit]:
    """Return the layouts of the tests and the fit of the base model.

    Raises
    ------
    UserError
        If the model cannot simulate one of the tests.
    """
    nominal = {}
    for test in problem.tests:
        seen = problem.simulate(problem.nominal_inputs(test), {})
        if seen is None:
            raise UserError(f"test {test.name!r}: the model fails at its recorded inputs")
        nominal[test.name] = seen
    roughness = measure_roughness(problem, nominal) if problem.dear else {}
    layouts = [lay_out(widen(test, roughness), nominal[test.name]) for test in problem.tests]
    start = start_scores(layouts, len(problem.unknowns))
    found = fit(problem, layouts, (), start, SCAN, exact=not problem.dear)
    samples = sum(residual.size for residual in found.residuals)
    # A model that is far from its tests need not be fitted to the end.
    exact = not problem.dear or weight_of(samples, found.misfit) >= FAR
    for _ in range(2):
        scatter = estimate_scatter(found, layouts, smooth_discrepancy(layouts, found))
        start = rescale(layouts, found, scatter)
        found = fit(problem, layouts, (), start, scatter, exact=exact)
    return tuple(layouts), found
