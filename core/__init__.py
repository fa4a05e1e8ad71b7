"""Palpate: replay palpation of soft tissue in FEM, see what the simulation gets wrong, and name the
cause.
"""

if __name__ != "palpate":
    raise ImportError(
        f"{__name__} is a folder of Palpate's sources; write 'import palpate' in its place"
    )
