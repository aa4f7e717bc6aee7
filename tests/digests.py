"""Puts digests in the place of modules too long to read: `python tests/digests.py`, in generated/.

Of a built-in scene whose module has more than `MOST` lines only the SHA-256 is committed, in
generated/SHA256SUMS, which `eomgen generate --check` compares as it does files. After a change:

    eomgen generate --all -o generated && python tests/digests.py
"""

import hashlib
from pathlib import Path

GENERATED = Path(__file__).parent.parent / "generated"
SUMS = GENERATED / "SHA256SUMS"
MOST = 1500
"""Lines of the longest module that someone would read."""


def known() -> dict[str, str]:
    """The digests by file name."""
    lines = SUMS.read_text("utf-8").splitlines() if SUMS.exists() else []
    return {name: digest for digest, name in (line.split("  ") for line in lines)}


def main() -> None:
    """Take long modules out, and keep their digests."""
    digests = known()
    for path in sorted(GENERATED.glob("*.py")):
        content = path.read_bytes()
        if content.count(b"\n") > MOST:
            digests[path.name] = hashlib.sha256(content).hexdigest()
            path.unlink()
        else:
            digests.pop(path.name, None)
    lines = [f"{digest}  {name}\n" for name, digest in sorted(digests.items())]
    SUMS.write_text("".join(lines), "utf-8")


if __name__ == "__main__":
    main()
