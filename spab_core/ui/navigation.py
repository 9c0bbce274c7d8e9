"""The sidebar: what this is for, and the pages under their headings."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import streamlit as st
from streamlit.runtime.scriptrunner import get_script_run_ctx

NAME, PURPOSE = "spab", "will my rotor on porous gas bearings run quietly, and how far is trouble?"
START = "Start"
SECTIONS: dict[str, dict[str, str]] = {  # names of files in pages/, without their numbers; "": home
    "My machine": {
        "": START,
        "My_bearing": "All values of the design",
        "Operating_point": "Motion in detail",
        "Bifurcation": "Speed and mass sweeps",
        "My_map": "Stability map",
        "What_if": "What if",
        "Tolerances_and_improvements": "Tolerances, better drawings",
        "Report": "Report and saved results",
    },
    "Research": {
        "Reproduce_the_paper": "Reproduce the paper",
        "Surrogate_map": "Surrogate maps",
        "Model_ranking": "Model ranking",
        "Where_to_solve_next": "Where to solve next",
    },
    "Reference": {"About_the_model": "Model and validation"},
}
# In the browser, once on a page.
#
# A value typed and a link clicked at once: the browser may send the page first, or the server may
# take both as one, and then value or page is lost. The link waits until the value has been taken.
#
# A comma typed or pasted into a number: a browser whose decimal sign is the point drops it, and 2,5
# would become 25. Where steps are whole, as of rpm, it stands between thousands and may go.
SCRIPT = """<script>
if (!window.spabListens) {
  window.spabListens = true;
  const least = 300, most = 2000;  // ms
  let typed = false, left = -least;
  document.addEventListener("input", () => { typed = true; }, true);
  document.addEventListener("focusout", () => {
    if (typed) left = performance.now();
    typed = false;
  }, true);
  document.addEventListener("click", event => {
    const link = event.target.closest?.("a[data-testid=stPageLink-NavLink]");
    const apart = event.ctrlKey || event.metaKey || event.shiftKey;
    if (!link || apart || !event.isTrusted || performance.now() - left >= least) return;
    event.preventDefault();
    event.stopPropagation();
    const same = `a[data-testid=stPageLink-NavLink][href="${link.getAttribute("href")}"]`;
    const go = () => {
      const waited = performance.now() - left;
      const state = document.querySelector("[data-testid=stApp]")?.dataset.testScriptState;
      if (waited < least || (state !== "notRunning" && waited < most)) setTimeout(go, 50);
      else document.querySelector(same)?.click();  // perhaps drawn anew
    };
    go();
  }, true);
  if ((1.5).toLocaleString()[1] === ".") {
    const number = event => {
      const field = event.target;
      return field.matches?.("input[type=number]") && !(Number(field.step) >= 1);
    };
    const enter = (event, text) => {
      event.preventDefault();
      document.execCommand("insertText", false, text);
    };
    document.addEventListener("keydown", event => {
      if (number(event) && event.key === ",") enter(event, ".");
    }, true);
    document.addEventListener("paste", event => {
      const text = event.clipboardData?.getData("text").trim() ?? "";
      if (number(event) && /^[+-]?\\d+,\\d+$/.test(text)) enter(event, text.replace(",", "."));
    }, true);
  }
}
</script>"""
LABELS = {name: label for pages in SECTIONS.values() for name, label in pages.items()}


def page_path(name: str) -> str | None:
    """Return the script of a page as ``st.page_link`` and ``st.switch_page`` take it.

    Parameters
    ----------
    name : str
        Of ``pages/<number>_<name>.py``; "" is the home page.

    Returns
    -------
    str or None
        None where there is no such page, as where a page is run by itself.
    """
    context = get_script_run_ctx()
    if context is None:
        return None
    home = Path(context.main_script_path)
    if not (home.parent / "pages").is_dir():
        return None
    if not name:
        return home.name
    found = sorted(home.parent.glob(f"pages/*_{name}.py"))
    return f"pages/{found[0].name}" if found else None


def page_link(name: str, label: str = "") -> None:
    """Show a link to a page (:func:`page_path`); nothing where there is no such page."""
    if path := page_path(name):
        st.page_link(path, label=label or LABELS[name])


def sidebar(below: Callable[[], None]) -> None:
    """Show the name, the purpose and the links; ``below`` draws what stands under them."""
    with st.sidebar:
        st.markdown(f"**{NAME}**: {PURPOSE}")
        for heading, pages in SECTIONS.items():
            with st.container(key=f"nav_{heading.lower().replace(' ', '_')}", gap=None):
                st.markdown(f"## {heading}")
                for name, label in pages.items():
                    page_link(name, label)
        below()
