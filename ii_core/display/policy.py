"""Content security policy of pages: scripts and styles of the page itself, and no other host."""

from __future__ import annotations

import hashlib

# Pictures and downloads are made in the page; a served page also reads the files beside it.
POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; img-src data: blob:{images}; "
    "connect-src {connect}; base-uri 'none'; form-action 'none'"
)


def nonce_of(*parts: str) -> str:
    """Return the nonce of a page, a hash of its texts: pages stay equal to the byte, and no text holds its hash."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.encode("utf-8", "surrogatepass") + b"\0")
    return digest.hexdigest()[:32]


def policy(nonce: str, *, served: bool) -> str:
    """Return the policy of a page, for a meta element."""
    images, connect = (" 'self'", "'self'") if served else ("", "'none'")
    return POLICY.format(nonce=nonce, images=images, connect=connect)
