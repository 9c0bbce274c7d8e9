"""What artifacts/ holds, and which trained models are opened.

Module               What it answers
-------------------  ----------------------------------------
manifest             Every file with its SHA-256, checked before it is read
provenance           What a model or map was made from, and whether that is still the case
model_files          Files of trained models, opened only after all about them is checked
model_cache          Where models trained on this machine are kept
model_store          Trained models: shipped, kept, or trained now; a predicted point
preset_maps          Maps of the presets: read, solved, stamped anew
predicted_maps       Predicted maps: shipped, or from a model found or trained now
build                Everything computed from the map, rebuilt to the bit
verify               A folder of shipped files, checked
"""
