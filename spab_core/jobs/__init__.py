"""Long work in a process of its own, its state on disk.

Module               What it answers
-------------------  ----------------------------------------
store                Jobs by name: submit, find, cancel, delete; the worker
kinds                What a job can be
"""
