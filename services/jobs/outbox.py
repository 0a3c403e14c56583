"""Send what the outbox holds. A message is only a wake-up: losing or doubling one changes nothing."""

from __future__ import annotations

from collections.abc import Callable

from sqlalchemy import Engine, select, update

from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import Outbox

BATCH = 500
MOST_DOUBLINGS = 6


def relay(engine: Engine, send: Callable[[str], None], resend_after_s: float) -> int:
    """Publish due messages, oldest first, then mark them; returns how many.

    A published job stays in the outbox until it is claimed, and is sent again after `resend_after_s`, twice that,
    and so on: a broker may lose its queue. Published first and marked after, so that a crash in between doubles
    messages and loses none.
    """
    with reading(engine) as session:
        due = session.execute(
            select(Outbox.job_id, Outbox.sent)
            .where(Outbox.due_at <= now())
            .order_by(Outbox.due_at, Outbox.job_id)
            .limit(BATCH)
        ).all()
    if not due:
        return 0
    for row in due:
        send(row.job_id)
    with transaction(engine) as session:
        for sent in {row.sent for row in due}:
            session.execute(
                update(Outbox)
                .where(Outbox.job_id.in_([row.job_id for row in due if row.sent == sent]), Outbox.due_at.is_not(None))
                .values(due_at=now() + resend_after_s * 2 ** min(sent, MOST_DOUBLINGS), sent=sent + 1)
            )
    return len(due)
