"""What every other package may use, and what knows nothing of rotors.

Module               What it answers
-------------------  ----------------------------------------
errors               InputError: what a person gave is wrong, told in a sentence
units                Shaft speeds in rad/s and rpm
validation           Numbers that a person gave, checked against their range
files                Files written whole or not at all; CSV
npz                  NPZ files: written the same to the byte, read with care
paths                Where the dashboard, the shipped files and the documents lie
private_folders      Folders of this user alone
threads              How many threads linear algebra may use
"""
