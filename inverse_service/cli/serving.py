"""`inverse-service serve`."""

from __future__ import annotations

import socket

from inverse_service.cli.exits import ExitCode
from inverse_service.errors import InputError
from inverse_service.settings import read_settings

EXAMPLE = '{"coordinates": ["x"], "equations": {"x": "-x"}}'


def serve_http(host: str, port: int) -> ExitCode:
    """Serve until stopped; raises InputError where the address cannot be listened on."""
    settings = read_settings()
    listener = _listen(host, port)
    import uvicorn

    from inverse_service.web.application import create_application

    address = _address(host, listener.getsockname()[1])
    print(f"{address}\ncurl -s {address}/v1/solve -H 'Content-Type: application/json' -d '{EXAMPLE}'", flush=True)
    configuration = uvicorn.Config(
        create_application(settings), log_level="warning", server_header=False, timeout_graceful_shutdown=5
    )
    uvicorn.Server(configuration).run(sockets=[listener])
    return ExitCode.DONE


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        return socket.create_server((host, port), family=family)
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or "not an address"
        raise InputError(f"Port {port} of this host cannot be listened on: {reason}; choose another --port.") from None


def _address(host: str, port: int) -> str:
    shown = f"[{host}]" if ":" in host else host
    return f"http://{shown}:{port}"
