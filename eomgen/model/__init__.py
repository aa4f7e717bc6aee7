"""The mechanical model and its elaboration from a scene."""
