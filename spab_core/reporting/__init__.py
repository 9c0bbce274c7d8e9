"""Results as files for others.

Module               What it answers
-------------------  ----------------------------------------
datasets             Maps, lines, points as named arrays with units: NetCDF, MATLAB
export               Figures as HTML and PNG; any result as a file for others
report               Design, points, figures, versions and command lines in one HTML file or PDF
"""
