"""At the end of a run: how near to the recorded cases it came."""

from parity.parity_files import figures


def pytest_terminal_summary(terminalreporter):
    if figures:
        terminalreporter.section("against the recorded cases of the authors' release")
    for line in figures:
        terminalreporter.write_line(line)
