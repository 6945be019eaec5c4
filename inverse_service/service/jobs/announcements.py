"""Front ends tell each other what they changed (LISTEN and NOTIFY), so that none has to look for
it.

All changes of a moment are told at once, after their commit: a NOTIFY in each transaction would
halve the rate of commits, because PostgreSQL commits those one after the other. What is lost, as
with a front end that is killed, the others find when they look again.
"""

import contextlib
import json
import threading
import time
import uuid
from collections.abc import Callable, Iterable, Sequence

import psycopg
from psycopg.rows import DictRow

from inverse_service.service.jobs import model

# What happens within this time (s) is told together.
MOMENT = 0.02
# Changes of one notification: it has 8,000 bytes at most, and a change takes 60.
MOST = 100
# Who listens looks this often (s) whether to end, and waits so long for a server that is away.
LOOK, AWAY = 1.0, 1.0
# What is left to tell at the end waits so long (s) for the server.
PATIENCE = 1.0


class Announcements:
    """What the stores of one database tell each other.

    `send` gives texts to all who listen, the sender too; `connect` opens a connection to listen on.
    """

    def __init__(
        self,
        send: Callable[[list[str]], object],
        connect: Callable[[], psycopg.Connection[DictRow]],
    ) -> None:
        self._send, self._connect = send, connect
        self._sender = uuid.uuid4().hex
        self._changed = threading.Condition()
        self._due = dict[tuple[str, str], None]()
        self._teller: threading.Thread | None = None
        self._is_closed = False
        # Whether what others change is heard now.
        self.is_heard = False

    def tell(self, changes: Iterable[model.Change]) -> None:
        """Tell the others in a moment; of jobs that wait only that there are some."""
        due = {("" if what == "accepted" else id, what): None for id, what, _ in changes}
        with self._changed:
            if not due or self._is_closed:
                return
            self._due |= due
            self._changed.notify()
            if self._teller is None:
                self._teller = threading.Thread(target=self._tell, name="announcing", daemon=True)
                self._teller.start()

    def listen(self, hear: Callable[[Sequence[model.Change]], object]) -> None:
        """From now on call this with what others change."""
        threading.Thread(target=self._listen, args=(hear,), name="listening", daemon=True).start()

    def close(self) -> None:
        """Tell what is left, and hear no more."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()
        if self._teller is not None:
            self._teller.join(PATIENCE)

    def _tell(self) -> None:
        is_last = False
        while not is_last:
            with self._changed:
                self._changed.wait_for(lambda: self._due or self._is_closed)
                due, self._due, is_last = [*self._due], {}, self._is_closed
            parts = [due[place : place + MOST] for place in range(0, len(due), MOST)]
            with contextlib.suppress(model.StoreUnavailable):  # then the others look themselves
                if parts:
                    self._send([json.dumps([self._sender, some]) for some in parts])
            time.sleep(MOMENT)

    def _listen(self, hear: Callable[[Sequence[model.Change]], object]) -> None:
        while not self._is_closed:
            with contextlib.suppress(psycopg.Error), self._connect() as connection:
                connection.execute("LISTEN inverse_service")
                self.is_heard = True
                while not self._is_closed:
                    for heard in connection.notifies(timeout=LOOK, stop_after=1):
                        sender, changes = json.loads(heard.payload)
                        if sender != self._sender:
                            hear([model.Change(id, what) for id, what in changes])
            self.is_heard = False
            time.sleep(0.0 if self._is_closed else AWAY)
