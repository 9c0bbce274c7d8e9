"""What every other package may use, and what knows nothing of rotors.

Module               What it answers
-------------------  ----------------------------------------
errors               InputError: what is wrong with an input, in a sentence
units                Shaft speeds in rad/s and rpm
words                Numbers in sentences
validation           Numbers that a person gave, checked against their range
files                Files written whole or not at all; CSV
tables               Tables of other programs: CSV of any kind, workbooks
arrays               What each kind of NPZ file must hold: a schema, checked on loading
npz                  NPZ files: written the same to the byte, read with care
paths                Where the dashboard, the shipped files and the documents lie
private_folders      Folders of this user alone
processes            Worker processes end with the one that started them
workers              Worker processes of low priority that stay for the next call
source_hash          A hash of source code by what it does
threads              How many threads linear algebra may use
"""
