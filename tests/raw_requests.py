"""HTTP requests as bytes, in which nothing is made proper."""

from __future__ import annotations

import socket

import httpx

__all__ = ["answered", "raw"]


def answered(client: httpx.Client, request: bytes, seconds: float = 10.0) -> bytes:
    """The head of the answer to raw bytes; empty where the server closes without one."""
    url = client.base_url
    with socket.create_connection((url.host, url.port or 80), timeout=seconds) as line:
        line.sendall(request)
        head = b""
        while b"\r\n\r\n" not in head:
            more = line.recv(4096)
            if not more:
                break
            head += more
    return head


def raw(client: httpx.Client, line: str, *headers: str, body: bytes = b"") -> bytes:
    """Return a request with these headers besides the host."""
    host = f"host: {client.base_url.host}:{client.base_url.port}"
    head = "\r\n".join([f"{line} HTTP/1.1", host, *headers])
    return head.encode("latin-1") + b"\r\n\r\n" + body
