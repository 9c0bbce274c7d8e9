"""Report and saved results: the file to go with the drawing, and everything computed so far."""

import streamlit as st

from spab_core.ui import own_map
from spab_core.ui.margin import margin_panel
from spab_core.ui.own_report import report_buttons
from spab_core.ui.point_bar import point_bar
from spab_core.ui.saved import follow_opened, saved_results
from spab_core.ui.shared import errors_in_words, page_head
from spab_core.ui.verdict import point_verdict
from spab_core.ui.view import NAME_LENGTH, chosen_design, chosen_point

page_head("report and saved results")
follow_opened()
st.markdown("# Report and saved results")
point_bar()
design, (mass, number) = chosen_design(), chosen_point()
left, right = st.columns([1, 1.2], gap="large")
with left:
    st.markdown("## Report")
    with st.container(horizontal=True):
        st.text_input("Project", key="project", max_chars=NAME_LENGTH)
        st.text_input("Author", key="author", max_chars=NAME_LENGTH)
    with errors_in_words():
        own = own_map.map_of(design, mass, number)
    buttons = st.container()
    with buttons:
        point = report_buttons(design, own, mass, number)
    if point:
        point_verdict(point)
        with errors_in_words():
            margin_panel(design, mass, number)
        st.caption(
            "The report begins with this verdict, the limits and what was assumed; its margin is "
            "in it once it is solved"
            + (", and the map of this design." if own else ", a map once there is one.")
        )
with right:
    st.markdown("## Saved results")
    saved_results()
