"""Files of a fleet wherever fsspec reaches: listed, read, and written whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from truing.errors import FileError, LibraryMissingError, OutputError
from truing.recording.writer import replace_file

# An object appears there whole when its upload ends; elsewhere a file is written beside its place and moved.
OBJECT_STORES = frozenset({"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oss", "memory"})
# What changes with a file's content, by the names that file systems have for it.
MARKS = ("ETag", "etag", "md5Hash", "mtime", "LastModified", "last_modified", "created")


@dataclass(frozen=True, slots=True)
class Listed:
    """A file of a listing: its size, and a text that changes when the file does."""

    size: int
    mark: str


class Place:
    """A folder, or a single file, on some file system.

    Parameters
    ----------
    url : a path, or what fsspec takes: `s3://bucket/folder`, `gs://...`, `memory://...`.
    """

    def __init__(self, url: str) -> None:
        from fsspec.core import url_to_fs

        self.url = str(url).rstrip("/") or "/"
        with _explained(self.url, "reached", FileError):
            self._fs, self._root = url_to_fs(self.url)
        protocol = self._fs.protocol
        names = {protocol} if isinstance(protocol, str) else set(protocol)
        self.is_local = "file" in names
        self._is_store = bool(names & OBJECT_STORES)

    def __truediv__(self, name: str) -> Place:
        return Place(f"{self.url}/{name}")

    @property
    def path(self) -> Path:
        """As a path of this computer; of local places only."""
        return Path(self._root)

    def exists(self) -> bool:
        """Whether a file or folder is there."""
        with _explained(self.url, "reached", FileError):
            return bool(self._fs.exists(self._root))

    def is_folder(self) -> bool:
        """Whether it is a folder (a prefix with objects, in a store)."""
        with _explained(self.url, "reached", FileError):
            return bool(self._fs.isdir(self._root))

    def listing(self) -> dict[str, Listed]:
        """All files below, by their paths from here, in order; of a single file, itself."""
        with _explained(self.url, "listed", FileError):
            self._fs.invalidate_cache()
            found: dict[str, dict[str, Any]] = self._fs.find(self._root, detail=True)
        begin = len(self._root.rstrip("/")) + 1
        listed = {path[begin:] or path.rsplit("/", 1)[-1]: _listed(info) for path, info in found.items()}
        return dict(sorted(listed.items()))

    def read(self) -> bytes:
        """The whole file."""
        with _explained(self.url, "read", FileError):
            data: bytes = self._fs.cat_file(self._root)
        return data

    def write(self, data: bytes) -> None:
        """Put a file there in one step: readers see the old one or the new one, never a part.

        Raises
        ------
        OutputError : says why it cannot be written.
        """
        if self.is_local:
            replace_file(self.path, data)
            return
        with _explained(self.url, "written", OutputError):
            if self._is_store:
                self._fs.pipe_file(self._root, data)
                return
            self._fs.makedirs(self._root.rsplit("/", 1)[0], exist_ok=True)
            beside = f"{self._root}.{uuid.uuid4().hex[:8]}.part"
            self._fs.pipe_file(beside, data)
            self._fs.mv(beside, self._root)

    def fetch(self, into: Path) -> Path:
        """Copy the file, or the folder with all that is in it, into a local folder; where it lies then."""
        target: Path = into / self._root.rstrip("/").rsplit("/", 1)[-1]
        with _explained(self.url, "read", FileError):
            if self._fs.isdir(self._root):
                self._fs.get(self._root.rstrip("/") + "/", f"{target}/", recursive=True)
            else:
                self._fs.get_file(self._root, str(target))
        return target


def stamp_of(files: dict[str, Listed]) -> str:
    """A text that changes when any of these files does."""
    digest = hashlib.sha256()
    for name, file in sorted(files.items()):
        digest.update(f"{name}\0{file.size}\0{file.mark}\n".encode())
    return digest.hexdigest()[:16]


def _listed(info: dict[str, Any]) -> Listed:
    mark = next((str(info[name]) for name in MARKS if info.get(name) is not None), "")
    return Listed(int(info.get("size") or 0), mark)


@contextmanager
def _explained(url: str, verb: str, kind: type[FileError]) -> Iterator[None]:
    """Turn what a file system raises into one line."""
    try:
        yield
    except FileError:
        raise
    except ImportError as error:
        raise LibraryMissingError(
            f"{url}: a library for this kind of path is not installed ({error})",
            "pip install 'truing[s3]' for S3",
        ) from None
    except FileNotFoundError:
        raise kind(url, "there is no such file or folder") from None
    except (OSError, ValueError) as error:
        full = isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)
        step = "Free some space, then run the same command again: it goes on where it stopped" if full else ""
        raise kind(url, f"cannot be {verb}: {_reason(error)}", step) from None
    except Exception as error:
        if not _is_of_a_store(error):
            raise
        raise kind(url, f"cannot be {verb}: {_reason(error)}") from None


def _is_of_a_store(error: Exception) -> bool:
    """An error of a store's client (no credentials, no answer), which is no OSError."""
    return type(error).__module__.split(".")[0] in {"botocore", "aiobotocore", "aiohttp", "gcsfs", "azure"}


def _reason(error: Exception) -> str:
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return " ".join(text.split()) or type(error).__name__
