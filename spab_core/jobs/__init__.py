"""Background jobs: long work in a process of its own, with its state on disk.

Module               What it answers
-------------------  ----------------------------------------
kinds                What a job can be: its parameters, its work, its result
store                Jobs by their id: submit, find, list, cancel, delete
worker               The process that does one job
"""
