"""Sections of a report: what the tolerances of the drawing mean, and better drawings."""

from __future__ import annotations

import pandas as pd

from spab_core.design.tolerances import value_of
from spab_core.drawings.improve import Improvement
from spab_core.drawings.tolerance import ToleranceStudy
from spab_core.plotting.drawings import (
    drivers_figure,
    front_figure,
    shares_figure,
    spread_figure,
)
from spab_core.reporting.report import Section

NOT_MORE = (
    "A share is that of machines drawn from the distributions given, as likely as they say, one "
    "value independent of the other, judged by this model from one cold start each. It is no "
    "promise: the error of the model, other motions of the same machine, and values without a "
    "tolerance are not in it."
)


def tolerance_section(study: ToleranceStudy) -> Section:
    """Return the section of machines drawn within tolerances."""
    what, table = study.drivers
    figures = {"Shares of the machines drawn": shares_figure(study)}
    if len(table):
        figures[f"What drives it ({what}): Sobol' indices of a forest"] = drivers_figure(
            what, table
        )
    figures["Least film of the machines"] = spread_figure(study, "least_film")
    if study.look.axis:
        figures["Margin of the machines"] = spread_figure(study, "margin")
    given = pd.DataFrame(
        {"value": [value_of(n).label for n in study.names], "": [t.text for t in study.tolerances]}
    )
    return Section("Tolerances", [*study.sentences(), NOT_MORE], {"Tolerances": given}, figures)


def improvement_section(found: Improvement) -> Section:
    """Return the section of a front of better drawings."""
    best = found.best
    tables = {} if best is None else {"What was bought with it": found.bought(best)}
    figures = {"Better drawings, all solved": front_figure(found, best)} if found.count else {}
    return Section("A better drawing", found.sentences(), tables, figures)
