"""The door for design files: read and written as they are, byte for byte."""

from pathlib import Path

from delaytools.design.design import Design, parse_design
from delaytools.signals.trouble import DesignError

__all__ = ["read_design", "write_design"]


def read_design(path: str | Path) -> Design:
    """The design in a file; raises DesignError for a file that is not there or not a design."""
    path = Path(path)
    try:
        text = path.read_bytes().decode("utf-8")
    except FileNotFoundError as error:
        here = sorted(p.name for p in path.parent.glob("*.toml")) if path.parent.is_dir() else []
        raise DesignError("no such file", where=str(path), found=path.name, known=here) from error
    except UnicodeDecodeError as error:
        raise DesignError(
            "not a text file in UTF-8", where=str(path), advice="save the design as UTF-8"
        ) from error
    except OSError as error:
        raise DesignError(f"cannot be read: {error.strerror}", where=str(path)) from error
    if not text.strip():
        raise DesignError("the file is empty", where=str(path), advice="a design has tables [blocks.NAME]")
    return parse_design(text, str(path))


def write_design(design: Design, path: str | Path) -> None:
    """Write the design's text, whole or not at all; raises DesignError where the place cannot be written."""
    path = Path(path)
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(design.text.encode("utf-8"))
        part.replace(path)
    except OSError as error:
        raise DesignError(f"cannot be written: {error.strerror}", where=str(path)) from error
    finally:
        if part.is_file():
            part.unlink()
