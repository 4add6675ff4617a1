"""Messages between an agent's process and the one that measures come whole, however they are cut on the way."""

from __future__ import annotations

import socket
from threading import Thread

import pytest

from trace_dag.evaluation.wire import framed, received


@pytest.mark.parametrize("part_bytes", [1, 3, 4, 5, 1000])
@pytest.mark.parametrize("message", [b"", b"R", bytes(range(256)) * 40])
def test_a_message_in_parts_is_one_message(message: bytes, part_bytes: int) -> None:
    here, there = socket.socketpair()
    data = framed(message)

    def send() -> None:
        for at in range(0, len(data), part_bytes):
            here.sendall(data[at : at + part_bytes])

    with here, there:
        there.settimeout(10.0)
        sender = Thread(target=send)
        sender.start()
        assert received(there) == message
        sender.join()


def test_a_message_cut_off_is_none() -> None:
    here, there = socket.socketpair()
    with there:
        with here:
            here.sendall(framed(b"whole")[:-1])
        with pytest.raises(EOFError):
            received(there)
