"""One SQLite file: opened, brought up to date, written whole or not at all, its errors in one line."""

from __future__ import annotations

import sqlite3
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from envbench.errors import BadInput
from envbench.schema import APPLICATION, MIGRATIONS

_UNWRITABLE = {sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM}
_ADVICE = {
    sqlite3.SQLITE_NOTADB: "is no SQLite file, so no store of envbench: name another file.",
    sqlite3.SQLITE_CORRUPT: "is damaged: restore it from a copy, or name another file.",
    sqlite3.SQLITE_FULL: "cannot grow, the disk is full: free some space, then go on with --resume.",
    sqlite3.SQLITE_BUSY: "is being written by another process: wait for it, or name another file.",
    **dict.fromkeys(_UNWRITABLE, "cannot be written: make the file and its folder writable, or name another place."),
}


def connect(path: Path, create: bool) -> sqlite3.Connection:
    """Open the file at `path` for writing, or for reading where its place is read-only; `create` insists on writing."""
    if path.is_dir():
        raise BadInput(f"{path} is a folder: name the store's file in it.")
    if not create and not path.exists():
        raise BadInput(f"there is no store at {path}: make one with 'envbench run', or name another file.")
    if path.exists() and not _is_sqlite(path):  # SQLite takes a file of a few bytes for an empty database of its own
        raise BadInput(f"{path} {_ADVICE[sqlite3.SQLITE_NOTADB]}")

    def attempt(mode: str) -> sqlite3.Connection:
        uri = f"{path.absolute().as_uri()}?{mode}"
        connection = sqlite3.connect(uri, uri=True, isolation_level=None, timeout=30)
        connection.row_factory = sqlite3.Row
        try:
            for pragma in ("user_version", "foreign_keys = ON", "synchronous = FULL"):
                connection.execute(f"PRAGMA {pragma}")
        except BaseException:
            connection.close()
            raise
        return connection

    try:
        return attempt("mode=rwc" if create else "mode=rw")
    except sqlite3.OperationalError as error:
        # A log beside the file needs a writable folder. Where that is missing, the file can be read as it stands,
        # provided that no log is waiting to be merged into it.
        log = path.with_name(path.name + "-wal")
        if create or _code(error) not in _UNWRITABLE or (log.exists() and log.stat().st_size):
            raise
        return attempt("mode=ro&immutable=1")


def migrate(path: Path, connection: sqlite3.Connection, create: bool) -> None:
    """Check that the file is a store, and lead an older (or, with `create`, an empty) one to the newest schema."""

    def pragma(name: str) -> int:
        return connection.execute(f"PRAGMA {name}").fetchone()[0]

    known = len(MIGRATIONS)
    empty = connection.execute("SELECT 1 FROM sqlite_master").fetchone() is None
    if empty and not create:
        raise BadInput(f"{path} is empty: make a store with 'envbench run', or name another file.")
    if not empty and pragma("application_id") != APPLICATION:
        raise BadInput(f"{path} is an SQLite file, but no store of envbench: name another file.")
    if pragma("user_version") > known:
        made_by = f"made by a newer envbench (schema {pragma('user_version')}, this one knows {known})"
        raise BadInput(f"{path} was {made_by}: upgrade envbench.")
    if empty:
        connection.execute("PRAGMA journal_mode = WAL")
    if create or pragma("user_version") < known:
        with transaction(connection):  # read the number again inside: another process may have been faster
            for number in range(pragma("user_version"), known):
                for statement in MIGRATIONS[number]:
                    connection.execute(statement)
            connection.execute(f"PRAGMA user_version = {known}")  # writes, and so shows whether the file can be


@contextmanager
def transaction(connection: sqlite3.Connection) -> Generator[None]:
    """Commit what happens inside, or leave the file as it was."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        if connection.in_transaction:  # SQLite itself may have rolled back
            connection.execute("ROLLBACK")
        raise


def _is_sqlite(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(16) in (b"", b"SQLite format 3\0")


def _code(error: sqlite3.Error) -> int:
    return getattr(error, "sqlite_errorcode", 0) & 0xFF  # the low byte is the kind, the rest details it


@contextmanager
def worded(path: Path) -> Generator[None]:
    """Turn errors of SQLite and the file system into `BadInput`: one line naming file, trouble and remedy."""
    try:
        yield
    except (sqlite3.IntegrityError, sqlite3.ProgrammingError):
        raise  # a mistake of ours, not of the file
    except sqlite3.Error as error:
        raise BadInput(f"{path} {_ADVICE.get(_code(error), f'cannot be used: {error}.')}") from error
    except OSError as error:
        raise BadInput(f"{path} cannot be used: {error.strerror}; name another place.") from error
