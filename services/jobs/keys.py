"""API keys and the browser sessions made from them. Both are random and are kept as SHA-256 only: at 256 random bits
nobody finds the secret of a hash by trying, so a slow hash would only slow the service."""

from __future__ import annotations

import hashlib
import secrets
from dataclasses import dataclass

from sqlalchemy import Engine, Select, delete, or_, select, update

from shared.db.clock import now
from shared.db.engine import reading, transaction
from shared.db.tables import ApiKey, BrowserSession
from shared.domain import new_id

PREFIX = "armature_"
"""Of every key, so that people and scanners for lost secrets know one when they see it."""


@dataclass(frozen=True)
class KeyInfo:
    """A key, without its secret; times in seconds since 1970."""

    id: str
    name: str
    created_at: float
    revoked_at: float | None


def create_key(engine: Engine, name: str) -> tuple[str, str]:
    """Make a key; returns its id, and the key itself, which is not kept and cannot be shown again."""
    secret = PREFIX + secrets.token_urlsafe(32)
    row = ApiKey(id=new_id(), name=name, hash=hash_of(secret))
    with transaction(engine) as session:
        session.add(row)
    return row.id, secret


def list_keys(engine: Engine) -> list[KeyInfo]:
    """All keys, revoked ones too, oldest first."""
    with reading(engine) as session:
        rows = session.scalars(select(ApiKey).order_by(ApiKey.id)).all()
        return [KeyInfo(row.id, row.name, row.created_at, row.revoked_at) for row in rows]


def revoke_key(engine: Engine, id_or_name: str) -> int:
    """End keys and their sessions at once; returns how many. What they own stays."""
    named = or_(ApiKey.id == id_or_name, ApiKey.name == id_or_name)
    with transaction(engine) as session:
        ids = session.scalars(
            update(ApiKey).where(named, ApiKey.revoked_at.is_(None)).values(revoked_at=now()).returning(ApiKey.id)
        ).all()
        session.execute(delete(BrowserSession).where(BrowserSession.key_id.in_(ids)))
    return len(ids)


def key_of(engine: Engine, secret: str) -> KeyInfo | None:
    """The key that somebody shows; None when it is unknown or revoked."""
    return _find(engine, select(ApiKey).where(ApiKey.hash == hash_of(secret)))


def key_of_session(engine: Engine, token: str) -> KeyInfo | None:
    """The key of a browser's session; None when it has ended."""
    hashed, alive = BrowserSession.hash == hash_of(token), BrowserSession.expires_at > now()
    return _find(engine, select(ApiKey).join(BrowserSession).where(hashed, alive))


def open_session(engine: Engine, key_id: str, hours: float) -> str:
    """Log a browser in; returns the token that it keeps. Sessions that have ended are removed on the way."""
    token = secrets.token_urlsafe(32)
    with transaction(engine) as session:
        session.execute(delete(BrowserSession).where(BrowserSession.expires_at <= now()))
        session.add(BrowserSession(hash=hash_of(token), key_id=key_id, expires_at=now() + 3600.0 * hours))
    return token


def close_session(engine: Engine, token: str) -> None:
    """Log a browser out."""
    with transaction(engine) as session:
        session.execute(delete(BrowserSession).where(BrowserSession.hash == hash_of(token)))


def hash_of(secret: str) -> str:
    """What is kept of a secret."""
    return hashlib.sha256(secret.encode()).hexdigest()


def _find(engine: Engine, statement: Select[ApiKey]) -> KeyInfo | None:
    with reading(engine) as session:
        row = session.scalars(statement.where(ApiKey.revoked_at.is_(None))).one_or_none()
        return None if row is None else KeyInfo(row.id, row.name, row.created_at, row.revoked_at)
