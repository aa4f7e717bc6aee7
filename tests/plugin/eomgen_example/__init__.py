"""What a package can add to eomgen, an example of each: `pyproject.toml` names them."""
