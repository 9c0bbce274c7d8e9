"""From a drawing to the machines that are built after it, and to a better drawing.

Module               What it answers
-------------------  ----------------------------------------
look                 One machine: its grade, and the short line to its first trouble
tolerance            Many machines drawn within tolerances: shares of the grades
drivers              Which tolerance drives the failures, and how far to narrow it
screening            A machine by linear theory alone, in a hundredth of a second
improve              Better drawings: a front of wishes, every design of it solved
"""
