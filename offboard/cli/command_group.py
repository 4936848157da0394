"""The group of all commands, which imports only the one that is named."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from offboard.cli.command_table import COMMANDS
from offboard.terminal.choices import Commands, Group
from offboard.terminal.exit_codes import MEANINGS, ExitCode


class CommandsByName(Mapping[str, Any]):
    """The commands of the table by their names; each is imported when it is first asked for."""

    def __init__(self) -> None:
        self._imported: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._imported:
            self._imported[name] = _command(name)
        return self._imported[name]

    def __iter__(self) -> Iterator[str]:
        return iter(COMMANDS)

    def __len__(self) -> int:
        return len(COMMANDS)

    def __contains__(self, name: object) -> bool:
        return name in COMMANDS


class KlabGroup(Group):
    """``klab``: its help and its completion are made of the table, without importing a command."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = CommandsByName()

    def get_params(self, ctx: Any) -> list[Any]:
        """Return the options; none of them matters to what a later word may become."""
        return [] if ctx.resilient_parsing else super().get_params(ctx)

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        del ctx
        return list(COMMANDS)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands under their headings."""
        del ctx
        width = max(map(len, COMMANDS))
        for heading in dict.fromkeys(row.heading for row in COMMANDS.values()):
            with formatter.section(heading):
                formatter.write_dl(
                    [
                        (name.ljust(width), row.short_help)
                        for name, row in COMMANDS.items()
                        if row.heading == heading
                    ]
                )

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write what exit codes say."""
        super().format_epilog(ctx, formatter)
        with formatter.section("Exit codes of every command"):
            formatter.write_dl([(str(int(code)), text) for code, text in MEANINGS.items()])

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """Return what the word may become that is being typed."""
        names: Any = {
            name: TyperCommand(name, short_help=row.short_help) for name, row in COMMANDS.items()
        }
        listed = TyperGroup(name=self.name, commands=names, params=self.params)
        return listed.shell_complete(type(ctx)(listed, info_name=self.name), incomplete)

    def make_context(self, *arguments: Any, **settings: Any) -> Any:
        """Read what was typed; ``--help`` is written here."""
        with _ending_in_words():
            return super().make_context(*arguments, **settings)

    def invoke(self, ctx: Any) -> Any:
        """Run the command that was named."""
        with _ending_in_words():
            return super().invoke(ctx)


@contextlib.contextmanager
def _ending_in_words() -> Iterator[None]:
    """End with a code of its own after Ctrl-C, and where whoever read the output has gone."""
    try:
        yield
    except BrokenPipeError:
        raise SystemExit(ExitCode.UNREAD) from None
    except KeyboardInterrupt:
        from offboard.terminal.output import err

        err.print("klab: interrupted")
        raise SystemExit(ExitCode.INTERRUPTED) from None


def _command(name: str) -> Any:
    """Import a command, and make it what the command line library runs."""
    if name not in COMMANDS:
        raise KeyError(name)
    module, _, attribute = COMMANDS[name].place.partition(":")
    target = getattr(import_module(module), attribute)
    if isinstance(target, typer.Typer):
        command: Any = typer.main.get_group(target)
    else:
        alone = Commands(add_completion=False)
        alone.command(name)(target)
        command = typer.main.get_command(alone)
    command.name = name
    command.short_help = COMMANDS[name].short_help
    return command
