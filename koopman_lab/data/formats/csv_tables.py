"""A CSV file a channel, for PlotJuggler and spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from koopman_lab.bus.message_values import flat_columns, plain_values
from koopman_lab.data.formats.decoded import ARRIVAL, Exported, channel_files, decoded
from koopman_lab.eventlog.eventlog import Event
from koopman_lab.files import replacing_folder


def write(events: Iterable[Event], folder: Path) -> Exported:
    """Write a folder with a file ``CHANNEL.csv`` each, whole or not at all.

    What is no letter, digit or one of ``_.-~`` in a channel's name is in hexadecimal in that of its
    file (:func:`~koopman_lab.files.file_name`).

    Raises
    ------
    OSError
        If ``folder`` exists and is not empty, or cannot be written.
    LogError
        If no message can be decoded.
    """
    written = Exported.nothing()
    tables: dict[str, tuple[list[str], list[dict[str, Any]]]] = {}
    for event, _, _, message in decoded(events, written):
        written.keep(event.channel)
        columns, rows = tables.setdefault(event.channel, ([ARRIVAL], []))
        row = {ARRIVAL: event.timestamp_us} | dict(flat_columns(plain_values(message)))
        if len(row) > len(columns):  # a list may be longer later
            columns.extend(name for name in row if name not in columns)
        rows.append(row)
    written.require_any()
    with replacing_folder(folder) as temporary:
        files = channel_files(temporary, tables, ".csv")
        for file, (columns, rows) in zip(files, tables.values(), strict=True):
            text = io.StringIO()
            writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)
            file.write_text(text.getvalue())
    return written
