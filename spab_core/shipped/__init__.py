"""What artifacts/ holds, and which trained models are opened.

Module               What it answers
-------------------  ----------------------------------------
manifest             Every file with its SHA-256, checked before it is read
model_store          Trained models and predicted maps: shipped, kept, or trained now
model_cache          Where models trained on this machine are kept
build                Everything computed from the map, rebuilt to the bit
verify               A folder of shipped files, checked
"""
