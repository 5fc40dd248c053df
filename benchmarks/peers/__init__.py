"""Agreement and speed against other frame programs, OpenSeesPy and PyNite.

They live in an environment of their own (`make peers`) and run in processes of their own; frames and results
pass between them in files.
"""
