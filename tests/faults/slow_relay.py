"""A relay that lets every answer of a server wait, as one does that is far away or busy.

    python -m tests.faults.slow_relay PORT SERVER_PORT DELAY_S

What a client sends is passed on at once; the first bytes of each answer come after ``DELAY_S``, and one in twenty after
ten times as long.
"""

from __future__ import annotations

import asyncio
import random
import sys

_BLOCK = 1 << 16
_SLOWEST, _HOW_MUCH_SLOWER = 0.05, 10.0


async def _relay(port: int, server_port: int, delay_s: float) -> None:
    draw = random.Random(1)

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        server_reader, server_writer = await asyncio.open_connection("127.0.0.1", server_port)
        asked = asyncio.Event()

        async def forth() -> None:
            while block := await reader.read(_BLOCK):
                asked.set()
                server_writer.write(block)
                await server_writer.drain()
            server_writer.close()

        async def back() -> None:
            while block := await server_reader.read(_BLOCK):
                if asked.is_set():
                    asked.clear()
                    await asyncio.sleep(delay_s * (_HOW_MUCH_SLOWER if draw.random() < _SLOWEST else 1.0))
                writer.write(block)
                await writer.drain()
            writer.close()

        await asyncio.gather(forth(), back(), return_exceptions=True)

    server = await asyncio.start_server(serve, "127.0.0.1", port)
    await server.serve_forever()


if __name__ == "__main__":
    asyncio.run(_relay(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])))
