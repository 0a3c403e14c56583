"""Send what the outbox holds. A message is only a wake-up: losing or doubling one changes nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sqlalchemy import ColumnElement, Engine, func, select, update
from sqlalchemy.orm import Session

from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import Outbox, table_of

AHEAD = 100
"""Messages that the broker holds, at most, of those sent for the first time: it is enough that no process waits. Others
stay in the outbox, from where processes that are soon at the end of their jobs take them (`claim_unsent`)."""
MOST_DOUBLINGS = 6
LONG_AGO = 1.0

SENT_AND_WAITING = (Outbox.due_at > 0, Outbox.sent > 0)
"""Sent, and not claimed since: `due_at` is not null, said so that SQLite too finds them by index."""

_MESSAGES = table_of(Outbox).c
_DUE = (
    select(_MESSAGES.job_id, _MESSAGES.sent)
    .where(_MESSAGES.due_at <= select(now()).scalar_subquery())
    .order_by(_MESSAGES.due_at, _MESSAGES.job_id)
    .limit(AHEAD)
)
"""Asked twenty times a second. The time is asked for once, so that they are found by index."""


def relay(
    engine: Engine, send: Callable[[Sequence[str]], None], resend_after_s: float, backlog: Callable[[], int] = lambda: 0
) -> int:
    """Publish due messages, oldest first, then mark them; returns how many.

    `send` gets the ids of jobs. When it fails, some of its messages may be out, and all are sent again. `backlog`
    counts the messages that the broker holds; none is sent for the first time while that is more than half of `AHEAD`.

    A published job stays in the outbox until it is claimed, and is sent again after `resend_after_s`, twice that,
    and so on: a broker may lose its queue. While it holds a message for each job that was sent and not claimed,
    nothing was lost, and nothing is sent again. So there are never more messages than jobs, however long they wait.
    Published first and marked after, so that a crash in between doubles messages and loses none.
    """
    with reading(engine) as session:
        due = session.connection().execute(_DUE).all()
    if not due:
        return 0
    first, again = ([row.job_id for row in due if bool(row.sent) is sent] for sent in (False, True))
    held = backlog()
    room = AHEAD - held if 2 * held <= AHEAD else 0
    lost = max(0, unclaimed(engine) - held) if again else 0
    sending, waiting = first[:room] + again[:lost], again[lost:]
    if not sending and not waiting:
        return 0
    if sending:
        send(sending)
    with transaction(engine) as session:
        for sent in {row.sent for row in due if row.job_id in sending}:
            job_ids = [row.job_id for row in due if row.sent == sent and row.job_id in sending]
            _put_off(session, job_ids, resend_after_s * 2 ** min(sent, MOST_DOUBLINGS), sent + 1)
        if waiting:
            _put_off(session, waiting, resend_after_s)
    return len(sending)


def recall(engine: Engine) -> int:
    """Make every message due that was sent and led to no claim, as if it had been sent once; returns how many.

    Those that were never sent are younger, and come after them.

    For a broker that is empty although jobs wait: it lost its queue, and that is no reason to wait ever longer.
    """
    with transaction(engine) as session:
        waiting = update(Outbox).where(_free(*SENT_AND_WAITING)).values(due_at=LONG_AGO, sent=1)
        options = {"synchronize_session": False}
        return len(session.execute(waiting.returning(Outbox.job_id), execution_options=options).all())


def unclaimed(engine: Engine) -> int:
    """Count the jobs that were sent and not claimed since."""
    with reading(engine) as session:
        return session.scalar(select(func.count()).where(*SENT_AND_WAITING)) or 0


def _put_off(session: Session, job_ids: list[str], seconds: float, sent: int | None = None) -> None:
    """Unless they were claimed meanwhile."""
    values = {"due_at": now() + seconds} | ({} if sent is None else {"sent": sent})
    still_due = _free(Outbox.job_id.in_(job_ids), Outbox.due_at.is_not(None))
    session.execute(update(Outbox).where(still_due).values(values).execution_options(synchronize_session=False))


def _free(*which: ColumnElement[bool]) -> ColumnElement[bool]:
    """The rows of these that nobody else is changing.

    Who changes one at this moment claims its job, cancels or deletes it, or has sent it too. The relay has many rows at
    a time, of many applications: if it waited for one of them, whoever has that might wait for another of them. So it
    waits for none; a message that it sent and could not mark may be sent once more.
    """
    return Outbox.job_id.in_(select(Outbox.job_id).where(*which).with_for_update(skip_locked=True))
