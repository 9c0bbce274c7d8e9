"""Where to solve next.

Module               What it answers
-------------------  ----------------------------------------
committee            What the solved cells of a plane say of all others
oracles              Values of picked cells: out of a solved map, or solved live with resume
refine               Cells worth solving, batch by batch -> Refinement
quick_map            A map of one's own bearing in minutes
learning_curve       What refining saves: errors over the number of solved cells
"""
