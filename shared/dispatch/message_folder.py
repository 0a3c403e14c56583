"""One queue as a folder of files, in the manner of Maildir.

A message is a file, and every change of its state is one atomic rename on one file system::

    tmp/   being written by a producer
    new/   ready; the names sort by the time of sending
    cur/   claimed by a consumer, not acknowledged yet; the name ends in the time of the claim
    bad/   could not be understood; kept for a person to look at

No reader ever sees a half-written file, because it gets its readable name only when it is complete; and of two
consumers that want the same message the file system lets exactly one rename it. There is no lock, no index and no
server, so nothing can be left locked, stale or running by a process that was killed.

Nothing is synced to disk: a message only says "look at this job", and the database, which is, sends it again.
"""

from __future__ import annotations

import heapq
import os
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from uuid import uuid4

READY, CLAIMED, WRITING, REFUSED = "new", "cur", "tmp", "bad"
STATES = (READY, CLAIMED, WRITING, REFUSED)
SUFFIX = ".msg"

# A listing is remembered for this many claims: reading a folder of 10,000 names for each of them would make draining
# a backlog quadratic, while remembering all of it would let a message that came back wait behind the whole backlog.
CLAIMS_PER_LISTING = 256


class MessageFolder:
    """The messages of one queue.

    Parameters
    ----------
    folder
        Where the queue lives. Made when missing, with its parents.

    Notes
    -----
    One instance belongs to one thread; any number of instances, in any number of processes, may share the folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._ready, self._claimed = folder / READY, folder / CLAIMED
        self._listed: deque[str] = deque()
        self.create()

    def create(self) -> None:
        """Make the folders of the queue, where they are missing."""
        for state in STATES:
            (self.folder / state).mkdir(parents=True, exist_ok=True)

    def put(self, content: bytes) -> None:
        """Add a message at the end of the queue.

        Parameters
        ----------
        content
            The message. It is readable by consumers either completely or not at all.

        Raises
        ------
        OSError
            The folder cannot be written to. No message was added.
        """
        # The identifier makes the name unique whatever the clocks of two producers say.
        name = f"{time.time_ns():020d}-{uuid4().hex}{SUFFIX}"
        draft = self.folder / WRITING / name
        try:
            draft.write_bytes(content)
        except FileNotFoundError:
            self.create()  # somebody emptied the folder under us; it holds nothing that is not in the database
            draft.write_bytes(content)
        draft.rename(self._ready / name)

    def claim(self) -> Path | None:
        """Take the oldest ready message away from every other consumer.

        Returns
        -------
        Path or None
            The claimed file, to be handed to `acknowledge`, `put_back` or `refuse`; None when nothing is ready.
        """
        for name in self._ready_names():
            claimed = self.claimed(f"{name}.{time.time_ns()}")
            try:
                (self._ready / name).rename(claimed)
            except FileNotFoundError:
                continue  # another consumer was faster
            return claimed
        return None

    def claimed(self, name: str) -> Path:
        """Path of the claim with this name, as `claim` returned it."""
        return self._claimed / name

    def acknowledge(self, claimed: Path) -> None:
        """Forget a claimed message for good. Doing so twice, or after the claim expired, does nothing."""
        claimed.unlink(missing_ok=True)

    def put_back(self, claimed: Path) -> None:
        """Make a claimed message ready again, at its old place in the order."""
        try:
            claimed.rename(self._ready / _ready_name(claimed))
        except FileNotFoundError:
            return  # the claim had expired, and somebody else put it back

    def refuse(self, claimed: Path) -> None:
        """Set a message aside that no consumer can understand."""
        try:
            claimed.rename(self.folder / REFUSED / _ready_name(claimed))
        except FileNotFoundError:
            return

    def put_back_expired(self, visibility_timeout_s: float) -> int:
        """Make messages ready again whose consumer neither acknowledged them nor put them back.

        Parameters
        ----------
        visibility_timeout_s
            The age of a claim [s] beyond which its consumer counts as dead. The same rule as on Redis: a consumer
            that is merely slow has its message delivered a second time.

        Returns
        -------
        int
            How many messages came back.
        """
        oldest_claim = time.time_ns() - int(visibility_timeout_s * 1e9)
        expired = [path for path in (self._claimed).iterdir() if _claimed_at(path) < oldest_claim]
        for path in expired:
            self.put_back(path)
        for path in (self.folder / WRITING).iterdir():  # left by producers that were killed while writing
            if _sent_at(path) < oldest_claim:
                path.unlink(missing_ok=True)
        return len(expired)

    def size(self) -> int:
        """Count the ready messages."""
        return sum(1 for name in os.listdir(self._ready) if name.endswith(SUFFIX))

    def purge(self) -> int:
        """Delete the ready messages, and say how many there were."""
        names = [name for name in os.listdir(self._ready) if name.endswith(SUFFIX)]
        for name in names:
            (self._ready / name).unlink(missing_ok=True)
        return len(names)

    def _ready_names(self) -> Iterator[str]:
        """Names of ready messages, oldest first; one fresh listing at most. A name may be gone by now."""
        yield from self._drain_listing()
        try:
            names = os.listdir(self._ready)
        except FileNotFoundError:
            self.create()
            return
        oldest = heapq.nsmallest(CLAIMS_PER_LISTING, (name for name in names if name.endswith(SUFFIX)))
        self._listed.extend(oldest)
        yield from self._drain_listing()

    def _drain_listing(self) -> Iterator[str]:
        while self._listed:
            yield self._listed.popleft()


def _ready_name(claimed: Path) -> str:
    return claimed.name.rpartition(".")[0]


def _claimed_at(path: Path) -> int:
    """Time of a claim [ns since the epoch], from its name; files of other kinds count as claimed right now."""
    _, _, stamp = path.name.rpartition(".")
    return int(stamp) if stamp.isdecimal() else time.time_ns()


def _sent_at(path: Path) -> int:
    """Time of sending [ns since the epoch], from the name; files of other kinds count as sent right now."""
    stamp, _, _ = path.name.partition("-")
    return int(stamp) if stamp.isdecimal() else time.time_ns()
