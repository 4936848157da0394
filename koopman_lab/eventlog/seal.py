"""The seal of a finished session: size and SHA-256 of each file of its log, in its summary.

It shows damage, which the framing of a log does not: a bit that changes in the middle of a message
leaves every length as it is. Who can write the log can write the seal as well: against a forger it
is no help.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from koopman_lab.errors import LogError
from koopman_lab.eventlog.log_name import SUMMARY_NAME, log_file
from koopman_lab.eventlog.logwriter import files_of_log
from koopman_lab.files import sha256
from koopman_lab.json_file import JsonTable, Refusal, read_table


class SealOfFile(JsonTable):
    """Size and SHA-256 of a file."""

    bytes: int
    sha256: str


class _Summary(JsonTable):
    """What of a summary is read here; the seal is by name of the file."""

    log_files: dict[str, SealOfFile] | None = None


def seal_of(log: Path) -> dict[str, SealOfFile]:
    """Return the seal of a log, by the names of its files.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    return {
        file.name: SealOfFile(bytes=file.stat().st_size, sha256=sha256(file))
        for file in files_of_log(log)
    }


def changes(path: Path) -> list[str]:
    """Return what of a log is not as it was sealed, a line each; none if all is.

    Parameters
    ----------
    path
        A run folder, or a log in one.

    Raises
    ------
    LogError
        If there is no such log, it was never sealed, or the seal cannot be read.
    """
    log = log_file(path)
    if not log.exists():
        raise LogError(f"{log}: no such log; give the session folder or its session.lcm")
    summary = log.with_name(SUMMARY_NAME)
    if not summary.exists():
        raise _no_seal(log, f"there is no {SUMMARY_NAME} beside it")
    refusal = Refusal(summary, "a summary", "nothing tells whether its log is whole", LogError)
    sealed = read_table(refusal, _Summary).log_files
    if sealed is None or log.name not in sealed:
        raise _no_seal(log, f"{SUMMARY_NAME} beside it holds none")
    try:
        return list(_changes(sealed, seal_of(log)))
    except OSError as error:
        raise LogError(f"{log}: cannot be read as a log: {error.strerror}") from None


def _no_seal(log: Path, why: str) -> LogError:
    return LogError(
        f"{log}: no seal to hold it against: {why}; only sessions that came to their end have one, "
        "since this version"
    )


def _changes(sealed: Mapping[str, SealOfFile], present: Mapping[str, SealOfFile]) -> Iterator[str]:
    # Names of a summary are compared, and never opened.
    for name in sorted(sealed.keys() | present.keys()):
        before, now = sealed.get(name), present.get(name)
        if now is None:
            yield f"{name}: was there when the session ended, and is not now"
        elif before is None:
            yield f"{name}: was not there when the session ended"
        elif now.bytes != before.bytes:
            yield f"{name}: has {now.bytes} bytes, {before.bytes} when the session ended"
        elif now.sha256 != before.sha256:
            yield f"{name}: its bytes are not those that it had when the session ended"
