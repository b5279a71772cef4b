"""Which format a log is written in, by suffix and by its first bytes, and the reader of that format."""

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from delaytools.measurement.formats.table import Table
from delaytools.signals.trouble import LogError, shown

__all__ = ["BINARY", "known_suffixes", "read_table"]

GROUP = "delaytools.log_formats"  # entry points of other packages: the name is the suffix, the value MODULE:FUNCTION
_TEXT = (".csv", ".txt", ".gz")
_MODULES = {
    ".npz": "npz",
    ".mat": "mat",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".parquet": "parquet",
    ".mf4": "mdf",
    ".mdf": "mdf",
} | dict.fromkeys(_TEXT, "text")
BINARY = tuple(suffix for suffix in _MODULES if suffix not in _TEXT)
_FIRST_BYTES = {
    b"\x89HDF": "hdf5",
    b"MATLAB 7.3": "hdf5",
    b"MATLAB 5.0": "mat",
    b"PAR1": "parquet",
    b"MDF     ": "mdf",
    b"UnFinMF ": "mdf",
    b"PK\x03\x04": "npz",
    b"\x1f\x8b": "text",
}


def known_suffixes() -> tuple[str, ...]:
    """The suffixes that have a reader, those of other packages included."""
    return (*_MODULES, *(f".{point.name}" for point in entry_points(group=GROUP)))


def read_table(path: Path) -> Table:
    """What stands in the file, read by its format's reader.

    Raises LogError: no such file, empty, damaged or truncated, a format whose package is not installed.
    """
    try:
        return _reader(path)(path)
    except (LogError, MemoryError):
        raise
    except FileNotFoundError as error:
        raise LogError("no such file", where=str(path), found=path.name, known=_beside(path)) from error
    except EOFError as error:
        raise LogError("ends in the middle", where=str(path), advice="is the log truncated?") from error
    except OSError as error:
        problem = f"cannot be read: {error.strerror or shown(str(error))}"
        raise LogError(problem, where=str(path), advice="" if error.strerror else _AGAIN) from error
    except Exception as error:  # every package has its own kinds
        raise LogError(
            "damaged or truncated", where=str(path), found=shown(str(error)), advice=_AGAIN
        ) from error


_AGAIN = "is the log truncated? record or copy it again"


def _reader(path: Path) -> Callable[[Path], Table]:
    suffix = path.suffix.lower()
    with path.open("rb") as file:
        start = file.read(512)
    if suffix not in _MODULES:
        for point in entry_points(group=GROUP):
            if f".{point.name}".lower() == suffix:
                return _loaded(point, path)
    told = next((module for first, module in _FIRST_BYTES.items() if start.startswith(first)), "")
    module = told or ("text" if _is_text(start) else _MODULES.get(suffix, "text"))
    if module != "text" and not start:
        raise LogError("the file is empty", where=str(path), advice="is the log truncated?")
    return _loaded(EntryPoint(module, f"delaytools.measurement.formats.{module}:read", GROUP), path)


def _is_text(start: bytes) -> bool:
    return bool(start) and all(byte >= 32 or byte in b"\t\r\n" for byte in start)


def _loaded(point: EntryPoint, path: Path) -> Callable[[Path], Table]:
    try:
        return point.load()
    except ImportError as error:
        ours = point.value.startswith("delaytools.")
        raise LogError(
            f"a {path.suffix} log needs the package {error.name or point.value}, which is not installed",
            where=str(path),
            advice="pip install delaytools[formats]" if ours else f"install what {point.value} needs",
        ) from error


def _beside(path: Path) -> list[str]:
    if not path.parent.is_dir():
        return []
    known = known_suffixes()
    return sorted(p.name for p in path.parent.iterdir() if p.suffix.lower() in known)
