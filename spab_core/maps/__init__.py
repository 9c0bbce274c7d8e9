"""Many operating points: planes and lines, how far trouble is.

Module               What it answers
-------------------  ----------------------------------------
stability_map        A plane of operating points; save, load, check
map_netcdf           A map read back from NetCDF
checkpoints          Solved chunks of a long run on disk: open, lock, load, save, resume
parallel             Worker processes of this machine, or a Dask cluster
compute              Cells of a plane and whole maps, solved chunk by chunk
bifurcation          A line of operating points, swept cold, up and down
margin               How far a point of a map is from instability and chaos
solved_margin        How far a point is from the first trouble, solved live
sensitivity          What a changed drawing does to the margin
"""
