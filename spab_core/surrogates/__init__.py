"""Models that predict a map from some of its cells.

Module               What it answers
-------------------  ----------------------------------------
models               The paper's, interpolation, better ones; training sets; predicted maps
theory_trees         Regressors that start from linear theory
classifier           Regimes from the labels of some cells, or from predicted exponents
uncertainty          Conformal intervals, probability of instability and its reliability
metrics              How well they do: the paper's errors and others
ranking              Tables, ties, the ranking
user_data            Exponents from elsewhere, read from CSV
"""
