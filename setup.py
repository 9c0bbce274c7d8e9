"""Packages of the wheel: all below spab_core, and the dashboard at the top of the repository as
spab_core.dashboard.
"""

from setuptools import find_packages, setup

setup(packages=[*find_packages(include=["spab_core", "spab_core.*"]), "spab_core.dashboard"])
