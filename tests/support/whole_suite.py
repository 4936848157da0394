"""A pytest option for CI: the run fails where a folder of tests was left out."""

from pathlib import Path

import pytest

OPTION = "--whole"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(OPTION, action="store_true", help="fail if no test of one of its folders ran")


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption(OPTION) and not hasattr(config, "workerinput"):
        tests = config.rootpath / "tests"
        config.pluginmanager.register(WholeSuite({f.parent for f in tests.rglob("test_*.py")}))


class WholeSuite:
    """Watches which folders' tests run.

    Parameters
    ----------
    folders
        Those that a whole suite runs tests of.
    """

    def __init__(self, folders: set[Path]) -> None:
        self._left_out = folders

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Cross out the folder of a test that ran; failures fail the run by themselves."""
        if report.when == "call" and not report.skipped:
            self._left_out.discard(Path(report.fspath).absolute().parent)

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self._left_out and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        for folder in sorted(self._left_out):
            terminalreporter.write_line(f"LEFT OUT: no test of {folder} ran", red=True)
