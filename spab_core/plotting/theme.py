"""What all Plotly figures share.

Colours are the Okabe-Ito set; scales are safe for colour-blind eyes.
"""

JOURNAL, DISC, SECTION, NEUTRAL = "#0072B2", "#E69F00", "#D55E00", "#808080"
CHOSEN = "chosen point"  # name of the trace that marks it
MLE_LIMIT = 0.6  # the colours saturate there; exponents of settled cells go far below
BEARING_NUMBER_LABEL, MASS_LABEL = "Bearing number Λ", "Rotor mass on one bearing, kg"
