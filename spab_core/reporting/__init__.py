"""Results as files for others.

Module               What it answers
-------------------  ----------------------------------------
export               Figures as HTML and PNG, maps as NetCDF and CSV
report               Design, points, figures, versions and command lines in one HTML file or PDF
"""
