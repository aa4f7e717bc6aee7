"""The steps of a run, written once: in the subset of Python that `eomgen.subset.words` describes.

Python runs this text as it stands; `eomgen.subset.printing` prints it as C and JavaScript.
"""
