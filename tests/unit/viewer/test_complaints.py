"""What the view's server says of what others do to its port."""

import asyncio
import errno
import logging

from aiohttp.http_exceptions import BadHttpMessage

from twinscrew.hil_sim.viewer.server import Complaints, faults_of_ours


def test_too_many_connections_are_one_line_however_often_it_is_tried(capsys):
    complaints, error = Complaints(), OSError(errno.EMFILE, "Too many open files")
    with asyncio.Runner() as runner:
        for _ in range(100):
            complaints.tell(runner.get_loop(), {"message": "accept()", "exception": error})
    said = capsys.readouterr().err
    assert said == "twinscrew: warning: the view's port: Too many open files\n"


def test_other_faults_are_told_as_asyncio_tells_them(caplog):
    with asyncio.Runner() as runner:
        Complaints().tell(runner.get_loop(), {"message": "odd", "exception": ValueError("why")})
    assert "ValueError: why" in caplog.text


def test_what_is_no_http_is_passed_over_and_a_fault_of_ours_is_not(caplog):
    log = faults_of_ours()
    for error in (BadHttpMessage("rubbish"), ZeroDivisionError("ours")):
        log.error("Error handling request", exc_info=error)
    assert [record.levelno for record in caplog.records] == [logging.ERROR]
    assert "ours" in caplog.text
