"""Models that predict a map from some of its cells.

Module               What it answers
-------------------  ----------------------------------------
models               The paper's, interpolation, better ones; training sets; predicted maps
theory_trees         Regressors that start from linear theory
classifier           Regime or assessment from the labels of some cells; regimes from exponents
uncertainty          Conformal intervals, probability of instability and its reliability
metrics              How well they do: the paper's errors and others
ranking              Tables, ties, the ranking
paper                The paper's numbers and claims, and which of them hold
samples, columns     Exponents from elsewhere, read from CSV or XLSX; what column names mean
user_data            Models ranked on them
"""
