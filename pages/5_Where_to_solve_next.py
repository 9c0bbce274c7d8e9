"""Where to solve next: the cells of the map worth solving, those named next, and what choosing them
saves.
"""

from functools import partial

import streamlit as st

from spab_core.active_learning.committee import DAMPED
from spab_core.active_learning.learning_curve import GOAL, LEARNING_CURVE, goal, load_learning_curve
from spab_core.plotting.surrogates import REFINE_LAYERS, learning_curve_figure
from spab_core.shipped.manifest import ARTIFACTS, REFINED, checked_bytes
from spab_core.ui.downloads import downloads
from spab_core.ui.point_bar import example_line
from spab_core.ui.shared import drawn_refinement, errors_in_words, page_head, reference_refinement
from spab_core.ui.view import JUDGED, choice

page_head("where to solve next")

with errors_in_words():
    refined, rows = reference_refinement(), load_learning_curve(LEARNING_CURVE)

st.markdown("# Which points should I solve next, and how few are enough?")
example_line()
found, share = goal(rows), [f"n/{k}" for k in GOAL]
solved = rows.groupby("divisor")["solved"].first()
error, undamped, chaos = (found.loc[name] for name in ("rmse", "rmse_undamped", "chaos_f1"))
words = (
    f"{solved[GOAL[0]]:,} chosen points ({share[0]}) predict the rest of the map with RMSE "
    f"{error['refined']:.3f} per revolution and F1 of chaos {chaos['refined']:.3f}; "
    f"{solved[GOAL[1]]:,} random points ({share[1]}) with {error['random']:.3f} and "
    f"{chaos['random']:.3f}, by the best model for each {error['best']:.3f} and "
    f"{chaos['best']:.3f}."
)
met = all(row[name] for row in (error, chaos) for name in ("met", "met_best"))
(st.success if met else st.warning)(words)
st.caption(
    f"Without the most strongly damped cells, from Λ = {DAMPED:g} on, the RMSE is "
    f"{undamped['refined']:.3f} "
    f"for the chosen points, {undamped['random']:.3f} for the random ones."
)

left, right = st.columns([1.25, 1], gap="medium")
with left:
    layer = choice("Predicted", REFINE_LAYERS, key="refine_layer")
    figure = drawn_refinement(layer)
    st.plotly_chart(figure, key="plane", width="stretch")
    st.caption(
        f"Black: the {int(refined.solved.sum()):,} solved cells of {refined.batch.size:,}, from a "
        f"coarse start of {refined.metadata['start']} in {refined.metadata['batches']} batches. "
        "Colours: what they predict. Stars: the cells to solve next."
    )
with right:
    suggested = refined.suggestions()
    head, button = st.columns([2, 1], vertical_alignment="bottom")
    head.markdown("## Solve next")
    st.dataframe(
        suggested,
        height=455,
        hide_index=True,
        column_config={
            "bearing_number": st.column_config.NumberColumn("Λ", format="%.4g"),
            "speed_rpm": st.column_config.NumberColumn("rpm", format="%.0f"),
            "rotor_mass_kg": st.column_config.NumberColumn("mass, kg", format="%.4g"),
            "predicted_mle": st.column_config.NumberColumn(
                "MLE", format="%.3f", help="Per revolution, predicted"
            ),
            "deviation": st.column_config.NumberColumn(
                "±", format="%.3f", help="Standard deviation among the trees"
            ),
            "predicted_regime": st.column_config.Column("regime", width=95),
            "probability_unstable": st.column_config.NumberColumn(
                "unstable", format="%.2f", help="Probability that the motion is not periodic"
            ),
            "in_doubt": "in doubt",
        },
    )
    number, mass = (
        f"{a[0]:g}:{a[-1]:g}:{len(a)}" for a in (refined.bearing_number, refined.rotor_mass)
    )
    command = (
        f"spab refine --design my.toml --bearing-number {number} --rotor-mass {mass} --budget "
        f"{int(refined.solved.sum())} --out refined.npz"
    )
    with button:
        downloads(
            "solve_next",
            {"Plane": figure},
            {"Points": suggested.copy, "Learning curve": rows.copy},
            {"npz": partial(checked_bytes, REFINED, ARTIFACTS)},
            command,
        )
    st.markdown("For a bearing of your own:")
    st.code(command, language=None, wrap_lines=True)

st.markdown("## What choosing saves")
judged = choice(
    "Judged on",
    JUDGED,
    key="judged",
    format_func=lambda k: {
        "unsolved": "all cells not solved",
        "withheld": "a fifth that neither may solve",
    }[k],
)
st.plotly_chart(learning_curve_figure(rows, judged), key="curve", width="stretch")
st.caption(
    f"Means over {rows['seed'].nunique()} seeds, bars: one standard deviation; both curves by the "
    "same committee of trees. Of all cells not solved, the hard ones are missing where they were "
    "chosen: a designer's gain. The withheld fifth is the same for both."
)
