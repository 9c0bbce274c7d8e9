"""What is drawn: bearing, gas, rotor and contact.

Module               What it answers
-------------------  ----------------------------------------
model                Values in SI units, dimensionless groups, TOML files
form                 The same in the units of a drawing; balance grades; bearing number from rpm
limits               Ranges of an operating point
slips                What looks like a slip: another unit, a decimal comma
presets              Designs to start from (data/)
"""
